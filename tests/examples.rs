//! Every example draws its story without a window: `--shot` gives a picture that is not blank, and wgpu has nothing to say.

#![expect(clippy::unwrap_used, reason = "a test ends where something is missing")]

use std::path::{Path, PathBuf};
use std::process::Command;

/// The examples that draw: all files of `examples/` that take `common`.
fn examples() -> Vec<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples");
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .unwrap()
        .filter_map(|entry| {
            let path = entry.unwrap().path();
            let text = std::fs::read_to_string(&path).ok()?;
            text.contains("\nmod common;").then(|| path.file_stem().unwrap().to_string_lossy().into_owned())
        })
        .collect();
    names.sort();
    names
}

/// Where cargo puts examples beside the program.
fn binary(name: &str) -> PathBuf {
    Path::new(env!("CARGO_BIN_EXE_splat")).with_file_name("examples").join(name)
}

#[test]
fn every_example_draws_its_picture_without_a_window() {
    let names = examples();
    assert!(names.len() >= 9, "{names:?}");
    let folder = tempdir();
    for name in names {
        let shot = folder.join(format!("{name}.png"));
        let out = Command::new(binary(&name))
            .args(["--shot".as_ref(), shot.as_os_str(), "--size".as_ref(), "320x180".as_ref()])
            .env("RUST_BACKTRACE", "1")
            .output()
            .unwrap_or_else(|e| panic!("{name} does not start, build it with `cargo build --examples`: {e}"));
        let said = format!("{}{}", String::from_utf8_lossy(&out.stdout), String::from_utf8_lossy(&out.stderr));
        if said.contains("Unable to find a GPU") {
            println!("skipped: no Vulkan device");
            return;
        }
        assert!(out.status.success(), "{name}: {}\n{said}", out.status);
        for word in ["wgpu error", "Validation", "VUID", "panicked", " ERROR "] {
            assert!(!said.contains(word), "{name} says {word}:\n{said}");
        }
        let colors = distinct_colors(&shot);
        assert!(colors > 500, "{name} draws {colors} colours only");
    }
    std::fs::remove_dir_all(folder).unwrap();
}

fn distinct_colors(file: &Path) -> usize {
    let decoder = png::Decoder::new(std::io::BufReader::new(std::fs::File::open(file).unwrap()));
    let mut reader = decoder.read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    let colors: std::collections::HashSet<&[u8]> =
        pixels[..info.buffer_size()].chunks(info.color_type.samples()).collect();
    colors.len()
}

fn tempdir() -> PathBuf {
    let folder = std::env::temp_dir().join(format!("splat-examples-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    folder
}
