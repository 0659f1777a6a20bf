//! The same file, camera and size through several splat renderers, in one table.
//!
//! Every contender is a program of its own that this one starts, one after the other and round after round, so that the
//! failure of one does not lose the others and a busy minute of the machine does not fall on one alone.

mod contenders;
mod machine;
mod reference;
mod scene;
mod sweep;
mod table;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use peer_common::{Failure, parse_size};
use splat_core::Cloud;

use contenders::{CONTENDERS, Contender, Runner};
use table::{Row, Table};

/// Draws a capture with every contender and compares time, processor time and pictures
#[derive(Parser, Debug)]
struct Options {
    /// Captures of any format; may be named several times [default: a generated cloud of --count Gaussians]
    #[arg(long, value_name = "FILE")]
    scene: Vec<PathBuf>,
    /// Look through camera N of a camera file instead of orbiting: once for each --scene, in their order
    #[arg(long, value_name = "CAMERAS#N")]
    camera: Vec<String>,
    /// Gaussians of the generated cloud
    #[arg(long, default_value_t = 100_000)]
    count: usize,
    /// Pixels across and down
    #[arg(long, value_name = "WxH", value_parser = parse_size, default_value = "1280x720")]
    size: (u32, u32),
    /// Pixels across and down of the pictures that are compared with the reference
    #[arg(long, value_name = "WxH", value_parser = parse_size, default_value = "320x180")]
    still: (u32, u32),
    /// Rounds through all contenders; 0 for pictures alone
    #[arg(long, default_value_t = 3)]
    rounds: usize,
    /// Frames of each round that count
    #[arg(long, default_value_t = 10)]
    frames: usize,
    /// Frames of each round before those
    #[arg(long, default_value_t = 3)]
    warmup: usize,
    /// Only contenders with one of these words in their name, separated by commas
    #[arg(long, value_delimiter = ',')]
    only: Vec<String>,
    /// Leave out the pictures
    #[arg(long)]
    no_pictures: bool,
    /// Sweep a graphics device: generated clouds of --counts Gaussians at 1920x1080, time per stage beside what its
    /// memory allows
    #[arg(long)]
    device: bool,
    /// Gaussians of the clouds of --device
    #[arg(long, value_delimiter = ',', default_value = "250000,500000,1000000,2000000,4000000,6000000,10000000")]
    counts: Vec<usize>,
    /// Longest that a contender may take for one round, in seconds
    #[arg(long, default_value_t = 600)]
    patience: u64,
    /// Folder for generated clouds, pictures and what contenders complain about [default: below the system's temporary folder]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write the table here, too
    #[arg(long, value_name = "FILE")]
    write: Option<PathBuf>,
}

fn main() -> ExitCode {
    match run(&Options::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("error: {failure}");
            ExitCode::FAILURE
        }
    }
}

fn run(options: &Options) -> Result<(), Failure> {
    let out = options.out.clone().unwrap_or_else(|| std::env::temp_dir().join("splat-peers"));
    std::fs::create_dir_all(&out).map_err(|e| Failure::new("the folder cannot be made", e, &out))?;
    let runner = Runner::new(&out, options.patience)?;
    let mut text = String::new();
    // Whoever stops a long comparison keeps what was compared.
    let mut say = |part: String| -> Result<(), Failure> {
        println!("{part}");
        text += &part;
        let path = options.write.as_deref();
        path.map_or(Ok(()), |path| {
            std::fs::write(path, &text).map_err(|e| Failure::new("the table cannot be written", e, path))
        })
    };
    say(machine::describe())?;
    if options.device {
        sweep::run(options, &runner, &mut say)?;
    } else if options.scene.is_empty() {
        let path = out.join(format!("generated-{}.ply", options.count));
        let cloud = scene::generated(options.count)?;
        scene::write(&cloud, &path)?;
        let name = format!("generated cloud, {} Gaussians", cloud.len());
        say(compare(options, &runner, &name, &cloud, &path, None)?)?;
    } else {
        for (k, file) in options.scene.iter().enumerate() {
            let (cloud, path) = scene::read(file, &out)?;
            let name = format!("{}, {} Gaussians", scene::name(file), cloud.len());
            say(compare(options, &runner, &name, &cloud, &path, options.camera.get(k).map(String::as_str))?)?;
        }
    }
    Ok(())
}

/// One scene through all contenders.
fn compare(
    options: &Options,
    runner: &Runner,
    name: &str,
    cloud: &Cloud,
    path: &Path,
    camera: Option<&str>,
) -> Result<String, Failure> {
    let cameras = scene::cameras(cloud, camera, options.size)?;
    let cameras_file = runner.out.join("cameras.json");
    cameras.write(&cameras_file)?;
    let reference = (!options.no_pictures).then(|| reference::draw(cloud, &scene::view(&cameras, options.still)));
    let wanted = |c: &&Contender| options.only.is_empty() || options.only.iter().any(|word| c.name.contains(&**word));
    let mut rows: Vec<Row> = CONTENDERS.iter().filter(wanted).map(Row::new).collect();
    let job = contenders::Job {
        scene: path,
        cameras: &cameras_file,
        size: options.size,
        warmup: options.warmup,
        frames: options.frames,
    };
    for round in 0..options.rounds {
        for row in rows.iter_mut().filter(|row| row.contender.timed) {
            eprintln!("{name}: round {} of {}, {}", round + 1, options.rounds, row.contender.name);
            row.add(runner.measure(row.contender, &job));
        }
    }
    for row in rows.iter_mut().filter(|row| row.contender.timed && options.rounds > 0) {
        eprintln!("{name}: stages, {}", row.contender.name);
        row.staged = runner.stages(row.contender, &job).ok();
    }
    if let Some(reference) = &reference {
        runner.write_reference(reference, options.still)?;
        for row in rows.iter_mut().filter(|row| row.contender.draws) {
            eprintln!("{name}: picture, {}", row.contender.name);
            row.psnr = runner.picture(row.contender, &job, options.still).map(|shot| reference::psnr(reference, &shot));
        }
    }
    let (width, height) = options.size;
    let head = format!(
        "\n## {name}, {width}x{height}\n\n{} rounds of {} frames after {} to warm up; pictures {}x{}\n\n",
        options.rounds, options.frames, options.warmup, options.still.0, options.still.1
    );
    Ok(head + &Table(&rows).to_string())
}
