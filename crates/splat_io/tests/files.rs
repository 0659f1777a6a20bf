//! Files and folders: content before names, whole files or none, nothing outside the folder.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod common;

use std::path::PathBuf;

use common::random_cloud;
use splat_io::{
    FORMATS, Folder, InMemory, ReadError, Siblings, WriteError, WriteOptions, format_named, format_of_name, read, write,
};

/// An empty folder of this test, removed when dropped.
struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("splat_io_{name}_{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).unwrap();
        Self(folder)
    }

    fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(&self.0).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<String> = entries.collect();
        names.sort();
        names
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

#[test]
fn the_content_decides_and_not_the_name() {
    let folder = Scratch::new("content");
    let cloud = random_cloud(1, 40, 1);
    for format in FORMATS.iter().filter(|f| f.writable()) {
        let honest = folder.0.join(format!("a.{}", format.extensions()[0]));
        write(&honest, &cloud, &WriteOptions::default()).unwrap();
        for wrong in ["b.ply", "b.splat", "b.spz", "b.txt", "b"] {
            let wrong = folder.0.join(wrong);
            std::fs::copy(&honest, &wrong).unwrap();
            assert_eq!(read(&wrong).unwrap().1.format, format.name(), "{}", wrong.display());
        }
    }
}

#[test]
fn the_longest_ending_chooses_what_is_written() {
    assert_eq!(format_of_name("a/b.ply").unwrap().name(), "ply");
    assert_eq!(format_of_name("B.COMPRESSED.PLY").unwrap().name(), "compressed-ply");
    assert_eq!(format_of_name("compressed.ply").unwrap().name(), "ply");
    assert!(format_of_name("ply").is_none() && format_of_name("a.txt").is_none());
    assert_eq!(format_named(".Splat").unwrap().name(), "splat");
    for format in FORMATS {
        assert_eq!(format_named(format.name()).unwrap().name(), format.name());
        for extension in format.extensions() {
            assert!(format_of_name(&format!("x.{extension}")).is_some());
        }
    }
}

#[test]
fn a_file_is_written_whole_or_not_at_all() {
    let folder = Scratch::new("whole");
    let cloud = random_cloud(2, 10, 0);
    let path = folder.0.join("a.ply");
    write(&path, &cloud, &WriteOptions::default()).unwrap();
    let before = std::fs::read(&path).unwrap();
    let failed: Result<(), WriteError> = splat_io::write_file(&path, |sink| {
        sink.write_all(b"half of it")?;
        Err(std::io::Error::other("the disk is full").into())
    });
    let text = failed.unwrap_err().to_string();
    assert!(text.contains("the disk is full") && text.ends_with("a.ply"), "{text}");
    assert_eq!(std::fs::read(&path).unwrap(), before);
    assert_eq!(folder.names(), ["a.ply"]);

    let text = write(folder.0.join("a.doc"), &cloud, &WriteOptions::default()).unwrap_err().to_string();
    assert!(text.contains(".ply") && text.ends_with("a.doc"), "{text}");
    let nowhere = write(folder.0.join("no folder/a.ply"), &cloud, &WriteOptions::default());
    assert!(matches!(nowhere, Err(WriteError::Io { .. })));
    assert_eq!(folder.names(), ["a.ply"]);
    // A file that is being read can be replaced.
    let (cloud, _) = read(&path).unwrap();
    write(&path, &cloud, &WriteOptions::default()).unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), before);
}

#[test]
fn missing_empty_and_foreign_files_are_one_sentence_each() {
    let folder = Scratch::new("foreign");
    assert!(matches!(read(folder.0.join("none.ply")), Err(ReadError::Io { .. })));
    let text = read(&folder.0).unwrap_err().to_string();
    assert!(text.contains("meta.json"), "{text}");
    let empty = folder.0.join("empty.ply");
    std::fs::write(&empty, b"").unwrap();
    let text = read(&empty).unwrap_err().to_string();
    assert!(text.contains("empty)") && text.ends_with("empty.ply"), "{text}");
    let foreign = folder.0.join("notes.splat");
    std::fs::write(&foreign, b"these are notes, not splats, and their length is no multiple").unwrap();
    let text = read(&foreign).unwrap_err().to_string();
    assert!(text.contains("these are notes") && text.contains("ply"), "{text}");
    // What a browser or git leaves in place of a download.
    std::fs::write(&foreign, b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 9\n").unwrap();
    assert!(read(&foreign).unwrap_err().to_string().contains("git lfs pull"));
    std::fs::write(&foreign, b"\n<!doctype html><title>Not found</title>").unwrap();
    assert!(read(&foreign).unwrap_err().to_string().contains("a web page"));
}

#[test]
fn names_that_leave_the_folder_are_refused() {
    let folder = Scratch::new("inside");
    std::fs::write(folder.0.join("in.bin"), b"in").unwrap();
    let inner = folder.0.join("inner");
    std::fs::create_dir_all(&inner).unwrap();
    assert_eq!(Folder(&folder.0).get("in.bin").unwrap(), b"in");
    assert!(matches!(Folder(&folder.0).get("absent.bin"), Err(ReadError::Io { .. })));
    let absolute = folder.0.join("in.bin").display().to_string();
    for name in ["../in.bin", "x/../../in.bin", "", "C:in.bin", "..\\in.bin", "a\0b", absolute.as_str()] {
        assert!(matches!(Folder(&inner).get(name), Err(ReadError::Outside { .. })), "{name:?}");
        assert!(matches!(InMemory::default().get(name), Err(ReadError::Outside { .. })), "{name:?}");
    }
}
