use std::path::Path;

use bevy::asset::io::memory::Dir;
use bevy::asset::saver::{SavedAsset, save_using_saver};
use bevy::prelude::*;
use bevy::tasks::block_on;
use splat_core::{Cloud, Pose, View};
use splat_io::cameras::{CAMERA_FORMATS, NamedView};
use splat_io::{FORMATS, WriteOptions, format_named, read_bytes, write_as};

use crate::asset::{SplatCameras, SplatCloud, SplatCloudSaver, SplatCloudSettings, SplatSaveSettings};
use crate::testing::{app_with_files, cloud, finished};

fn bytes(cloud: &Cloud, format: &str) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_as(format_named(format).unwrap(), cloud, &WriteOptions::default(), &mut bytes).unwrap();
    bytes
}

fn load(app: &mut App, path: &'static str) -> Result<SplatCloud, String> {
    let handle = app.world().resource::<AssetServer>().load::<SplatCloud>(path);
    finished(app, &handle)
}

fn load_with(app: &mut App, path: &'static str, set: fn(&mut SplatCloudSettings)) -> Result<SplatCloud, String> {
    let server = app.world().resource::<AssetServer>().clone();
    let handle = server.load_builder().with_settings(set).load::<SplatCloud>(path);
    finished(app, &handle)
}

fn put(files: &Dir, path: &str, bytes: Vec<u8>) {
    files.insert_asset(Path::new(path), bytes);
}

#[test]
fn every_format_that_can_be_written_is_saved_and_loaded_again() {
    let (mut app, files) = app_with_files();
    let mut count = 0;
    for format in FORMATS.iter().filter(|f| f.writable()) {
        for extension in format.extensions() {
            let path: &'static str = Box::leak(format!("rooms/room.{extension}").into_boxed_str());
            let capture = cloud(40);
            let server = app.world().resource::<AssetServer>().clone();
            let (asset, settings) = (SavedAsset::from_asset(&capture), SplatSaveSettings::default());
            block_on(save_using_saver(server, &SplatCloudSaver, &path.into(), asset, &settings)).unwrap();
            let loaded = load(&mut app, path).unwrap_or_else(|error| panic!("{path}: {error}"));
            let stored = files.get_asset(Path::new(path)).unwrap();
            let (read, report) = read_bytes(stored.value(), path).unwrap();
            assert_eq!((&*loaded.cloud, &*loaded.report), (&read, &report), "{path}");
            assert_eq!((loaded.cloud.len(), loaded.report.format), (40, format.name()));
            count += 1;
        }
    }
    assert!(count >= 5);
}

#[test]
fn the_content_decides_and_not_the_ending() {
    let (mut app, files) = app_with_files();
    put(&files, "a.ply", bytes(&cloud(3).cloud, "spz"));
    put(&files, "b.png", bytes(&cloud(4).cloud, "ply"));
    put(&files, "c", bytes(&cloud(5).cloud, "sog"));
    put(&files, "d.compressed.ply", bytes(&cloud(6).cloud, "ply"));
    for (path, len, format) in
        [("a.ply", 3, "spz"), ("b.png", 4, "ply"), ("c", 5, "sog"), ("d.compressed.ply", 6, "ply")]
    {
        let loaded = load(&mut app, path).unwrap();
        assert_eq!((loaded.cloud.len(), loaded.report.format), (len, format), "{path}");
    }
}

