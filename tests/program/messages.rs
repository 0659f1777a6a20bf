//! Exit codes, sentences, JSON, quiet.

use std::fs;

use crate::common::{done, folder, json, splat, three_heaps, write};

/// Every command that reads a capture, with `FILE` for its name.
const READERS: [&str; 8] = [
    "info FILE",
    "convert FILE out.spz",
    "render FILE -o out.png",
    "check FILE",
    "select FILE --rect 0,0,9,9 -o out.npy",
    "orient FILE -o out.ply",
    "scale FILE --metres-per-unit 2 -o out.ply",
    "bench FILE --rounds 1",
];

#[test]
fn files_that_cannot_be_read_give_one_sentence_and_code_1() {
    let dir = folder("unreadable");
    write(&dir, "whole.ply", &three_heaps(0));
    let whole = fs::read(dir.join("whole.ply")).unwrap();
    fs::write(dir.join("truncated.ply"), &whole[..whole.len() / 2]).unwrap();
    fs::write(dir.join("empty.ply"), b"").unwrap();
    fs::write(dir.join("text.ply"), b"this is no splat file, whatever its name says").unwrap();
    for line in READERS {
        for file in ["missing.ply", "truncated.ply", "empty.ply", "text.ply", "."] {
            let said = splat(&dir, &line.replace("FILE", file));
            assert_eq!(said.code, 1, "{line} {file}: {said:?}");
            assert!(said.out.is_empty(), "{line} {file}: {said:?}");
            assert!(said.err.starts_with("error: "), "{line} {file}: {said:?}");
            assert_eq!(said.err.trim_end().lines().count(), 1, "{line} {file}: {said:?}");
            assert!(said.err.contains(file), "{line} {file}: {said:?}");
        }
    }
    assert!(!dir.join("out.spz").exists() && !dir.join("out.png").exists() && !dir.join("out.ply").exists());
}

#[test]
fn command_lines_that_make_no_sense_give_code_2_and_a_way_on() {
    let dir = folder("usage");
    write(&dir, "a.ply", &three_heaps(0));
    done(&dir, "render a.ply -o a.png --size 8x8");
    for line in [
        "nonsense",
        "info",
        "info a.ply --unknown",
        "convert a.ply",
        "convert a.ply out.xyz",
        "convert a.ply out.ply --format nonsense",
        "convert a.ply out.ply --transform 1,2",
        "convert a.ply out.ply --transform 0,0,0,-1",
        "convert a.ply out.ply --sh-degree 5",
        "render a.ply",
        "render a.ply -o b.png --size 0x5",
        "render a.ply -o b.png --orbit 1",
        "render a.ply -o b.png --orbit 0,100",
        "render a.ply -o b.png --output nonsense",
        "render a.ply -o b.png --background 2,0,0",
        "render a.ply -o b.png --camera x#0 --orbit 0,0",
        "render a.ply -o b.png --up 0,0,0",
        "render a.ply -o b.jpg",
        "select a.ply -o b.png",
        "select a.ply --rect 1,2,3",
        "select a.ply --mode add",
        "select a.ply --rect 0,0,1,1 --mode nonsense",
        "select a.ply --value nonsense<1",
        "select a.ply --value opacity",
        "select a.ply --grow 0",
        "orient a.ply --axes xxy",
        "orient a.ply --axes xyz --floor",
        "orient a.ply --points 1,2",
        "orient a.ply --floor --points 1,2,3",
        "scale a.ply",
        "scale a.ply --length 1",
        "scale a.ply --metres-per-unit 0",
        "check a.ply --keep giants",
        "check a.ply --repair b.ply --keep nonsense",
        "bench a.ply --backend nonsense",
        "completions nonsense",
        "info a.ply --threads 0",
    ] {
        let said = splat(&dir, line);
        assert_eq!(said.code, 2, "{line}: {said:?}");
        assert!(said.err.starts_with("error: ") && said.err.contains("--help"), "{line}: {said:?}");
        assert!(said.out.is_empty(), "{line}: {said:?}");
    }
    assert!(!dir.join("b.png").exists() && !dir.join("out.ply").exists());
}

