//! The contenders, and how one is run.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use peer_common::{Failure, Report};

/// A program that draws.
#[derive(Debug)]
pub(crate) struct Contender {
    /// As in the table.
    pub(crate) name: &'static str,
    program: &'static str,
    arguments: &'static [&'static str],
    /// Whether its time is of interest.
    pub(crate) timed: bool,
    /// Whether its picture is encoded once more than it should be.
    encoded_twice: bool,
    /// Whether there is a picture to compare.
    pub(crate) draws: bool,
    /// Whether it belongs to the sweep of a graphics device.
    pub(crate) sweeps: bool,
}

const OURS: Contender = Contender {
    name: "",
    program: "peer_ours",
    arguments: &[],
    timed: true,
    encoded_twice: false,
    draws: true,
    sweeps: false,
};
const GAUSSIAN_SPLATTING: Contender = Contender { program: "peer_bevy_gaussian_splatting", ..OURS };
const VIEWER: Contender = Contender { program: "peer_wgpu_3dgs_viewer", ..OURS };

/// All of them, in the order of the table.
pub(crate) const CONTENDERS: &[Contender] = &[
    Contender { name: BASE, arguments: &["plugin", "--backend", "auto"], ..OURS },
    Contender { name: "bevy_splat, GPU back end", arguments: &["plugin", "--backend", "gpu"], sweeps: true, ..OURS },
    Contender { name: ALONE, arguments: &["rasterizer", "--backend", "cpu"], ..OURS },
    Contender { name: "splat_raster alone, GPU", arguments: &["rasterizer", "--backend", "gpu"], sweeps: true, ..OURS },
    Contender { name: "bevy_gaussian_splatting", arguments: &["--sort", "radix"], sweeps: true, ..GAUSSIAN_SPLATTING },
    Contender {
        name: "bevy_gaussian_splatting, sorted on the CPU",
        arguments: &["--sort", "rayon"],
        ..GAUSSIAN_SPLATTING
    },
    Contender {
        name: "bevy_gaussian_splatting, blended as trained",
        arguments: &["--sort", "radix", "--blend-encoded"],
        timed: false,
        encoded_twice: true,
        ..GAUSSIAN_SPLATTING
    },
    Contender { name: "wgpu-3dgs-viewer", arguments: &["--reach", "3"], sweeps: true, ..VIEWER },
    Contender {
        name: "wgpu-3dgs-viewer, as wide as trained",
        arguments: &["--reach", "2.8284"],
        timed: false,
        ..VIEWER
    },
    Contender { name: "an empty Bevy frame", arguments: &["empty"], draws: false, ..OURS },
];

/// The contender that others are compared with.
pub(crate) const BASE: &str = "bevy_splat";
/// The same without an engine.
pub(crate) const ALONE: &str = "splat_raster alone, CPU";

/// What a contender is to draw.
pub(crate) struct Job<'a> {
    pub(crate) scene: &'a Path,
    pub(crate) cameras: &'a Path,
    pub(crate) size: (u32, u32),
    pub(crate) warmup: usize,
    pub(crate) frames: usize,
}

/// Frames at one standpoint before the picture is taken: sorting may lag, buffers may grow.
const SETTLE: usize = 8;

/// Starts contenders.
pub(crate) struct Runner {
    /// Where pictures and complaints go.
    pub(crate) out: PathBuf,
    programs: PathBuf,
    patience: Duration,
}

impl Runner {
    /// Contenders lie beside this program.
    pub(crate) fn new(out: &Path, patience: u64) -> Result<Self, Failure> {
        let here = std::env::current_exe().map_err(|e| Failure(format!("this program does not find itself: {e}")))?;
        let programs = here.parent().unwrap_or(Path::new(".")).to_path_buf();
        Ok(Self { out: out.to_path_buf(), programs, patience: Duration::from_secs(patience) })
    }

    /// One round of one contender.
    pub(crate) fn measure(&self, contender: &Contender, job: &Job<'_>) -> Result<Report, Failure> {
        self.round(contender, job, &[])
    }

    /// One round that is not for the clock: what the parts of its frames cost.
    pub(crate) fn stages(&self, contender: &Contender, job: &Job<'_>) -> Result<Report, Failure> {
        self.round(contender, job, &["--stages"])
    }

