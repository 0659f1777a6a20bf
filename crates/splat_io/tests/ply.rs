//! PLY: bit-exact round trips and every shape of file that is met in the wild.

#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod common;

use common::{Random, capture, random_cloud};
use splat_core::glam::Quat;
use splat_core::{Cloud, ExtraProperty, ExtraValues};
use splat_io::{ReadError, ReadReport, WriteOptions, Written, format_named, read_bytes, write_as};

fn ply(cloud: &Cloud) -> (Vec<u8>, Written) {
    let mut file = Vec::new();
    let written = write_as(format_named("ply").unwrap(), cloud, &WriteOptions::default(), &mut file).unwrap();
    assert_eq!(written.bytes, file.len() as u64);
    (file, written)
}

fn parse(file: &[u8]) -> (Cloud, ReadReport) {
    read_bytes(file, "test.ply").unwrap()
}

fn error(file: &[u8]) -> String {
    read_bytes(file, "test.ply").unwrap_err().to_string()
}

/// A file made by hand: a header, and per Gaussian the properties' bytes.
fn file(format: &str, before: &str, count: usize, properties: &[(&str, &str)], body: &[u8]) -> Vec<u8> {
    let mut text = format!("ply\nformat {format} 1.0\n{before}element vertex {count}\n");
    for (kind, name) in properties {
        text += &format!("property {kind} {name}\n");
    }
    let mut out = (text + "end_header\n").into_bytes();
    out.extend_from_slice(body);
    out
}

const PLAIN: [&str; 14] = [
    "x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2",
    "rot_3",
];

