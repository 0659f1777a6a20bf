//! `splat segment` and `splat replay` from outside, on the generated room.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up its world should stop there")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

const ROOM: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/room");

/// A folder of its own for each test, empty.
fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("segment-{name}"));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// Runs the program in a folder, with a cache of its own there.
fn splat(folder: &Path, words: &[&str]) -> (i32, String, String) {
    let Output { status, stdout, stderr } = Command::new(env!("CARGO_BIN_EXE_splat"))
        .args(words)
        .current_dir(folder)
        .env("SPLAT_CACHE", folder.join("cache"))
        .output()
        .unwrap();
    (status.code().unwrap(), String::from_utf8(stdout).unwrap(), String::from_utf8(stderr).unwrap())
}

/// `splat segment` on the room, from camera 27; what is given comes after. Prints JSON.
fn segment(folder: &Path, words: &str) -> (i32, Value, String) {
    let (scene, camera) = (format!("{ROOM}/scene.spz"), format!("{ROOM}/cameras.json#27"));
    let mut all = vec!["segment", scene.as_str(), "--camera", camera.as_str(), "--json"];
    all.extend(words.split_whitespace());
    let (code, out, err) = splat(folder, &all);
    (code, serde_json::from_str(&out).unwrap_or_default(), err)
}

/// As [`segment`], which must succeed.
fn segmented(folder: &Path, words: &str) -> Value {
    let (code, report, err) = segment(folder, words);
    assert_eq!(code, 0, "{words}: {err}");
    report
}

/// All files of a folder by name.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap());
    entries.map(|e| (e.file_name().into_string().unwrap(), std::fs::read(e.path()).unwrap())).collect()
}

fn selection(folder: &Path) -> Vec<u8> {
    splat_io::npy::read_u8(folder.join("selection.npy")).unwrap()
}

/// Share of the Gaussians of a label or in a selection that are both; only those that pictures show.
fn overlap(selection: &[u8], labels: &[u8]) -> f64 {
    let truth = splat_io::npy::read_u8(format!("{ROOM}/labels.npy")).unwrap();
    let weight = splat_io::npy::read_f32(format!("{ROOM}/weight.npy")).unwrap();
    let (mut both, mut either) = (0usize, 0usize);
    for i in (0..truth.len()).filter(|&i| weight[i] > 1.0 && truth[i] != 255) {
        let (a, b) = (selection[i] == 1, labels.contains(&truth[i]));
        both += usize::from(a && b);
        either += usize::from(a || b);
    }
    both as f64 / either as f64
}

#[test]
fn a_click_takes_the_bear_out_and_every_file_is_there() {
    let dir = folder("click");
    let report = segmented(&dir, "--click 434,408 -o bear");
    let out = files(&dir.join("bear"));
    let names: Vec<&str> = out.keys().map(String::as_str).collect();
    let expected = [
        "object.ply",
        "object.png",
        "proposals.png",
        "rest.ply",
        "rest.png",
        "selection.npy",
        "selection.png",
        "session.json",
        "view.png",
    ];
    assert_eq!(names, expected);
    let mut told: Vec<&str> = report["files"].as_array().unwrap().iter().map(|f| f.as_str().unwrap()).collect();
    told.sort_unstable();
    assert_eq!(told, expected);

    let bits = selection(&dir.join("bear"));
    let (object, _) = splat_io::read(dir.join("bear/object.ply")).unwrap();
    let (rest, _) = splat_io::read(dir.join("bear/rest.ply")).unwrap();
    let (room, _) = splat_io::read(format!("{ROOM}/scene.spz")).unwrap();
    assert!(bits.len() == room.len() && bits.iter().all(|&b| b <= 1));
    let (ids, others): (Vec<u32>, Vec<u32>) = (0..room.len() as u32).partition(|&i| bits[i as usize] == 1);
    assert_eq!(object.len() as u64, report["selected"].as_u64().unwrap());
    assert_eq!(object.content_hash(), room.pick(&ids).content_hash());
    assert_eq!(rest.content_hash(), room.pick(&others).content_hash());
    // The bear (23) with its hat (24).
    let score = overlap(&bits, &[23, 24]).max(overlap(&bits, &[23]));
    assert!(score > 0.8, "{score}");

    let proposals = report["proposals"].as_array().unwrap();
    assert!((1..=3).contains(&proposals.len()) && report["wheel"].as_array().unwrap().len() <= 12);
    assert_eq!(proposals[0]["taken"], true);
    assert_eq!(proposals[0]["gaussians"], report["selected"]);
}

