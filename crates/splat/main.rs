//! `splat`: take objects out of a 3D Gaussian splat capture, from a shell.
//!
//! [`commands`] has one file per subcommand and the table of them; the other modules are what several commands share:
//! the file being worked on ([`capture`]), the view ([`camera`]), pictures of frames ([`paint`]), moves ([`moves`]), what is
//! said and where ([`terminal`]), and why something failed ([`failure`]).

mod backend;
mod bench_scene;
mod camera;
mod capture;
mod commands;
mod failure;
mod moves;
mod paint;
mod parse;
mod places;
mod prepare;
mod terminal;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Arg, ArgAction, ArgMatches, value_parser};

use commands::{COMMANDS, main_job};
use failure::Failure;
use terminal::Terminal;

const EXIT_CODES: &str = "\
Exit codes:
  0  done
  1  the job could not be done (a file is missing or damaged, nothing was found, ...)
  2  the command line makes no sense";

const EXAMPLES: &str = "\
Examples:
  splat                                              the main job on the built-in room
  splat info scene.ply                               what is in a capture
  splat render scene.ply -o view.png --orbit 30,20   a picture of it
  splat convert scene.ply scene.spz                  another format
  splat COMMAND --help                               examples for one command";

fn main() -> ExitCode {
    let matches = program().get_matches();
    match run(&matches) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            match &failure {
                Failure::Usage(sentence) => {
                    terminal::say("error", format!("{sentence}\n\nFor more information, try '--help'."));
                }
                Failure::Failed(sentence) => terminal::say("error", sentence),
                Failure::Closed => {}
            }
            failure.exit_code()
        }
    }
}

/// The whole command line, made from [`COMMANDS`].
fn program() -> clap::Command {
    let program = clap::Command::new("splat")
        .version(env!("CARGO_PKG_VERSION"))
        .about("Take objects out of a 3D Gaussian splat capture")
        .long_about(
            "Take objects out of a 3D Gaussian splat capture.\n\nWithout a command: the main job on the built-in room, to see what \
             this does.",
        )
        .after_help(EXIT_CODES)
        .after_long_help(format!("{EXAMPLES}\n\n{EXIT_CODES}"))
        .propagate_version(true)
        .arg(
            Arg::new("out")
                .long("out")
                .short('o')
                .value_name("DIR")
                .value_parser(value_parser!(PathBuf))
                .default_value(main_job::OUT)
                .help("Where the main job puts its results, without a command"),
        )
        .arg(
            Arg::new("quiet")
                .long("quiet")
                .short('q')
                .global(true)
                .action(ArgAction::SetTrue)
                .help_heading("Everywhere")
                .help("Say nothing but the report and errors; no progress"),
        )
        .arg(
            Arg::new("json")
                .long("json")
                .global(true)
                .action(ArgAction::SetTrue)
                .help_heading("Everywhere")
                .help("Report as JSON on standard output"),
        )
        .arg(
            Arg::new("threads")
                .long("threads")
                .global(true)
                .value_name("N")
                .value_parser(value_parser!(u16).range(1..=1024))
                .help_heading("Everywhere")
                .help("Threads to work with [default: one per core]"),
        );
    COMMANDS.iter().fold(program, |program, command| program.subcommand(command.arguments()))
}

fn run(matches: &ArgMatches) -> Result<(), Failure> {
    let terminal = Terminal { quiet: matches.get_flag("quiet"), json: matches.get_flag("json") };
    if let Some(&threads) = matches.get_one::<u16>("threads") {
        rayon::ThreadPoolBuilder::new().num_threads(usize::from(threads)).build_global()?;
    }
    let Some((name, arguments)) = matches.subcommand() else {
        let out = matches.get_one::<PathBuf>("out").map_or(Path::new(main_job::OUT), PathBuf::as_path);
        return main_job::run(out, &terminal);
    };
    match COMMANDS.iter().find(|command| command.name == name) {
        Some(command) => (command.run)(arguments, &terminal),
        None => Err(Failure::usage(format!("there is no command `{name}`"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        program().debug_assert();
    }

    #[test]
    fn every_command_has_help_with_an_example_of_itself() {
        for command in COMMANDS {
            let help = command.arguments().render_long_help().to_string();
            let example = format!("  splat {}", command.name);
            assert!(help.contains("Examples:") && help.contains(&example), "{help}");
        }
    }

    #[test]
    fn every_example_in_the_help_parses() {
        for line in COMMANDS.iter().flat_map(|c| c.examples.lines()).chain(EXAMPLES.lines()) {
            let Some(line) = line.trim().strip_prefix("splat ") else { continue };
            if line.contains("COMMAND") {
                continue;
            }
            // Explanations stand two blanks or more behind the command.
            let words = shell_words(line.split("  ").next().unwrap());
            let parsed = program().try_get_matches_from(std::iter::once("splat".to_owned()).chain(words));
            assert!(parsed.is_ok(), "{line}: {}", parsed.unwrap_err());
        }
    }

    /// Words of a line, with double quotes kept together, up to a pipe, a redirection or another command.
    fn shell_words(line: &str) -> Vec<String> {
        let mut words = vec![String::new()];
        let mut quoted = false;
        for c in line.chars() {
            match c {
                '"' => quoted = !quoted,
                '|' | '>' | '<' | ';' if !quoted => break,
                ' ' if !quoted => words.push(String::new()),
                c => words.last_mut().unwrap().push(c),
            }
        }
        words.into_iter().filter(|w| !w.is_empty()).collect()
    }
}