fn floats(names: &[&'static str]) -> Vec<(&'static str, &'static str)> {
    names.iter().map(|n| ("float", *n)).collect()
}

#[test]
fn real_captures_are_written_back_bit_for_bit() {
    let names =
        ["plaza", "desk", "bench/tumblewood", "bench/trumpeter", "bench/cardbox"].map(|s| format!("{s}/scene.ply"));
    for name in names.iter().map(String::as_str).chain(["formats/sample.ply"]) {
        let Some(path) = capture(name) else { return };
        let (cloud, report) = splat_io::read(&path).unwrap();
        assert_eq!(report.format, "ply");
        assert_eq!((report.not_finite, report.bad_rotations, report.trailing_bytes), (0, 0, 0));
        assert!(ply(&cloud).0 == std::fs::read(&path).unwrap(), "{name} changed");
    }
}

#[test]
fn random_clouds_of_every_degree_survive_and_are_stable() {
    for degree in 0..=4 {
        for count in [0, 1, 2, 513, 5000] {
            let cloud = random_cloud(u64::from(degree) + count as u64, count, degree);
            let (first, written) = ply(&cloud);
            assert_eq!(written.losses, [""; 0]);
            let (read, _) = parse(&first);
            assert_eq!(read.content_hash(), cloud.content_hash());
            assert!(read.extras().is_empty());
            assert!(ply(&read).0 == first);
        }
    }
}

#[test]
fn any_bits_survive_in_any_order_and_type_little_and_big_endian() {
    let sizes =
        [("char", 1), ("uchar", 1), ("short", 2), ("ushort", 2), ("int", 4), ("uint", 4), ("float", 4), ("double", 8)];
    let mut r = Random(5);
    for case in 0..60 {
        let big = case % 2 == 1;
        let mut properties: Vec<(&str, String)> = Vec::new();
        let rest = [0, 9, 24, 45, 72][case / 2 % 5];
        let rest: Vec<String> = (0..rest).map(|i| format!("f_rest_{i}")).collect();
        let names = PLAIN.iter().copied().chain(rest.iter().map(String::as_str));
        for name in names.chain(["nx", "ny", "nz", "label", "confidence"]) {
            // In a third of the files all are floats: the fast road.
            let any = case % 3 > 0 && (r.below(4) == 0 || name == "label");
            let kind = if any { sizes[r.below(8)].0 } else { "float" };
            properties.push((kind, name.to_owned()));
        }
        for i in (1..properties.len()).rev() {
            properties.swap(i, r.below(i + 1));
        }
        let stride: usize = properties.iter().map(|p| sizes.iter().find(|s| s.0 == p.0).unwrap().1).sum();
        let count = [1, 7, 2100][r.below(3)];
        // Random bits hold every kind of NaN, infinity and denormal.
        let body: Vec<u8> = (0..stride * count + 3).map(|_| r.bits() as u8).collect();
        let table: Vec<(&str, &str)> = properties.iter().map(|p| (p.0, p.1.as_str())).collect();
        let format = if big { "binary_big_endian" } else { "binary_little_endian" };
        let whole = file(format, "comment made by hand\nobj_info x\n", count, &table, &body);
        let (cloud, report) = parse(&whole);
        assert_eq!((cloud.len(), report.trailing_bytes), (count, 3), "case {case}");
        assert!(ply(&cloud).0 == whole, "case {case} changed");
    }
}

#[test]
fn order_type_and_encoding_do_not_change_the_values() {
    let cloud = random_cloud(3, 300, 2);
    let (canonical, _) = ply(&cloud);
    let text = String::from_utf8_lossy(&canonical[..canonical.windows(11).position(|w| w == b"end_header\n").unwrap()])
        .into_owned();
    let names: Vec<&str> = text.lines().filter_map(|l| l.strip_prefix("property float ")).collect();
    let start = canonical.len() - 300 * names.len() * 4;
    let value = |i: usize, p: usize| {
        let at = start + (i * names.len() + p) * 4;
        f32::from_le_bytes(canonical[at..at + 4].try_into().unwrap())
    };
    let mut order: Vec<usize> = (0..names.len()).collect();
    order.reverse();
    let mut r = Random(9);
    for (format, kind) in [
        ("binary_little_endian", "float"),
        ("binary_big_endian", "float32"),
        ("binary_little_endian", "double"),
        ("binary_big_endian", "float64"),
        ("ascii", "float"),
        ("ascii", "double"),
    ] {
        for i in (1..order.len()).rev() {
            order.swap(i, r.below(i + 1));
        }
        let mut body = Vec::new();
        for i in 0..300 {
            for &p in &order {
                let v = value(i, p);
                match (format, kind) {
                    ("ascii", _) => body.extend(format!("{v} ").bytes()),
                    ("binary_little_endian", "float") => body.extend(v.to_le_bytes()),
                    ("binary_little_endian", _) => body.extend(f64::from(v).to_le_bytes()),
                    (_, "float32") => body.extend(v.to_be_bytes()),
                    _ => body.extend(f64::from(v).to_be_bytes()),
                }
            }
            if format == "ascii" {
                body.push(b'\n');
            }
        }
        let table: Vec<(&str, &str)> = order.iter().map(|&p| (kind, names[p])).collect();
        let (read, _) = parse(&file(format, "", 300, &table, &body));
        assert_eq!(read.content_hash(), cloud.content_hash(), "{format} {kind}");
    }
}

#[test]
fn other_elements_before_and_after_are_kept_and_left_out_when_the_count_changes() {
    let before = "element camera 2\nproperty uchar id\nproperty list uchar short path\n";
    let properties = floats(&PLAIN);
    let mut body: Vec<u8> = vec![1, 2, 10, 0, 11, 0, 2, 0];
    body.extend((0..3 * 14).flat_map(|i| (i as f32).to_le_bytes()));
    body.extend([3, 1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0]);
    let mut whole = file("binary_little_endian", before, 3, &properties, &body);
    let at = whole.windows(11).position(|w| w == b"end_header\n").unwrap();
    whole.splice(at..at, *b"element face 1\nproperty list uchar int vertex_indices\n");
    let (cloud, report) = parse(&whole);
    assert_eq!((cloud.len(), report.trailing_bytes), (3, 0));
    assert_eq!(cloud.means()[1].to_array(), [14.0, 15.0, 16.0]);
    assert_eq!(cloud.rotations()[0], Quat::from_xyzw(11.0, 12.0, 13.0, 10.0));
    assert!(ply(&cloud).0 == whole);

    let (some, written) = ply(&cloud.pick(&[2, 0]));
    assert!(written.losses[0].contains("other elements"), "{:?}", written.losses);
    let (some, _) = parse(&some);
    assert_eq!(some.means(), [cloud.means()[2], cloud.means()[0]]);
    assert!(cloud.pick(&[]).is_empty() && parse(&ply(&cloud.pick(&[])).0).0.is_empty());
}

#[test]
fn a_picked_cloud_keeps_order_comments_and_extras_of_its_file() {
    let mut names = PLAIN.to_vec();
    names.rotate_left(5);
    let mut properties = floats(&names);
    properties.insert(3, ("ushort", "label"));
    let body: Vec<u8> = (0..10u8).flat_map(|i| (0..58).map(move |k| i.wrapping_mul(31).wrapping_add(k))).collect();
    let (cloud, _) = parse(&file("binary_big_endian", "comment hello\n", 10, &properties, &body));
    let (picked, written) = ply(&cloud.pick(&[9, 0, 4]));
    assert!(written.losses.is_empty());
    let expected: Vec<u8> = [9, 0, 4].iter().flat_map(|&i| body[i * 58..(i + 1) * 58].to_vec()).collect();
    assert!(picked == file("binary_big_endian", "comment hello\n", 3, &properties, &expected));
}

#[test]
fn edited_clouds_get_a_header_that_fits_them() {
    let mut arrays = random_cloud(8, 20, 1).into_arrays();
    arrays.source.comments = vec!["two\nlines".to_owned()];
    arrays.source.antialiased = true;
    let extra = |name: &str, values| ExtraProperty { name: name.to_owned(), values };
    arrays.extras.push(extra("nx", ExtraValues::F32(vec![1.0; 20])));
    arrays.extras.push(extra("label", ExtraValues::U8((0..20).collect())));
    arrays.extras.push(extra("opacity", ExtraValues::U8((0..20).collect())));
    let (first, written) = ply(&Cloud::new(arrays).unwrap());
    assert_eq!(written.losses.len(), 1, "a second `opacity` cannot be written");
    let (read, _) = parse(&first);
    assert!(read.source().antialiased);
    assert_eq!(read.source().comments, ["two lines", "SplatRenderMode: mip"]);
    assert_eq!(read.extras().iter().map(|e| e.name.as_str()).collect::<Vec<_>>(), ["nx", "ny", "nz", "label"]);

    // Another degree and one extra less: the old header fits no more.
    let mut arrays = read.into_arrays();
    arrays.sh_degree = 0;
    arrays.sh.truncate(60);
    arrays.extras.pop();
    let (again, _) = parse(&ply(&Cloud::new(arrays).unwrap()).0);
    assert_eq!((again.sh_degree(), again.extras().len()), (0, 3));
}

#[test]
fn double_columns_are_exact_until_someone_edits_them() {
    let properties: Vec<(&str, &str)> = PLAIN.iter().map(|n| ("double", *n)).collect();
    let mut r = Random(2);
    let body: Vec<u8> = (0..5 * 14).flat_map(|_| f64::from(r.unit()).sqrt().to_le_bytes()).collect();
    let whole = file("binary_little_endian", "", 5, &properties, &body);
    let (cloud, _) = parse(&whole);
    assert!(ply(&cloud).0 == whole);
    let mut arrays = cloud.into_arrays();
    arrays.means[2].x = 7.0;
    let moved = Cloud::new(arrays).unwrap();
    let (again, _) = parse(&ply(&moved).0);
    assert_eq!(again.content_hash(), moved.content_hash());
}

#[test]
fn the_filter_of_mip_splatting_is_fused_once_and_written_back_exactly() {
    let mut properties = floats(&PLAIN);
    properties.push(("float", "filter_3D"));
    let mut r = Random(4);
    let body: Vec<u8> = (0..9 * 15).flat_map(|_| (r.unit() - 0.5).to_le_bytes()).collect();
    let whole = file("binary_little_endian", "", 9, &properties, &body);
    let (cloud, report) = parse(&whole);
    assert!(report.notes[0].contains("filter_3D"), "{:?}", report.notes);
    assert!(cloud.extras().is_empty());
    let stored = |i: usize, p: usize| f32::from_le_bytes(body[(i * 15 + p) * 4..][..4].try_into().unwrap());
    for i in 0..9 {
        assert!(cloud.log_scales()[i].x > stored(i, 7) && cloud.opacity_logits()[i] < stored(i, 6));
    }
    assert!(ply(&cloud).0 == whole);
    // Picked, the filter is part of the values and must not be applied again.
    let some = cloud.pick(&[3, 1]);
    let (read, report) = parse(&ply(&some).0);
    assert_eq!(read.content_hash(), some.content_hash());
    assert!(report.notes.is_empty());
}

#[test]
fn two_dimensional_gaussians_get_a_flat_third_axis() {
    let names: Vec<&str> = PLAIN.iter().copied().filter(|n| *n != "scale_2").collect();
    let body: Vec<u8> = (0..2 * 13).flat_map(|i| (i as f32).to_le_bytes()).collect();
    let whole = file("binary_little_endian", "", 2, &floats(&names), &body);
    let (cloud, report) = parse(&whole);
    assert!((cloud.scale(1).z - 1e-6).abs() < 1e-8);
    assert!(report.notes[0].contains("2D Gaussians"));
    assert!(ply(&cloud).0 == whole);
    let mut arrays = cloud.into_arrays();
    arrays.log_scales[0].z = -2.0;
    let thick = Cloud::new(arrays).unwrap();
    assert_eq!(parse(&ply(&thick).0).0.content_hash(), thick.content_hash());
}

#[test]
fn antialiased_training_is_found_in_comments_and_the_last_one_counts() {
    let body: Vec<u8> = (0..14).flat_map(|i| (i as f32).to_le_bytes()).collect();
    for (comments, expected) in [
        ("", false),
        ("comment SplatRenderMode: mip\n", true),
        ("comment splatrendermode:MIP\ncomment antialiased 0\n", false),
        ("comment Antialiased 1\n", true),
        ("comment SplatRenderMode: mip\ncomment SplatRenderMode: default\n", false),
    ] {
        let whole = file("binary_little_endian", comments, 1, &floats(&PLAIN), &body);
        assert_eq!(parse(&whole).0.source().antialiased, expected, "{comments}");
    }
}

#[test]
fn line_ends_of_another_system_are_kept() {
    let body: Vec<u8> = (0..14).flat_map(|i| (i as f32).to_le_bytes()).collect();
    let unix = file("binary_little_endian", "comment a\n", 1, &floats(&PLAIN), &[]);
    let mut whole = String::from_utf8(unix).unwrap().replace('\n', "\r\n").into_bytes();
    whole.extend(&body);
    let (cloud, _) = parse(&whole);
    assert_eq!(cloud.source().comments, ["a"]);
    assert!(ply(&cloud).0 == whole);
}

#[test]
fn oddities_are_counted_and_keep_their_ids() {
    let mut arrays = random_cloud(1, 6, 1).into_arrays();
    arrays.means[1].y = f32::NAN;
    arrays.rotations[2] = Quat::from_xyzw(0.0, 0.0, 0.0, 0.0);
    arrays.opacity_logits[3] = f32::INFINITY;
    arrays.sh[4 * 12 + 5] = f32::NEG_INFINITY;
    let (read, report) = parse(&ply(&Cloud::new(arrays).unwrap()).0);
    assert_eq!((read.len(), report.not_finite, report.bad_rotations), (6, 1, 1));
    assert!(report.notes[0].starts_with("1 Gaussians"), "{:?}", report.notes);
}

#[test]
fn files_that_hold_something_else_are_refused_with_a_way_on() {
    let cloud =
        [("float", "x"), ("float", "y"), ("float", "z"), ("uchar", "red"), ("uchar", "green"), ("uchar", "blue")];
    let text = error(&file("binary_little_endian", "", 1, &cloud, &[0; 15]));
    assert!(text.contains("point cloud") && text.ends_with("test.ply"), "{text}");
    let mut names = PLAIN.to_vec();
    names.retain(|n| *n != "rot_2");
    let text = error(&file("binary_little_endian", "", 0, &floats(&names), &[]));
    assert!(text.contains("`rot_2`") && text.contains("missing"), "{text}");
    let rest: Vec<&'static str> = PLAIN.iter().copied().chain(["f_rest_0", "f_rest_1"]).collect();
    assert!(error(&file("binary_little_endian", "", 0, &floats(&rest), &[])).contains("f_rest"));
    assert!(error(b"ply\nformat binary_little_endian 1.0\nend_header\n").contains("`vertex`"));
    assert!(error(b"not a splat file at all").contains("none of the known formats"));
    assert!(error(b"").contains("empty"));
}

#[test]
fn incomplete_degrees_fall_back_to_the_largest_complete_one() {
    let rest: Vec<String> = (0..30).map(|i| format!("f_rest_{i}")).collect();
    let mut properties = floats(&PLAIN);
    properties.extend(rest.iter().map(|n| ("float", n.as_str())));
    let body: Vec<u8> = (0..44).flat_map(|i| (i as f32).to_le_bytes()).collect();
    let whole = file("binary_little_endian", "", 1, &properties, &body);
    let (cloud, report) = parse(&whole);
    assert_eq!((cloud.sh_degree(), cloud.extras().len()), (2, 6));
    // Ten coefficients per channel: the first of green is number 10.
    assert_eq!(cloud.sh_of(0)[3..6], [14.0, 24.0, 34.0]);
    assert!(report.notes[0].contains("6 properties"), "{:?}", report.notes);
    assert!(ply(&cloud).0 == whole);
}

#[test]
fn every_cut_is_one_clear_error_and_huge_counts_allocate_nothing() {
    let (whole, _) = ply(&random_cloud(6, 3, 1));
    for cut in 0..whole.len() {
        let text = error(&whole[..cut]);
        assert!(text.ends_with("test.ply"), "{text}");
    }
    for count in ["4294967296", "18446744073709551615", "1000000000000"] {
        for format in ["binary_little_endian", "binary_big_endian", "ascii"] {
            let text = String::from_utf8(file(format, "", 7, &floats(&PLAIN), b"1 2 3")).unwrap();
            let whole = text.replace("vertex 7", &format!("vertex {count}"));
            let error = read_bytes(whole.as_bytes(), "huge.ply").unwrap_err();
            assert!(matches!(error, ReadError::Truncated { .. }), "{error}");
        }
    }
    let lists = "element face 18446744073709551615\nproperty list uchar double a\n";
    assert!(error(&file("binary_little_endian", lists, 0, &floats(&PLAIN), &[200; 64])).contains("face"));
    let nothing = "element empty 18446744073709551615\n";
    assert!(parse(&file("binary_little_endian", nothing, 0, &floats(&PLAIN), &[])).0.is_empty());
    assert!(parse(&file("ascii", nothing, 0, &floats(&PLAIN), &[])).0.is_empty());
}

#[test]
fn whatever_is_still_read_after_damage_is_written_back_bit_for_bit() {
    let words: [&[u8]; 8] =
        [b"18446744073709551615", b"-1", b"double", b"list uchar int", b"uchar", b"filter_3D", b"f_rest_0", b"big"];
    let (seed, _) = ply(&random_cloud(11, 40, 1));
    let mut r = Random(12);
    let mut read = 0;
    for _ in 0..20_000 {
        let mut damaged = seed.clone();
        for _ in 0..=r.below(2) {
            // Mostly the header, where damage changes the meaning of everything after it.
            let reach = if r.below(3) > 0 { 700 } else { damaged.len() };
            let at = r.below(reach.min(damaged.len()).max(1));
            let word = words[r.below(words.len())];
            match r.below(5) {
                0 if at < damaged.len() => damaged[at] = r.bits() as u8,
                1 => damaged.truncate(at),
                2 => drop(damaged.splice(at..at, word.iter().copied())),
                3 => drop(damaged.drain(at..(at + r.below(30)).min(damaged.len()))),
                _ => drop(damaged.splice(at..(at + word.len()).min(damaged.len()), word.iter().copied())),
            }
        }
        let Ok((cloud, _)) = read_bytes(&damaged, "damaged.ply") else { continue };
        assert!(ply(&cloud).0 == damaged, "{}", damaged[..damaged.len().min(900)].escape_ascii());
        let some = cloud.pick(&(0..cloud.len() as u32).rev().step_by(2).collect::<Vec<_>>());
        assert_eq!(parse(&ply(&some).0).0.content_hash(), some.content_hash());
        read += 1;
    }
    assert!(read > 1000, "only {read} damaged files were still read: the test is blunt");
}
