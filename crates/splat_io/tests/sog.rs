//! SOG in detail: archives and folders, both versions, palettes, and what is refused. And `.ksplat` at level 0, which no
//! capture at hand has.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod common;

use common::{Random, random_cloud};
use serde_json::{Value, json};
use splat_core::glam::Vec3;
use splat_core::{Cloud, sh};
use splat_io::{InMemory, SourceName, WriteOptions, format_named, read_bytes, read_with, write_as};

fn archive(cloud: &Cloud) -> (Vec<u8>, Vec<u32>, Vec<String>) {
    let mut file = Vec::new();
    let written = write_as(format_named("sog").unwrap(), cloud, &WriteOptions::default(), &mut file).unwrap();
    (file, written.order.unwrap(), written.losses)
}

/// Entries of a stored archive, by its local headers.
fn unpack(archive: &[u8]) -> InMemory {
    let mut files = InMemory::default();
    let mut rest = archive;
    while rest.starts_with(b"PK\x03\x04") {
        let size = u32::from_le_bytes(rest[18..22].try_into().unwrap()) as usize;
        let name = usize::from(u16::from_le_bytes(rest[26..28].try_into().unwrap()));
        let body = 30 + name;
        let key = String::from_utf8(rest[30..body].to_vec()).unwrap();
        files.files.insert(key, rest[body..body + size].to_vec());
        rest = &rest[body + size..];
    }
    files
}

/// A deflated archive of the files, in a folder inside.
fn deflated(files: &InMemory) -> Vec<u8> {
    let (mut out, mut directory) = (Vec::new(), Vec::new());
    for (name, data) in &files.files {
        let name = format!("folder/{name}");
        let mut packed = Vec::new();
        let mut encoder = flate2::bufread::DeflateEncoder::new(&data[..], flate2::Compression::fast());
        std::io::Read::read_to_end(&mut encoder, &mut packed).unwrap();
        let mut crc = flate2::Crc::new();
        crc.update(data);
        let mut common = vec![20, 0, 0, 0, 8, 0, 0, 0, 0, 0];
        common.extend(crc.sum().to_le_bytes());
        common.extend((packed.len() as u32).to_le_bytes());
        common.extend((data.len() as u32).to_le_bytes());
        common.extend((name.len() as u16).to_le_bytes());
        common.extend([0, 0]);
        directory.extend(b"PK\x01\x02\x14\0");
        directory.extend(&common);
        directory.extend([0; 10]);
        directory.extend((out.len() as u32).to_le_bytes());
        directory.extend(name.as_bytes());
        out.extend(b"PK\x03\x04");
        out.extend(&common);
        out.extend(name.as_bytes());
        out.extend(packed);
    }
    let at = out.len() as u32;
    out.extend(&directory);
    out.extend(b"PK\x05\x06\0\0\0\0");
    out.extend([files.files.len() as u8, 0, files.files.len() as u8, 0]);
    out.extend((directory.len() as u32).to_le_bytes());
    out.extend(at.to_le_bytes());
    out.extend([0, 0]);
    out
}

#[test]
fn archives_stored_or_deflated_and_folders_hold_the_same() {
    for degree in 0..=3 {
        let (file, order, losses) = archive(&random_cloud(21, 700, degree));
        assert!(losses.is_empty(), "{losses:?}");
        let (stored, _) = read_bytes(&file, "a.sog").unwrap();
        assert_eq!((stored.len(), stored.sh_degree(), order.len()), (700, degree, 700));
        let mut files = unpack(&file);
        let total: usize = files.files.values().map(Vec::len).sum();
        assert_eq!(read_bytes(&deflated(&files), "b.sog").unwrap().0, stored);
        let meta = files.files.remove("meta.json").unwrap();
        let (beside, report) = read_with(&meta, &SourceName::from("meta.json"), &files).unwrap();
        assert_eq!((beside, report.bytes), (stored, total as u64));
    }
}

#[test]
fn version_1_is_linear_between_its_bounds() {
    let cloud = random_cloud(22, 300, 1);
    let (file, _, _) = archive(&cloud);
    let (second, _) = read_bytes(&file, "a.sog").unwrap();
    let mut files = unpack(&file);
    let mut meta: Value = serde_json::from_slice(&files.files.remove("meta.json").unwrap()).unwrap();
    // The same pictures, read with lines instead of codebooks.
    let line = |mins: &[f32], maxs: &[f32], files: &Value| json!({"mins": mins, "maxs": maxs, "files": files});
    let rest = meta["shN"]["files"].clone();
    meta["scales"] = line(&[-9.0, -8.0, -7.0], &[0.0, 0.5, 1.0], &meta["scales"]["files"].clone());
    meta["sh0"] = line(&[-2.0, -2.0, -2.0, -6.0], &[2.0, 2.0, 2.0, 6.0], &meta["sh0"]["files"].clone());
    meta["shN"] = json!({"mins": -0.5, "maxs": 0.5, "files": rest});
    meta["means"]["shape"] = json!([300, 3]);
    let object = meta.as_object_mut().unwrap();
    object.remove("version");
    object.remove("count");
    let (first, _) = read_with(&serde_json::to_vec(&meta).unwrap(), &SourceName::from("meta.json"), &files).unwrap();
    assert_eq!((first.means(), first.rotations()), (second.means(), second.rotations()));
    assert_eq!(first.sh_degree(), 1);
    for i in 0..300 {
        // Codebooks rise, so that the order of any two values is the same in both readings.
        let j = (i * 7 + 1) % 300;
        let rises = |a: &Cloud| a.sh_of(i)[7] < a.sh_of(j)[7];
        assert!(!rises(&second) || first.sh_of(i)[7] < first.sh_of(j)[7]);
        assert!((-9.0..=0.0).contains(&first.log_scales()[i].x) && (-6.0..=6.0).contains(&first.opacity_logits()[i]));
        let alpha = second.opacity(i) * 12.0 - 6.0;
        assert!((first.opacity_logits()[i] - alpha).abs() < 1e-3);
    }
}

