//! `splat completions`: what a shell needs to complete `splat` command lines.

use clap::{Args, FromArgMatches};
use clap_complete::Shell;

use super::Command;
use crate::failure::Failure;
use crate::terminal::write_out;

pub(crate) const COMMAND: Command = Command {
    name: "completions",
    about: "Print completions for a shell",
    examples: "  splat completions bash > ~/.local/share/bash-completion/completions/splat\n  \
               splat completions zsh > ~/.zfunc/_splat\n  \
               splat completions fish > ~/.config/fish/completions/splat.fish",
    options: Options::augment_args,
    run: |matches, _| run(&Options::from_arg_matches(matches)?),
};

#[derive(Args, Debug)]
struct Options {
    /// Which shell
    shell: Shell,
}

fn run(options: &Options) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(options.shell, &mut crate::program(), "splat", &mut script);
    write_out(&script)
}
