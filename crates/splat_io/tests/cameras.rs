//! Camera files of every format: round trips, files made by hand, damaged ones.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod common;

use common::{Random, capture};
use splat_core::glam::{Mat3, Quat, Vec3};
use splat_core::{DEFAULT_NEAR, Intrinsics, Pose, Projection, View};
use splat_io::cameras::{self, CAMERA_FORMATS, NamedView, read_with};
use splat_io::{InMemory, ReadError, SourceName};

fn random_views(count: u32, seed: u64) -> Vec<NamedView> {
    let mut r = Random(seed);
    let mut view = |i: u32| {
        let q = Quat::from_xyzw(r.between(-1.0, 1.0), r.between(-1.0, 1.0), r.between(-1.0, 1.0), 1.1).normalize();
        let (width, height) = (640 + i % 3 * 10, 480);
        NamedView {
            id: 3 * i + 1,
            name: format!("images/view {i:02}.png"),
            view: View {
                width,
                height,
                intrinsics: Intrinsics { fx: 500.1, fy: 499.7, cx: 0.5 * width as f32, cy: 236.3 },
                projection: Projection::Perspective,
                pose: Pose {
                    world_from_view: Mat3::from_quat(q),
                    position: Vec3::new(r.between(-9.0, 9.0), r.between(-2.0, 2.0), r.between(-9.0, 9.0)),
                },
                near: DEFAULT_NEAR,
            },
        }
    };
    (0..count).map(&mut view).collect()
}

fn assert_close(a: &View, b: &View) {
    assert_eq!((a.width, a.height, a.intrinsics), (b.width, b.height, b.intrinsics));
    assert!(a.pose.position.abs_diff_eq(b.pose.position, 5e-6), "{} {}", a.pose.position, b.pose.position);
    assert!(a.pose.world_from_view.abs_diff_eq(b.pose.world_from_view, 1e-6));
}

#[test]
fn every_format_gives_back_the_views_it_was_given() {
    let views = random_views(7, 1);
    for format in CAMERA_FORMATS {
        for count in [0, 1, 7] {
            let given = &views[..count];
            let files = format.write(given).unwrap();
            let memory = InMemory { files: files.iter().map(|f| (f.name.to_owned(), f.bytes.clone())).collect() };
            for file in &files {
                let read = read_with(&file.bytes, &SourceName::from(file.name), &memory).unwrap();
                assert_eq!(read.format, format.name());
                assert_eq!((read.views.len(), read.notes.len()), (count, 0));
                for (a, b) in read.views.iter().zip(given) {
                    assert_eq!(a.name, b.name);
                    assert!(a.id == b.id || format.name() == "nerfstudio");
                    assert_close(&a.view, &b.view);
                }
            }
        }
    }
}