#[test]
fn a_written_file_written_again_stays_as_it_is() {
    let (file, _, _) = archive(&random_cloud(23, 900, 2));
    let (once, _) = read_bytes(&file, "a.sog").unwrap();
    let (again, order, _) = archive(&once);
    let (twice, _) = read_bytes(&again, "a.sog").unwrap();
    let expected = once.pick(&order);
    assert_eq!((twice.log_scales(), twice.sh()), (expected.log_scales(), expected.sh()));
    for i in 0..twice.len() {
        assert!((twice.means()[i] - expected.means()[i]).abs().max_element() < 1e-5);
        assert!((twice.opacity(i) - expected.opacity(i)).abs() < 1e-5);
        assert!(twice.rotation(i).dot(expected.rotation(i)).abs() > 0.99999);
    }
}

#[test]
fn harmonics_that_are_all_zero_take_no_palette() {
    let mut arrays = random_cloud(24, 100, 3).into_arrays();
    for values in arrays.sh.chunks_exact_mut(48) {
        values[3..].fill(0.0);
    }
    let (file, _, _) = archive(&Cloud::new(arrays).unwrap());
    assert_eq!(read_bytes(&file, "a.sog").unwrap().0.sh_degree(), 0);
    let (file, order, _) = archive(&Cloud::default());
    assert!(read_bytes(&file, "a.sog").unwrap().0.is_empty() && order.is_empty());
}

#[test]
fn other_archives_and_streamed_captures_are_named() {
    let text = |bytes: &[u8]| read_bytes(bytes, "x.zip").unwrap_err().to_string();
    let mut files = InMemory::default();
    files.files.insert("readme.txt".to_owned(), b"hello".to_vec());
    assert!(text(&deflated(&files)).contains("without `meta.json`"));
    files.files.insert("lod-meta.json".to_owned(), b"{}".to_vec());
    assert!(text(&deflated(&files)).contains("lod-meta.json"));
    let streamed = br#"{"lodLevels": 2, "filenames": ["0_0/meta.json"], "tree": {}}"#;
    assert!(text(streamed).contains("lod-meta.json"));
    let (file, _, _) = archive(&random_cloud(25, 10, 0));
    let mut files = unpack(&file);
    let mut meta: Value = serde_json::from_slice(&files.files["meta.json"]).unwrap();
    meta["version"] = json!(3);
    files.files.insert("meta.json".to_owned(), serde_json::to_vec(&meta).unwrap());
    assert!(text(&deflated(&files)).contains("SOG version 3"));
}

#[test]
fn ksplat_sections_of_level_0_may_have_different_degrees() {
    let mut random = Random(9);
    let counts = [3usize, 2];
    let degrees = [1u8, 2];
    let mut file = vec![0u8; 4096 + 3 * 1024];
    file[1] = 1;
    let mut put = |at: usize, value: u32| file[at..at + 4].copy_from_slice(&value.to_le_bytes());
    for (at, value) in [(4, 3), (8, 2), (12, 6), (16, 5), (20, 0)] {
        put(at, value);
    }
    for (section, (count, degree)) in counts.iter().zip(degrees).enumerate() {
        // Room for one more than there are.
        for (at, value) in [(0, *count as u32), (4, *count as u32 + 1), (8, 256), (40, u32::from(degree))] {
            put(4096 + 1024 * section + at, value);
        }
    }
    let mut values: Vec<Vec<f32>> = Vec::new();
    for (count, degree) in counts.iter().zip(degrees) {
        let rest = 3 * (sh::coefficient_count(degree) - 1);
        for _ in 0..*count {
            let record: Vec<f32> = (0..10 + rest).map(|_| random.between(0.1, 2.0)).collect();
            file.extend(record[..10].iter().flat_map(|v| v.to_le_bytes()));
            file.extend([255, 0, 51, 102]);
            file.extend(record[10..].iter().flat_map(|v| v.to_le_bytes()));
            values.push(record);
        }
        file.resize(file.len() + 44 + 4 * rest, 0);
    }
    let (cloud, report) = read_bytes(&file, "x.ksplat").unwrap();
    assert_eq!((report.format, cloud.len(), cloud.sh_degree()), ("ksplat", 5, 2));
    for (i, v) in values.iter().enumerate() {
        assert_eq!(cloud.means()[i], Vec3::new(v[0], v[1], v[2]));
        assert!(cloud.scale(i).abs_diff_eq(Vec3::new(v[3], v[4], v[5]), 1e-5));
        let q = cloud.rotations()[i];
        assert_eq!([q.w, q.x, q.y, q.z], [v[6], v[7], v[8], v[9]]);
        assert!((cloud.opacity(i) - 0.4).abs() < 1e-5 && (cloud.base_color(i).z - 0.2).abs() < 1e-5);
        // Band 1: three of red, three of green, three of blue.
        let sh = cloud.sh_of(i);
        assert_eq!([sh[3], sh[6], sh[4], sh[11]], [v[10], v[11], v[13], v[18]]);
        let second = if i < 3 { 0.0 } else { v[10 + 9 + 5] };
        assert_eq!(sh[3 * 4 + 1], second, "the first green of band 2");
    }
}
