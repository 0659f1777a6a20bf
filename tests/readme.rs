//! The README says what the program says.

use std::process::Command;

#[test]
fn the_table_of_formats_is_the_one_the_program_prints() {
    let out = Command::new(env!("CARGO_BIN_EXE_splat")).args(["list", "--markdown"]).output().unwrap();
    let printed = String::from_utf8(out.stdout).unwrap();
    let formats = printed.split("\n\n").next().unwrap().trim();
    assert!(formats.lines().count() > 5, "{printed}");
    let readme = include_str!("../README.md");
    let kept = readme.split("<!-- formats -->").nth(1).unwrap().split("<!-- /formats -->").next().unwrap();
    assert_eq!(kept.trim(), formats, "copy the first table of `splat list --markdown` into README.md");
}

#[test]
fn the_first_scene_is_the_one_that_the_crate_compiles_and_takes_at_most_fifteen_lines() {
    let readme = include_str!("../README.md");
    let scene = readme.split("```rust\n").nth(1).unwrap().split("```").next().unwrap();
    assert!(scene.lines().count() <= 15, "{scene}");
    let docs = include_str!("../crates/bevy_splat/src/lib.rs");
    let kept = docs.split("//! ```no_run\n").nth(1).unwrap().split("//! ```").next().unwrap();
    let kept: String =
        kept.lines().map(|line| format!("{}\n", line.trim_start_matches("//!").trim_start_matches(' '))).collect();
    let plain = |text: &str| text.lines().map(str::trim).collect::<Vec<_>>().join("\n");
    assert_eq!(plain(scene), plain(&kept));
}