#[test]
fn folders_and_names_choose_the_format() {
    let folder = std::env::temp_dir().join(format!("splat_io_cameras_{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let views = random_views(3, 2);
    for (name, format) in [
        ("transforms.json", "nerfstudio"),
        ("cameras.json", "inria"),
        ("model/images.txt", "colmap-text"),
        ("other/images.bin", "colmap"),
        ("scan/sparse/0", "colmap"),
    ] {
        std::fs::create_dir_all(folder.join(name).parent().unwrap()).unwrap();
        cameras::write(folder.join(name), &views).unwrap();
        assert_eq!(cameras::read(folder.join(name)).unwrap().format, format);
    }
    assert_eq!(cameras::read(folder.join("model")).unwrap().format, "colmap-text");
    assert_eq!(cameras::read(folder.join("scan")).unwrap().views.len(), 3);
    assert_eq!(cameras::read(&folder).unwrap().format, "inria");
    let empty = folder.join("empty");
    std::fs::create_dir_all(&empty).unwrap();
    assert!(cameras::read(&empty).unwrap_err().to_string().contains("transforms.json"));
    let mut flat = views;
    flat[1].view.projection = Projection::Orthographic;
    assert!(cameras::write(folder.join("cameras.json"), &flat).unwrap_err().to_string().contains("orthographic"));
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn cameras_of_the_captures_are_read_and_written_back() {
    let Some(path) = capture("plaza/cameras.json") else { return };
    let read = cameras::read(path).unwrap();
    assert_eq!((read.format, read.views.len()), ("inria", 36));
    let first = &read.views[0];
    assert_eq!((first.name.as_str(), first.view.width, first.view.height), ("view_00", 800, 600));
    // Columns of the file's rows: right, down, forward.
    assert_eq!(first.view.forward(), Vec3::new(-0.969_043_55, 0.236_676_44, -0.070_276_98));
    assert_eq!(first.view.intrinsics.cx, 400.0);
    let again = CAMERA_FORMATS[0].write(&read.views).unwrap();
    let again = read_with(&again[0].bytes, &SourceName::from("cameras.json"), &InMemory::default()).unwrap();
    assert_eq!(again.views, read.views);
}

#[test]
fn a_colmap_text_model_made_by_hand_is_understood() {
    let cameras = "# Camera list\n1 SIMPLE_RADIAL 640 480 500 320 240 0.1\n7 PINHOLE 100 50 60 61 50.5 25\n";
    // Looking along +x: the world's x is the camera's z. The second image has no features, the last no line for them.
    let images = "# Image list\n3 0.5 -0.5 0.5 -0.5 1 2 3 7 b c.png\n1.0 2.0 -1\n\
                  4 1 0 0 0 0 0 5 1 a.png\n\n9 2 0 0 0 0 0 0 7 z.png";
    let memory = InMemory { files: [("cameras.txt".to_owned(), cameras.as_bytes().to_vec())].into() };
    let read = read_with(images.as_bytes(), &SourceName::from("x/images.txt"), &memory).unwrap();
    let names: Vec<_> = read.views.iter().map(|v| (v.id, v.name.as_str())).collect();
    assert_eq!(names, [(3, "b c.png"), (4, "a.png"), (9, "z.png")]);
    assert!(read.notes[0].contains("distortion of 1 images"), "{:?}", read.notes);
    let a = &read.views[1].view;
    assert_eq!(a.pose.position, Vec3::new(0.0, 0.0, -5.0));
    assert_eq!((a.intrinsics.fx, a.intrinsics.fy, a.intrinsics.cx, a.intrinsics.cy), (500.0, 500.0, 320.0, 240.0));
    let b = &read.views[0].view;
    // Camera coordinates of a world point are R x + t.
    let r = Mat3::from_quat(Quat::from_xyzw(-0.5, 0.5, -0.5, 0.5));
    let point = Vec3::new(0.3, -0.2, 0.9);
    assert!(b.to_view(point).abs_diff_eq(r * point + Vec3::new(1.0, 2.0, 3.0), 1e-5));

    let missing = read_with(images.as_bytes(), &SourceName::from("images.txt"), &InMemory::default()).unwrap_err();
    assert!(missing.to_string().ends_with("cameras.txt"), "{missing}");
    let bad = images.replace(" 7 b c.png", " 8 b c.png");
    let text = read_with(bad.as_bytes(), &SourceName::from("images.txt"), &memory).unwrap_err().to_string();
    assert!(text.contains("image 3") && text.ends_with("images.txt"), "{text}");
    let bad = images.replace("0.5 -0.5", "0.5 nonsense");
    let text = read_with(bad.as_bytes(), &SourceName::from("images.txt"), &memory).unwrap_err().to_string();
    assert!(text.contains("line 2") && text.contains("`nonsense`"), "{text}");
}

#[test]
fn a_transforms_file_made_by_hand_is_understood() {
    // The camera stands at (1, 2, 3) with OpenGL's axes equal to the world's: it looks along -z, up is +y.
    let text = r#"{"camera_angle_x": 1.5707963267948966, "k1": 0.1, "applied_transform": [], "frames": [
        {"file_path": "./train/r_0", "transform_matrix": [[1,0,0,1],[0,1,0,2],[0,0,1,3],[0,0,0,1]]},
        {"file_path": "b", "w": 100.0, "h": 40.0, "fl_x": 70, "fl_y": 71, "cx": 51, "cy": 19, "k1": 0,
         "transform_matrix": [[2,0,0,0],[0,2,0,0],[0,0,2,0]]}]}"#;
    let mut picture = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR".to_vec();
    picture.extend([0, 0, 2, 0, 0, 0, 1, 0]);
    let memory = InMemory { files: [("train/r_0.png".to_owned(), picture)].into() };
    let read = read_with(text.as_bytes(), &SourceName::from("transforms.json"), &memory).unwrap();
    let a = &read.views[0].view;
    assert_eq!((a.width, a.height, a.intrinsics.fx.round(), a.intrinsics.cy), (512, 256, 256.0, 128.0));
    assert_eq!(a.to_view(Vec3::new(1.0, 3.0, 1.0)), Vec3::new(0.0, -1.0, 2.0));
    let b = &read.views[1].view;
    assert_eq!(b.intrinsics, Intrinsics { fx: 70.0, fy: 71.0, cx: 51.0, cy: 19.0 });
    assert_eq!(b.pose.world_from_view.determinant(), 1.0);
    assert!(read.notes.iter().any(|n| n.contains("distortion of 1 cameras")));
    assert!(read.notes.iter().any(|n| n.contains("applied_transform")));
    // Without the picture its size is a guess that is told.
    let guess = read_with(text.as_bytes(), &SourceName::from("transforms.json"), &InMemory::default()).unwrap();
    assert!(guess.views[0].view.width == 800 && guess.notes.iter().any(|n| n.contains("800x800")));
    let text = text.replace("\"fl_x\": 70, \"fl_y\": 71, ", "").replace("\"camera_angle_x\"", "\"angle\"");
    let error = read_with(text.as_bytes(), &SourceName::from("transforms.json"), &memory).unwrap_err();
    assert!(error.to_string().contains("fl_x"), "{error}");
}

#[test]
fn damaged_files_are_one_clear_error_each() {
    let views = random_views(2, 3);
    for format in CAMERA_FORMATS {
        let files = format.write(&views).unwrap();
        let memory = InMemory { files: files.iter().map(|f| (f.name.to_owned(), f.bytes.clone())).collect() };
        let mut r = Random(4);
        for file in files.iter().filter(|f| !f.name.starts_with("points3D")) {
            for cut in 0..file.bytes.len() {
                // Text may be cut at the end of a line; what is left is read or refused, never a panic.
                let _ = read_with(&file.bytes[..cut], &SourceName::from(file.name), &memory);
                if file.name.ends_with(".bin") {
                    let error = read_with(&file.bytes[..cut], &SourceName::from(file.name), &memory).unwrap_err();
                    assert!(matches!(error, ReadError::Truncated { .. }), "{error}");
                }
            }
            for _ in 0..300 {
                let mut bytes = file.bytes.clone();
                for _ in 0..=r.below(4) {
                    let at = r.below(bytes.len());
                    bytes[at] = r.bits() as u8;
                }
                let _ = read_with(&bytes, &SourceName::from(file.name), &memory);
            }
        }
    }
    let huge = [u64::MAX.to_le_bytes().to_vec(), vec![0; 100]].concat();
    let memory = InMemory { files: [("cameras.bin".to_owned(), huge.clone())].into() };
    let error = read_with(&huge, &SourceName::from("images.bin"), &memory).unwrap_err();
    assert!(matches!(error, ReadError::Truncated { .. }), "{error}");
    let broken = r#"[{"width":0,"height":5,"position":[0,0,0],"rotation":[[1,0,0],[0,1,0],[0,0,1]],"fx":1,"fy":1}]"#;
    let error = read_with(broken.as_bytes(), &SourceName::from("c.json"), &InMemory::default()).unwrap_err();
    assert!(error.to_string().contains("camera 0") && error.to_string().ends_with("c.json"), "{error}");
}