#[test]
fn two_runs_any_number_of_threads_and_the_cache_give_the_same_bytes() {
    let dir = folder("same");
    let words = "--click 434,408 --negative 437,318 --click 434,380 -o";
    let cold = segmented(&dir, &format!("{words} a"));
    let warm = segmented(&dir, &format!("{words} b"));
    assert_eq!((&cold["cached"], &warm["cached"]), (&Value::from(false), &Value::from(true)));
    segmented(&dir, &format!("{words} c --threads 1 --no-cache"));
    segmented(&dir, &format!("{words} d --threads 5 --no-cache"));
    let first = files(&dir.join("a"));
    for other in ["b", "c", "d"] {
        let other_files = files(&dir.join(other));
        assert!(first.keys().eq(other_files.keys()));
        for (name, bytes) in &first {
            assert!(other_files[name] == *bytes, "{name} differs in {other}");
        }
    }
    // A cache that was tampered with is made anew.
    for entry in std::fs::read_dir(dir.join("cache")).unwrap() {
        let path = entry.unwrap().path();
        let mut bytes = std::fs::read(&path).unwrap();
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
        std::fs::write(&path, bytes).unwrap();
    }
    let again = segmented(&dir, &format!("{words} e"));
    assert_eq!(again["cached"], false);
    assert!(files(&dir.join("e")) == first);
}

#[test]
fn replaying_a_session_gives_the_same_bits_and_says_so() {
    let dir = folder("replay");
    let mask = format!("{ROOM}/masks/23_teddy_main_v27.png");
    let other = format!("{ROOM}/masks/23_teddy_corr_v01.png");
    segmented(&dir, "--click 434,408 --scribble 420,400;440,420 -o clicks --format spz");
    segmented(&dir, "--box 370,326,498,493 --boundary trim -o box");
    segmented(&dir, &format!("--mask {mask} --mask {other}@1 --views 3 -o masks --boundary split"));
    for session in ["clicks", "box", "masks"] {
        let (code, out, err) =
            splat(&dir, &["replay", &format!("{session}/session.json"), "-o", &format!("{session}2")]);
        assert!(code == 0 && out.contains("the same bits"), "{out} {err}");
        assert!(files(&dir.join(session)) == files(&dir.join(format!("{session}2"))), "{session}");
    }
    let score = overlap(&selection(&dir.join("masks")), &[23]);
    assert!(score > 0.85, "{score}");
}

#[test]
fn a_replay_over_another_capture_or_another_mask_is_refused() {
    let dir = folder("refused");
    let mask = format!("{ROOM}/masks/23_teddy_main_v27.png");
    segmented(&dir, &format!("--mask {mask} -o a --no-pictures"));
    let (code, _, err) = splat(&dir, &["replay", "a/session.json", "-o", "b", "--file", "a/object.ply"]);
    assert!(code == 1 && err.contains("content hash") && err.trim().lines().count() == 1, "{err}");
    assert!(!dir.join("b").exists());

    std::fs::copy(format!("{ROOM}/masks/24_hat_corr_v27.png"), dir.join("a/prompt_mask_1.png")).unwrap();
    let (code, _, err) = splat(&dir, &["replay", "a/session.json", "-o", "b"]);
    assert!(code == 1 && err.contains("mask") && err.trim().lines().count() == 1, "{err}");

    for (name, text) in [("x.json", "{"), ("y.json", "{\"session\": 99}"), ("z.json", "{\"session\": 1}")] {
        std::fs::write(dir.join(name), text).unwrap();
        let (code, _, err) = splat(&dir, &["replay", name, "-o", "b"]);
        assert!(code == 1 && err.trim().lines().count() == 1 && err.contains(name), "{err}");
    }
}

#[test]
fn granularity_and_the_wheel_choose_smaller_and_larger_things() {
    let dir = folder("granularity");
    let size = |words: &str| segmented(&dir, &format!("--click 434,408 --no-pictures -o g {words}"));
    let object = size("")["selected"].as_u64().unwrap();
    assert!(size("--granularity part")["selected"].as_u64().unwrap() < object);
    assert!(size("--granularity group")["selected"].as_u64().unwrap() > object);
    let wheel = size("--step 1");
    assert_eq!(wheel["selected"], wheel["wheel"][0]["gaussians"]);
    let steps = wheel["wheel"].as_array().unwrap();
    let pixels: Vec<f64> = steps.iter().map(|s| s["pixels"].as_f64().unwrap()).collect();
    assert!(pixels.is_sorted(), "{pixels:?}");
}

#[test]
fn a_folder_used_again_holds_nothing_of_the_run_before() {
    let dir = folder("again");
    segmented(&dir, "--click 434,408 -o out");
    std::fs::write(dir.join("out/notes.txt"), "mine").unwrap();
    segmented(&dir, "--box 370,326,498,493 --no-pictures --format spz -o out");
    let out = files(&dir.join("out"));
    let names: Vec<&str> = out.keys().map(String::as_str).collect();
    assert_eq!(names, ["notes.txt", "object.spz", "rest.spz", "selection.npy", "session.json"]);
}