#[test]
fn what_cannot_be_loaded_is_told_in_one_sentence_with_the_path() {
    let (mut app, files) = app_with_files();
    let whole = bytes(&cloud(100).cloud, "ply");
    put(&files, "rooms/cut.ply", whole[..whole.len() - 1000].to_vec());
    put(&files, "rooms/text.ply", b"dear diary".to_vec());
    put(&files, "rooms/empty.spz", Vec::new());
    put(&files, "rooms/lfs.ply", b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n".to_vec());
    for (path, words) in [
        ("rooms/cut.ply", "it was cut off, copy it again"),
        ("rooms/text.ply", "none of the known formats"),
        ("rooms/empty.spz", "it is empty"),
        ("rooms/lfs.ply", "git lfs pull"),
        ("rooms/missing.ply", "missing"),
    ] {
        let error = load(&mut app, path).unwrap_err();
        assert!(error.contains(words) && error.contains(path) && !error.contains('\n'), "{path}: {error}");
        app.update();
    }
    // Bytes that were changed anywhere are refused or read, and never end the app.
    for k in 0..60 {
        let mut broken = whole.clone();
        let at = k * broken.len() / 60;
        broken[at] ^= 0x5a;
        let path: &'static str = Box::leak(format!("rooms/broken{k}.ply").into_boxed_str());
        put(&files, path, broken);
        if let Err(error) = load(&mut app, path) {
            assert!(error.contains(path), "{error}");
        }
    }
}

#[test]
fn settings_choose_what_is_kept() {
    let (mut app, files) = app_with_files();
    let mut arrays = Cloud::clone(&cloud(10).cloud).into_arrays();
    arrays.opacity_logits = (0..10).map(|i| if i == 3 { f32::NAN } else { i as f32 - 5.0 }).collect();
    let faint = Cloud::new(arrays).unwrap();
    put(&files, "room.ply", bytes(&faint.with_sh_degree(3).unwrap(), "ply"));

    let plain = load(&mut app, "room.ply").unwrap();
    assert_eq!((plain.cloud.len(), plain.cloud.sh_degree(), plain.report.not_finite), (10, 3, 1));
    // The handle is gone, so that the file is loaded anew with other settings.
    app.update();
    let visible = load_with(&mut app, "room.ply", |s| s.min_opacity = 0.5).unwrap();
    assert_eq!(visible.cloud.opacity_logits(), [0.0, 1.0, 2.0, 3.0, 4.0]);
    app.update();
    let flat = load_with(&mut app, "room.ply", |s| s.max_sh_degree = 1).unwrap();
    assert_eq!((flat.cloud.len(), flat.cloud.sh_degree()), (10, 1));
    assert!(!flat.cloud.source().antialiased);
    app.update();
    let antialiased = load_with(&mut app, "room.ply", |s| s.antialiased = Some(true)).unwrap();
    assert!(antialiased.cloud.source().antialiased);
    assert_eq!(antialiased.cloud.means(), plain.cloud.means());
    app.update();
    assert!(load_with(&mut app, "room.ply", |s| s.format = Some("spz".to_owned())).is_err());
    for (set, words) in [
        (
            (|s| s.format = Some("jpeg".to_owned())) as fn(&mut SplatCloudSettings),
            "`jpeg` in the settings is no format",
        ),
        (|s| s.max_sh_degree = 9, "`max_sh_degree` in the settings is 9"),
        (|s| s.min_opacity = f32::NAN, "`min_opacity` in the settings is NaN"),
    ] {
        app.update();
        let error = load_with(&mut app, "room.ply", set).unwrap_err();
        assert!(error.contains(words) && error.contains("room.ply"), "{error}");
    }
}

#[test]
fn a_capture_that_cannot_be_saved_is_told_in_one_sentence() {
    let (app, _) = app_with_files();
    let capture = cloud(4);
    let save = |path: &'static str, format: Option<&str>| {
        let server = app.world().resource::<AssetServer>().clone();
        let settings = SplatSaveSettings { format: format.map(str::to_owned), version: None };
        let asset = SavedAsset::from_asset(&capture);
        block_on(save_using_saver(server, &SplatCloudSaver, &path.into(), asset, &settings)).map_err(|e| e.to_string())
    };
    let error = save("room.docx", None).unwrap_err();
    assert!(error.contains("room.docx") && error.contains("spz"), "{error}");
    let error = save("room.ksplat", None).unwrap_err();
    assert!(error.contains("can be read but not written") && error.contains("room.ksplat"), "{error}");
    assert_eq!(save("room.docx", Some("ply")), Ok(()));
}

#[test]
fn a_format_of_several_files_finds_those_beside_it() {
    let (mut app, files) = app_with_files();
    // A glb is a header, a JSON text and its buffer; as two files the buffer has a name.
    let glb = bytes(&cloud(20).cloud, "glb");
    let word = |at: usize| u32::from_le_bytes(glb[at..at + 4].try_into().unwrap()) as usize;
    let text = std::str::from_utf8(&glb[20..20 + word(12)]).unwrap();
    let buffer = glb[20 + word(12) + 8..].to_vec();
    let named = text.replacen("\"buffers\":[{", "\"buffers\":[{\"uri\":\"my%20buffer.bin\",", 1);
    assert_ne!(named, text);
    put(&files, "rooms/room.gltf", named.into_bytes());
    assert!(load(&mut app, "rooms/room.gltf").unwrap_err().contains("my buffer.bin"));
    put(&files, "rooms/my buffer.bin", buffer);
    app.update();
    let loaded = load(&mut app, "rooms/room.gltf").unwrap();
    assert_eq!(loaded.cloud.means(), cloud(20).cloud.means());
}

#[test]
fn cameras_of_every_format_load_with_the_files_beside_them() {
    let (mut app, files) = app_with_files();
    let pose = Pose::look_at(Vec3::new(1.0, -2.0, -5.0), Vec3::ZERO, Vec3::NEG_Y);
    let view = View::perspective(pose, 0.9, 64, 48);
    let named = NamedView { id: 1, name: "first.png".to_owned(), view };
    for format in CAMERA_FORMATS {
        let written = format.write(std::slice::from_ref(&named)).unwrap();
        let path = format!("{}/{}", format.name(), written[0].name);
        for file in written {
            put(&files, &format!("{}/{}", format.name(), file.name), file.bytes);
        }
        let handle = app.world().resource::<AssetServer>().load::<SplatCameras>(path.clone());
        let cameras = finished(&mut app, &handle).unwrap_or_else(|error| panic!("{path}: {error}"));
        assert_eq!((cameras.views.len(), cameras.views[0].view.width), (1, 64), "{path}");
    }
    put(&files, "none/images.txt", b"1 1 0 0 0 0 0 0 1 a.png\n\n".to_vec());
    let handle = app.world().resource::<AssetServer>().load::<SplatCameras>("none/images.txt");
    assert!(finished(&mut app, &handle).unwrap_err().contains("cameras.txt"));
}
