//! SPZ in detail: versions, axes, extensions, ranges. Files are put together here byte by byte, from the format's description.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod common;

use common::random_cloud;
use splat_core::glam::{Mat3, Quat, Vec3};
use splat_core::{Cloud, CloudArrays, sh};
use splat_io::{ReadReport, WriteOptions, format_named, read_bytes, write_as};

fn gzip(inner: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    let mut encoder = flate2::bufread::GzEncoder::new(inner, flate2::Compression::fast());
    std::io::Read::read_to_end(&mut encoder, &mut out).unwrap();
    out
}

fn header(version: u32, count: u32, degree: u8, flags: u8) -> Vec<u8> {
    let mut out = b"NGSP".to_vec();
    out.extend(version.to_le_bytes());
    out.extend(count.to_le_bytes());
    out.extend([degree, 12, flags, 0]);
    out
}

fn write(cloud: &Cloud, version: Option<u32>) -> (Vec<u8>, Vec<String>) {
    let mut options = WriteOptions::default();
    options.version = version;
    let mut file = Vec::new();
    let written = write_as(format_named("spz").unwrap(), cloud, &options, &mut file).unwrap();
    (file, written.losses)
}

fn read(file: &[u8]) -> (Cloud, ReadReport) {
    read_bytes(file, "test.spz").unwrap()
}

#[test]
fn version_1_has_half_floats() {
    let mut inner = header(1, 1, 0, 1);
    for bits in [0x3c00u16, 0xc000, 0x3800] {
        inner.extend(bits.to_le_bytes()); // 1, -2, 0.5
    }
    inner.extend([255, 0, 128, 255, 160, 0, 255]); // opacity, colour, scales
    inner.extend([128, 255, 128]); // a half turn about y
    let (cloud, report) = read(&gzip(&inner));
    assert_eq!(cloud.means(), [Vec3::new(1.0, 2.0, -0.5)]);
    assert_eq!(cloud.log_scales(), [Vec3::new(0.0, -10.0, 5.9375)]);
    assert!(cloud.opacity(0) > 0.999 && cloud.source().antialiased && report.notes[0].contains("RUB"));
    assert!((cloud.sh()[0] + 3.3333).abs() < 1e-3 && (cloud.sh()[2] - 3.3333).abs() < 1e-3);
    assert!(cloud.rotation(0).y.abs() > 0.999);
    assert_eq!(cloud.source().axes, "RDF");
}

#[test]
fn all_versions_hold_the_same_capture() {
    let cloud = random_cloud(3, 500, 3);
    let (third, _) = read(&write(&cloud, None).0);
    assert_eq!(write(&cloud, None), write(&cloud, Some(3)));
    let (fourth, _) = read(&write(&cloud, Some(4)).0);
    assert_eq!(third, fourth);
    let (second, _) = read(&write(&cloud, Some(2)).0);
    assert_eq!((second.means(), second.sh()), (third.means(), third.sh()));
    for i in 0..cloud.len() {
        let along = second.rotation(i).dot(cloud.rotation(i)).abs();
        assert!(along > 0.995, "rotation {i}: {along}");
    }
    let mut sink = Vec::new();
    let mut options = WriteOptions::default();
    options.version = Some(5);
    assert!(write_as(format_named("spz").unwrap(), &cloud, &options, &mut sink).is_err());
}

#[test]
fn flags_and_the_fourth_degree_are_kept_where_the_version_can() {
    let mut arrays = random_cloud(4, 20, 4).into_arrays();
    arrays.source.antialiased = true;
    let cloud = Cloud::new(arrays).unwrap();
    let (file, losses) = write(&cloud, Some(4));
    let (read_back, _) = read(&file);
    assert!(losses.is_empty(), "{losses:?}");
    assert!(read_back.source().antialiased && read_back.sh_degree() == 4);
    for (a, b) in cloud.sh().chunks_exact(75).zip(read_back.sh().chunks_exact(75)) {
        for (a, b) in a[3..].iter().zip(&b[3..]) {
            assert!((a - b).abs() <= 0.0626, "{a} became {b}");
        }
    }
    let (file, losses) = write(&cloud, None);
    assert_eq!(read(&file).0.sh_degree(), 3);
    assert!(losses.iter().any(|l| l.contains("above degree 3")), "{losses:?}");
}

#[test]
fn large_and_small_captures_keep_their_positions() {
    for (size, step) in [(1e-3f32, 7e-7), (1.0, 1.3e-4), (4000.0, 3e-4), (5e6, 0.6)] {
        let mut arrays = random_cloud(5, 300, 0).into_arrays();
        for (mean, scale) in arrays.means.iter_mut().zip(&mut arrays.log_scales) {
            *mean *= size / 5.0;
            *scale += size.ln();
        }
        let cloud = Cloud::new(arrays).unwrap();
        let (read_back, _) = read(&write(&cloud, None).0);
        for (a, b) in cloud.means().iter().zip(read_back.means()) {
            assert!((*a - *b).abs().max_element() <= step, "{a} became {b} in a capture of {size}");
        }
    }
    let mut arrays = random_cloud(5, 2, 0).into_arrays();
    arrays.means[1].y = 1e7;
    let mut sink = Vec::new();
    let cloud = Cloud::new(arrays).unwrap();
    let error = write_as(format_named("spz").unwrap(), &cloud, &WriteOptions::default(), &mut sink).unwrap_err();
    assert!(error.to_string().contains("scale the capture down"), "{error}");
}