#[test]
fn cut_objects_stay_expressed_in_input_ids() {
    let dir = folder("edge");
    let kept = segmented(&dir, "--click 434,408 --no-pictures -o keep");
    for edge in ["split", "trim"] {
        let report = segmented(&dir, &format!("--click 434,408 --no-pictures -o {edge} --boundary {edge}"));
        assert_eq!(report["selected"], kept["selected"]);
        assert!(selection(&dir.join(edge)) == selection(&dir.join("keep")));
        assert!(report["boundary"]["cut_selected"].as_u64().unwrap() > 0, "{report}");
        let object = std::fs::read(dir.join(edge).join("object.ply")).unwrap();
        assert!(object != std::fs::read(dir.join("keep/object.ply")).unwrap());
    }
}

#[test]
fn without_cameras_views_are_made_up() {
    let dir = folder("survey");
    let scene = format!("{ROOM}/scene.spz");
    let (code, out, err) = splat(
        &dir,
        &["segment", &scene, "--orbit", "30,20", "--size", "400x300", "--click", "200,150", "-o", "a", "--json"],
    );
    assert_eq!(code, 0, "{err}");
    let report: Value = serde_json::from_str(&out).unwrap();
    assert!(report["selected"].as_u64().unwrap() > 0);
}

#[test]
fn what_makes_no_sense_is_refused_in_one_sentence() {
    let dir = folder("bad");
    let mask = format!("{ROOM}/masks/23_teddy_main_v27.png");
    splat_io::picture::write_png_gray8(dir.join("small.png"), 4, 4, &[255; 16]).unwrap();
    splat_io::picture::write_png_gray8(dir.join("black.png"), 800, 600, &[0; 480_000]).unwrap();
    let cases = [
        ("--click 900,100", 1, "outside the picture of 800x600"),
        ("--click -1,100", 1, "outside the picture"),
        ("--click 434,408 --negative 3,700", 1, "outside the picture"),
        ("--box 10,10,5,20", 1, "box"),
        ("--box 10,10,900,20", 1, "box"),
        ("--mask small.png", 1, "4x4"),
        ("--mask black.png", 1, "empty"),
        ("--mask missing.png", 1, "missing.png"),
        ("--click 434,408@77", 2, "0 to 35"),
        ("--click 434,408 --step 12 --granularity part --format xyz", 2, "xyz"),
        ("--negative 434,408", 2, "--click"),
        ("", 2, "--click"),
        ("--click 434", 2, "2 numbers"),
        ("--click 1,2 --theta 0.5 --method graph", 2, "--theta"),
    ];
    for (words, code, part) in cases {
        let (got, _, err) = segment(&dir, &format!("{words} -o out"));
        assert!(got == code && err.contains(part), "{words}: {got} {err}");
        assert!(code == 2 || err.trim().lines().count() == 1, "{words}: {err}");
        assert!(!dir.join("out/session.json").exists(), "{words}");
    }
    let (code, _, err) = segment(&dir, &format!("--mask {mask} --box 1,1,9,9 -o out"));
    assert!(code == 2 && err.contains("mask"), "{err}");
    // The capture itself is never written over.
    std::fs::create_dir_all(dir.join("own")).unwrap();
    let own = dir.join("own/object.ply");
    std::fs::copy(format!("{ROOM}/scene.spz"), &own).unwrap();
    let words = ["segment", "own/object.ply", "--orbit", "30,20", "--click", "640,360", "-o", "own"];
    let (code, _, err) = splat(&dir, &words);
    assert!(code == 1 && err.contains("written over"), "{err}");
    assert!(std::fs::read(&own).unwrap() == std::fs::read(format!("{ROOM}/scene.spz")).unwrap());
    // Beside everything that was captured there is nothing.
    let scene = format!("{ROOM}/scene.spz");
    let nothing = ["segment", &scene, "--orbit", "0,0,1000", "--click", "5,5", "-o", "out"];
    let (code, _, err) = splat(&dir, &nothing);
    assert!(code == 1 && err.contains("nothing at 5,5"), "{err}");
}

#[test]
fn the_main_job_takes_the_bear_out_of_the_built_in_room() {
    let dir = folder("main-job");
    let (code, out, err) = splat(&dir, &[]);
    assert_eq!(code, 0, "{err}");
    assert!(out.contains("object.png") && out.contains("splat-room"), "{out}");
    let score = overlap(&selection(&dir.join("splat-room")), &[23, 24]);
    assert!(score > 0.9, "{score}");
    let (code, out, err) = splat(&dir, &["replay", "splat-room/session.json", "-o", "again"]);
    assert!(code == 0 && out.contains("the same bits"), "{out} {err}");
    let (code, _, err) = splat(&dir, &["--out", "elsewhere", "--quiet"]);
    assert!(code == 0 && err.is_empty(), "{err}");
    assert!(files(&dir.join("elsewhere")) == files(&dir.join("splat-room")));
}
