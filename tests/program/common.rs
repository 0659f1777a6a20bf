//! Running the program, and small captures to run it on.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use serde_json::Value;
use splat_core::glam::{Quat, Vec3};
use splat_core::{Cloud, CloudArrays, sh};
use splat_io::WriteOptions;

/// A folder of its own for each test, empty.
pub(crate) fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("program-{name}"));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// What the program said.
#[derive(Debug)]
pub(crate) struct Said {
    pub(crate) code: i32,
    pub(crate) out: String,
    pub(crate) err: String,
}

/// Runs the program in a folder; arguments between blanks, double quotes keep together.
pub(crate) fn splat(folder: &Path, line: &str) -> Said {
    let words = line.split('"').enumerate().flat_map(|(k, part)| {
        if k % 2 == 1 { vec![part.to_owned()] } else { part.split_whitespace().map(str::to_owned).collect() }
    });
    let Output { status, stdout, stderr } = Command::new(env!("CARGO_BIN_EXE_splat"))
        .args(words)
        .current_dir(folder)
        // No terminal of whoever runs the tests decides the width of help texts.
        .env_remove("COLUMNS")
        .stdin(Stdio::null())
        .output()
        .unwrap();
    Said {
        code: status.code().unwrap(),
        out: String::from_utf8(stdout).unwrap(),
        err: String::from_utf8(stderr).unwrap(),
    }
}

/// Runs the program, which must succeed.
pub(crate) fn done(folder: &Path, line: &str) -> Said {
    let said = splat(folder, line);
    assert_eq!(said.code, 0, "{line}: {said:?}");
    said
}

/// Runs the program with `--json`, which must succeed and print JSON and nothing else.
pub(crate) fn json(folder: &Path, line: &str) -> Value {
    let said = done(folder, &format!("{line} --json"));
    serde_json::from_str(&said.out).unwrap_or_else(|e| panic!("{line}: {e}: {}", said.out))
}

/// One Gaussian of a small capture.
#[derive(Clone, Copy)]
pub(crate) struct Dab {
    pub(crate) mean: Vec3,
    pub(crate) sigma: Vec3,
    pub(crate) rotation: Quat,
    pub(crate) opacity: f32,
    pub(crate) color: Vec3,
}

impl Dab {
    pub(crate) fn ball(mean: Vec3, sigma: f32, color: Vec3) -> Self {
        Self { mean, sigma: Vec3::splat(sigma), rotation: Quat::IDENTITY, opacity: 0.95, color }
    }
}

/// A capture of these Gaussians; with a degree above 0 their colours change with the direction.
pub(crate) fn cloud(dabs: &[Dab], sh_degree: u8) -> Cloud {
    let stride = 3 * sh::coefficient_count(sh_degree);
    let mut values = Vec::with_capacity(dabs.len() * stride);
    for (i, dab) in dabs.iter().enumerate() {
        values.extend(((dab.color - 0.5) / sh::C0).to_array());
        // A wave through the coefficients: every band and channel counts.
        values.extend((3..stride).map(|k| 0.2 * ((k * 7 + i) as f32).sin()));
    }
    Cloud::new(CloudArrays {
        means: dabs.iter().map(|d| d.mean).collect(),
        log_scales: dabs.iter().map(|d| d.sigma.map(f32::ln)).collect(),
        rotations: dabs.iter().map(|d| d.rotation).collect(),
        opacity_logits: dabs.iter().map(|d| (d.opacity / (1.0 - d.opacity)).ln()).collect(),
        sh_degree,
        sh: values,
        ..CloudArrays::default()
    })
    .unwrap()
}

/// A red, a green and a blue heap in a row along x (-2, 0, 2), 60 Gaussians each, z from -0.3 to 0.3.
pub(crate) fn three_heaps(sh_degree: u8) -> Cloud {
    let mut dabs = Vec::new();
    for (k, color) in [Vec3::X, Vec3::Y, Vec3::Z].into_iter().enumerate() {
        for i in 0..60 {
            let at = |step: f32| ((i as f32 * step).fract() - 0.5) * 0.6;
            let mean = Vec3::new(2.0 * k as f32 - 2.0 + at(0.618_034), at(0.414_214), at(0.732_051));
            let rotation = Quat::from_euler(splat_core::glam::EulerRot::XYZ, i as f32, 0.3 * i as f32, 1.0);
            dabs.push(Dab { sigma: Vec3::new(0.12, 0.08, 0.05), rotation, ..Dab::ball(mean, 0.1, color * 0.8 + 0.1) });
        }
    }
    cloud(&dabs, sh_degree)
}

/// Writes a capture into a folder.
pub(crate) fn write(folder: &Path, name: &str, cloud: &Cloud) {
    splat_io::write(folder.join(name), cloud, &WriteOptions::default()).unwrap();
}

/// A PNG as width, height and red, green, blue per pixel.
pub(crate) fn picture(path: &Path) -> (u32, u32, Vec<[u8; 3]>) {
    let picture = splat_io::picture::read_png(path).unwrap();
    let pixel = |p: &[u8]| if p.len() < 3 { [p[0]; 3] } else { [p[0], p[1], p[2]] };
    (picture.width, picture.height, picture.values.chunks_exact(picture.channels).map(pixel).collect())
}
