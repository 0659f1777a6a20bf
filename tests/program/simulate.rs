//! `simulate`: a bear falls in the generated room.

use std::fs;
use std::path::{Path, PathBuf};

use crate::common::{done, folder, json, picture, splat, three_heaps, write};

fn room() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/room")
}

/// A folder with the bear and its hat selected.
fn selections(name: &str) -> PathBuf {
    let dir = folder(name);
    let labels = splat_io::npy::read_u8(room().join("labels.npy")).unwrap();
    let select = |file: &str, wanted: &[u8]| {
        let bits: Vec<u8> = labels.iter().map(|label| u8::from(wanted.contains(label))).collect();
        splat_io::npy::write_u8(dir.join(file), &bits).unwrap();
    };
    select("bear.npy", &[23, 24]);
    select("hat.npy", &[24]);
    dir
}

#[test]
fn a_bear_falls_and_comes_to_rest_with_its_pictures_pose_and_numbers() {
    let dir = selections("simulate");
    let scene = room().join("scene.spz");
    let line = format!(
        "simulate {} --part bear.npy --material plush --material hat.npy=wood_hard --metres-per-unit 1 --lift 0.2 \
         --seconds 0.6 --fps 10 --handles 8 --camera {}#27 --size 96x72 -o out",
        scene.display(),
        room().join("cameras.json").display()
    );
    let report = json(&dir, &line);
    let number = |name: &str| report[name].as_f64().unwrap_or_else(|| panic!("{name}: {report}"));
    assert!(number("mass") > 0.1 && number("mass") < 20.0, "{report}");
    assert!(number("volume") > 0.002 && number("volume") < 0.1, "{report}");
    assert_eq!((number("steps"), number("frames")), (36.0, 7.0), "{report}");
    // A fall of 20 cm takes 0.2 s; a body of plush sags a little further.
    assert!(number("fell") > 0.1 && number("fell") < 0.45, "{report}");
    assert!(number("contacts_most") >= 3.0 && number("first_contact") > 0.1, "{report}");
    assert_ne!(report["status"], "frozen");
    let stored: serde_json::Value = serde_json::from_slice(&fs::read(dir.join("out/report.json")).unwrap()).unwrap();
    assert_eq!(stored, report);

    let first = picture(&dir.join("out/frame_0000.png"));
    let last = picture(&dir.join("out/frame_0006.png"));
    assert_eq!((first.0, first.1), (96, 72));
    assert!(first.2 != last.2, "nothing moves in the pictures");
    let pose = splat_io::read(dir.join("out/part.ply")).unwrap().0;
    let bits = splat_io::npy::read_u8(dir.join("bear.npy")).unwrap();
    assert_eq!(pose.len(), bits.iter().filter(|&&b| b != 0).count());
    assert!(pose.means().iter().all(|m| m.is_finite()));
    assert_eq!(pose.source().metres_per_unit(), Some(1.0));
}

#[test]
fn what_cannot_be_simulated_is_told_in_one_sentence() {
    let dir = folder("simulate_bad");
    write(&dir, "a.ply", &three_heaps(0));
    splat_io::npy::write_u8(dir.join("none.npy"), &[0; 180]).unwrap();
    splat_io::npy::write_u8(dir.join("one.npy"), &std::array::from_fn::<u8, 180, _>(|i| u8::from(i == 0))).unwrap();
    splat_io::npy::write_u8(dir.join("short.npy"), &[1; 5]).unwrap();
    for (line, code, word) in [
        ("--part none.npy --material plush", 1, "empty"),
        ("--part one.npy --material plush", 1, "select more"),
        ("--part short.npy --material plush", 1, "5 entries"),
        ("--part one.npy --material unobtainium", 2, "there is no material"),
        ("--part one.npy --material one.npy=plush", 2, "one --material NAME"),
        ("--part one.npy", 2, "--material"),
        ("--part one.npy --material plush --seconds 0", 2, "above 0"),
        ("--part one.npy --material plush --metres-per-unit 1e9", 1, ""),
        ("--part absent.npy --material plush", 1, "absent.npy"),
    ] {
        let said = splat(&dir, &format!("simulate a.ply {line} --size 32x24 -o out"));
        assert_eq!(said.code, code, "{line}: {said:?}");
        assert!(said.err.starts_with("error: ") || said.err.contains("\nerror: "), "{line}: {said:?}");
        assert!(said.err.contains(word) && said.out.is_empty(), "{line}: {said:?}");
    }
    assert!(!dir.join("out").exists());
    done(&dir, "simulate --help");
}