/// A file of one Gaussian whose record of extensions names the axes.
fn with_axes(system: u32, version: u32) -> Vec<u8> {
    let (count, degree) = (1, 1);
    let mut arrays: [Vec<u8>; 6] = Default::default();
    for v in [1.0f32, 2.0, 3.0] {
        arrays[0].extend(&((v * 4096.0) as i32).to_le_bytes()[..3]);
    }
    arrays[1] = vec![200];
    arrays[2] = vec![10, 20, 30];
    arrays[3] = vec![100, 110, 120];
    // w is largest; 0.3, -0.2, 0.1 for the rest.
    let part = |v: f32| (v.abs() * 511.0 * 2f32.sqrt()).round() as u32 | if v < 0.0 { 512 } else { 0 };
    arrays[4] = (3 << 30 | part(0.3) << 20 | part(-0.2) << 10 | part(0.1)).to_le_bytes().to_vec();
    arrays[5] = vec![160, 150, 140, 100, 90, 80, 200, 210, 220];
    let mut extension = 0xadbe_0003u32.to_le_bytes().to_vec();
    extension.extend(4u32.to_le_bytes());
    extension.extend(system.to_le_bytes());
    extension.extend(0x1234_5678u32.to_le_bytes());
    extension.extend(3u32.to_le_bytes());
    extension.extend([1, 2, 3]);
    let mut file = header(version, count, degree, 2);
    if version < 4 {
        file.extend(arrays.concat());
        file.extend(extension);
        return gzip(&file);
    }
    file[15] = 6;
    file.extend((32 + extension.len() as u32).to_le_bytes());
    file.resize(32, 0);
    file.extend(extension);
    let streams: Vec<Vec<u8>> = arrays.iter().map(|a| zstd::bulk::compress(a, 1).unwrap()).collect();
    for (array, stream) in arrays.iter().zip(&streams) {
        file.extend((stream.len() as u64).to_le_bytes());
        file.extend((array.len() as u64).to_le_bytes());
    }
    file.extend(streams.concat());
    file
}

#[test]
fn the_axes_that_a_file_names_are_turned_to_right_down_forward() {
    // Number, and what right, down and forward are in the file's coordinates.
    let systems: [(u32, [Vec3; 3]); 5] = [
        (4, [Vec3::X, Vec3::NEG_Y, Vec3::NEG_Z]),
        (6, [Vec3::X, Vec3::Y, Vec3::Z]),
        (7, [Vec3::NEG_X, Vec3::NEG_Y, Vec3::Z]),
        (1, [Vec3::NEG_X, Vec3::Y, Vec3::NEG_Z]),
        (16, [Vec3::X, Vec3::NEG_Z, Vec3::Y]),
    ];
    let (plain, _) = read(&with_axes(6, 3));
    assert_eq!(plain.means(), [Vec3::new(1.0, 2.0, 3.0)]);
    for (system, [right, down, forward]) in systems {
        let m = Mat3::from_cols(right, down, forward).transpose();
        let (cloud, report) = read(&with_axes(system, 3));
        assert!(report.notes.iter().any(|n| n.contains("0x12345678")), "{:?}", report.notes);
        assert!(cloud.means()[0].abs_diff_eq(m * plain.means()[0], 1e-5), "system {system}");
        assert!(cloud.covariance(0).abs_diff_eq(m * plain.covariance(0) * m.transpose(), 1e-5), "system {system}");
        let direction = Vec3::new(0.36, -0.48, 0.8);
        let seen = sh::color(1, cloud.sh_of(0), m * direction);
        assert!(seen.abs_diff_eq(sh::color(1, plain.sh_of(0), direction), 1e-5), "system {system}");
        assert_eq!(read(&with_axes(system, 4)).0, cloud);
    }
    assert!(read_bytes(&with_axes(17, 3), "x").is_err());
}

#[test]
fn values_that_cannot_be_held_are_clipped_and_told() {
    let arrays = CloudArrays {
        means: vec![Vec3::ZERO; 3],
        log_scales: vec![Vec3::splat(-20.0), Vec3::splat(9.0), Vec3::ZERO],
        rotations: vec![Quat::IDENTITY, Quat::from_xyzw(0.0, 0.0, 0.0, 0.0), Quat::IDENTITY],
        opacity_logits: vec![f32::INFINITY, f32::NEG_INFINITY, 0.0],
        sh_degree: 1,
        sh: (0..36)
            .map(|i| {
                if i == 0 {
                    9.0
                } else if i == 20 {
                    -7.0
                } else {
                    0.0
                }
            })
            .collect(),
        ..CloudArrays::default()
    };
    let (file, losses) = write(&Cloud::new(arrays).unwrap(), None);
    assert_eq!(losses.len(), 3, "{losses:?}");
    let (cloud, _) = read(&file);
    assert_eq!(cloud.log_scales()[0], Vec3::splat(-10.0));
    assert_eq!(cloud.log_scales()[1], Vec3::splat(5.9375));
    assert!(cloud.opacity(0) > 0.99999 && cloud.opacity(1) < 1e-5);
    assert_eq!(cloud.sh()[20], -127.0 / 128.0, "this coefficient is stored with the other sign");
}

#[test]
fn bytes_behind_the_end_are_counted() {
    let cloud = random_cloud(6, 10, 1);
    for version in [3, 4] {
        let (mut file, _) = write(&cloud, Some(version));
        file.extend(b"more");
        let (read_back, report) = read(&file);
        assert_eq!((read_back.len(), report.trailing_bytes), (10, 4));
    }
    let empty = Cloud::default();
    for version in [2, 3, 4] {
        assert!(read(&write(&empty, Some(version)).0).0.is_empty());
    }
}