    fn round(&self, contender: &Contender, job: &Job<'_>, more: &[&str]) -> Result<Report, Failure> {
        let mut command = self.command(contender, job, job.size);
        command.args(["--warmup", &job.warmup.to_string(), "--frames", &job.frames.to_string()]).args(more);
        self.run(contender, command)
    }

    /// The still view of one contender: 8-bit red, green, blue of every pixel.
    pub(crate) fn picture(
        &self,
        contender: &Contender,
        job: &Job<'_>,
        size: (u32, u32),
    ) -> Result<Vec<[f64; 3]>, Failure> {
        let mut command = self.command(contender, job, size);
        let path = self.out.join(format!("{}.png", self.file_name(contender)));
        // A picture of an earlier run must not stand for one that was not drawn.
        let _ = std::fs::remove_file(&path);
        command.args(["--warmup", &SETTLE.to_string(), "--frames", "1", "--shot"]).arg(&path);
        self.run(contender, command)?;
        let picture = splat_io::picture::read_png(&path).map_err(|e| Failure(e.to_string()))?;
        let mut colors = crate::reference::colors(&picture);
        if contender.encoded_twice {
            colors.iter_mut().flatten().for_each(|v| *v = crate::reference::decoded(*v));
        }
        Ok(colors)
    }

    /// The picture that others are compared with, beside theirs.
    pub(crate) fn write_reference(&self, colors: &[[f64; 3]], size: (u32, u32)) -> Result<(), Failure> {
        let byte = |v: f64| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
        let rgba: Vec<u8> = colors.iter().flat_map(|c| [byte(c[0]), byte(c[1]), byte(c[2]), 255]).collect();
        peer_common::write_shot(&self.out.join("reference.png"), size, &rgba)
    }

    /// Runs another program of ours that reports, such as the one that measures memory bandwidth.
    pub(crate) fn ask(&self, arguments: &[&str]) -> Result<Report, Failure> {
        let mut command = Command::new(self.programs.join(OURS.program));
        command.args(arguments);
        self.run(&Contender { name: "measuring", ..OURS }, command)
    }

    fn command(&self, contender: &Contender, job: &Job<'_>, size: (u32, u32)) -> Command {
        let mut command = Command::new(self.programs.join(contender.program));
        command.args(contender.arguments).arg("--scene").arg(job.scene).arg("--cameras").arg(job.cameras);
        command.args(["--size", &format!("{}x{}", size.0, size.1)]);
        command
    }

    fn file_name(&self, contender: &Contender) -> String {
        contender.name.chars().map(|c| if c.is_ascii_alphanumeric() || "_-".contains(c) { c } else { '-' }).collect()
    }

    fn run(&self, contender: &Contender, mut command: Command) -> Result<Report, Failure> {
        let complaints = self.out.join(format!("{}.log", self.file_name(contender)));
        let log = File::create(&complaints).map_err(|e| Failure::new("the log cannot be written", e, &complaints))?;
        for (name, value) in [("WGPU_BACKEND", "vulkan"), ("RUST_LOG", "warn")] {
            if std::env::var_os(name).is_none() {
                command.env(name, value);
            }
        }
        let started = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(log).spawn();
        let mut child = started.map_err(|e| Failure(format!("{} cannot be started: {e}", contender.name)))?;
        let Some(mut stdout) = child.stdout.take() else { return Err(Failure("a program without output".to_owned())) };
        let reader = std::thread::spawn(move || {
            let mut text = String::new();
            stdout.read_to_string(&mut text).map(|_| text)
        });
        let begun = Instant::now();
        let status = loop {
            match child.try_wait() {
                Ok(Some(status)) => break status.to_string(),
                Ok(None) if begun.elapsed() > self.patience => {
                    let _ = child.kill();
                    let _ = child.wait();
                    break format!("took longer than {} s", self.patience.as_secs());
                }
                Ok(None) => std::thread::sleep(Duration::from_millis(20)),
                Err(e) => break e.to_string(),
            }
        };
        let text = reader.join().ok().and_then(Result::ok).unwrap_or_default();
        let report = text.lines().rev().find_map(|line| serde_json::from_str(line).ok());
        report.ok_or_else(|| {
            let said = std::fs::read_to_string(&complaints).unwrap_or_default();
            let last = said.lines().rev().find(|line| line.contains("error") || line.contains("panicked"));
            let last = last.or(said.lines().last()).unwrap_or("it said nothing");
            Failure(format!("{} gave no report ({status}): {last}", contender.name))
        })
    }
}
