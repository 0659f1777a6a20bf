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