#[test]
fn every_command_that_reports_prints_json_when_asked() {
    let dir = folder("json");
    write(&dir, "a.ply", &three_heaps(1));
    let info = json(&dir, "info a.ply");
    assert_eq!((info["gaussians"].as_u64(), info["sh_degree"].as_u64()), (Some(180), Some(1)));
    assert_eq!((info["format"].as_str(), info["not_finite"].as_u64()), (Some("ply"), Some(0)));
    assert!((info["robust"]["center"][0].as_f64().unwrap()).abs() < 0.5);
    let alpha = info["opacity"]["median"].as_f64().unwrap();
    assert!((alpha - 0.95).abs() < 1e-3, "{alpha}");

    let convert = json(&dir, "convert a.ply b.spz");
    assert_eq!(convert["gaussians_written"], 180);
    assert_eq!(convert["bytes_written"].as_u64(), Some(fs::metadata(dir.join("b.spz")).unwrap().len()));
    let render = json(&dir, "render a.ply -o a.png --size 64x48");
    assert_eq!((render["width"].as_u64(), render["height"].as_u64()), (Some(64), Some(48)));
    assert!(json(&dir, "check a.ply")["findings"].is_array());
    assert_eq!(json(&dir, "select a.ply --value \"x<-1\" -o s.npy")["selected"], 60);
    assert_eq!(json(&dir, "orient a.ply")["matrix"].as_array().unwrap().len(), 4);
    assert!(json(&dir, "list").as_array().unwrap().len() >= 5);

    let bench = json(&dir, "bench a.ply --size 32x24 --rounds 1");
    assert_eq!((bench["gaussians"].as_u64(), bench["size"][0].as_u64()), (Some(180), Some(32)));
    let names: Vec<&str> = bench["stages"].as_array().unwrap().iter().map(|s| s["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["load", "project", "sort", "raster", "color", "all_outputs", "votes"]);
    for stage in bench["stages"].as_array().unwrap() {
        let (median, p90) = (stage["median_ms"].as_f64().unwrap(), stage["p90_ms"].as_f64().unwrap());
        assert!(median >= 0.0 && p90 >= median, "{stage}");
        assert!(!cfg!(unix) || stage["cpu_ms"].as_f64().unwrap() >= 0.0, "{stage}");
    }
}

#[test]
fn quiet_says_nothing_beside_the_report_and_pipes_get_no_progress() {
    let dir = folder("quiet");
    write(&dir, "a.ply", &three_heaps(0));
    let loud = done(&dir, "convert a.ply b.splat");
    assert!(loud.out.is_empty() && loud.err.contains("wrote 180 Gaussians"), "{loud:?}");
    assert!(!loud.err.contains('\r') && !loud.err.contains('\u{1b}'), "{loud:?}");
    let quiet = done(&dir, "convert a.ply b.splat --quiet");
    assert!(quiet.out.is_empty() && quiet.err.is_empty(), "{quiet:?}");
    let quiet = done(&dir, "--quiet info a.ply");
    assert!(quiet.out.contains("180") && quiet.err.is_empty(), "{quiet:?}");
}

#[test]
fn lists_come_from_the_tables() {
    let dir = folder("list");
    let markdown = done(&dir, "list --markdown").out;
    for format in splat_io::FORMATS {
        assert!(markdown.contains(&format!("| {} |", format.name())), "{}", format.name());
    }
    for tracker in splat_segment::trackers::TRACKERS {
        assert!(markdown.contains(&format!("| {} |", tracker.name())), "{}", tracker.name());
    }
    let help = done(&dir, "--help").out;
    for command in json(&dir, "list commands")[0]["rows"].as_array().unwrap() {
        let (name, about) = (command[0].as_str().unwrap(), command[1].as_str().unwrap());
        assert!(markdown.contains(&format!("| {name} |")) && help.contains(name), "{name}");
        assert!(done(&dir, &format!("{name} --help")).out.starts_with(about), "{name}");
    }
    assert!(help.contains("Exit codes"));
}

#[test]
fn help_texts_are_those_that_someone_looked_at() {
    let dir = folder("help");
    let expected = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/program/expected");
    let list = json(&dir, "list commands");
    let names = list[0]["rows"].as_array().unwrap().iter().map(|row| row[0].as_str().unwrap().to_owned());
    for name in names.chain([String::new()]) {
        let got = done(&dir, &format!("{name} --help")).out;
        let file = expected.join(format!("help_{name}.txt").replace("_.", "."));
        if std::env::var_os("UPDATE_SNAPSHOTS").is_some() {
            fs::create_dir_all(&expected).unwrap();
            fs::write(&file, &got).unwrap();
        }
        let wanted = fs::read_to_string(&file).unwrap_or_default().replace("\r\n", "\n");
        assert!(got == wanted, "{name} --help changed; if it reads well, run again with UPDATE_SNAPSHOTS=1:\n{got}");
    }
}

#[test]
fn completions_are_made_for_every_shell() {
    let dir = folder("completions");
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = done(&dir, &format!("completions {shell}")).out;
        assert!(script.contains("splat") && script.contains("orient"), "{shell}");
    }
}

#[test]
fn two_runs_and_any_number_of_threads_give_the_same_bytes() {
    let dir = folder("same");
    write(&dir, "a.ply", &three_heaps(3));
    for (k, threads) in [1, 1, 3].into_iter().enumerate() {
        done(&dir, &format!("render a.ply -o {k}.png --size 96x64 --threads {threads}"));
        done(&dir, &format!("convert a.ply {k}.spz --threads {threads}"));
        done(&dir, &format!("check a.ply --repair {k}.ply --threads {threads}"));
        done(&dir, &format!("select a.ply --rect 0,0,600,400 --project depth --grow 1 -o {k}.npy --threads {threads}"));
    }
    for ending in ["png", "spz", "ply", "npy"] {
        let bytes = |k: usize| fs::read(dir.join(format!("{k}.{ending}"))).unwrap();
        assert!(bytes(0) == bytes(1) && bytes(0) == bytes(2), "{ending}");
    }
}

#[test]
fn the_graphics_card_draws_the_same_picture_or_a_sentence_says_why_not() {
    let dir = folder("backend");
    write(&dir, "a.ply", &three_heaps(0));
    done(&dir, "render a.ply -o cpu.png --size 64x48");
    done(&dir, "render a.ply -o auto.png --size 64x48 --backend auto");
    assert!(dir.join("auto.png").exists());
    let said = splat(&dir, "render a.ply -o gpu.png --size 64x48 --backend gpu");
    if cfg!(not(feature = "gpu")) {
        assert_eq!(said.code, 1, "{said:?}");
        assert!(said.err.contains("--features gpu") && said.err.trim_end().lines().count() == 1, "{said:?}");
        assert!(!dir.join("gpu.png").exists());
    } else if said.code == 0 {
        let read = |name: &str| {
            let mut reader = png::Decoder::new(std::io::BufReader::new(fs::File::open(dir.join(name)).unwrap()))
                .read_info()
                .unwrap();
            let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
            reader.next_frame(&mut pixels).unwrap();
            pixels
        };
        let (cpu, gpu) = (read("cpu.png"), read("gpu.png"));
        assert_eq!(cpu.len(), gpu.len());
        assert!(cpu.iter().zip(&gpu).all(|(a, b)| a.abs_diff(*b) <= 4));
    } else {
        assert!(said.err.contains("no GPU was found"), "{said:?}");
        println!("skipped: no Vulkan device");
    }
}
