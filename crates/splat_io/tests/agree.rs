//! One capture in every format, written by other programs: what we read agrees with the reference within the bounds
//! measured for those programs (README of the captures), and what we write is within the quantisation of each format.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod common;

use common::{capture, random_cloud};
use splat_core::glam::{Quat, Vec3};
use splat_core::{Cloud, sh};
use splat_io::{FORMATS, WriteOptions, format_named, read_bytes, write_as};

/// Largest differences allowed to the reference.
#[derive(Clone, Copy)]
struct Bounds {
    position: f32,
    /// Of exp(scale).
    sigma: f32,
    /// Of the log scale where it is at least -9.
    log_sigma: f32,
    /// In degrees: the worst and the one that 99 in 100 keep.
    rotation: [f32; 2],
    alpha: f32,
    /// Of colours within 0..=1, and of all; `None` where the format clips.
    rgb: (f32, Option<f32>),
    /// Worst and root mean square over the coefficients; `None` without SH.
    sh: Option<[f32; 2]>,
    /// SH degree of the file.
    degree: u8,
}

/// What was found.
#[derive(Debug, Default)]
struct Differences {
    position: f32,
    sigma: f32,
    log_sigma: f32,
    rotation: [f32; 2],
    alpha: f32,
    rgb_in_gamut: f32,
    rgb: f32,
    sh: [f32; 2],
    compared: usize,
}

/// Smallest angle between two ellipsoids' axes over the four sign flips, in degrees.
fn angle(a: Quat, b: Quat) -> f32 {
    let flips = [
        Quat::IDENTITY,
        Quat::from_xyzw(1.0, 0.0, 0.0, 0.0),
        Quat::from_xyzw(0.0, 1.0, 0.0, 0.0),
        Quat::from_xyzw(0.0, 0.0, 1.0, 0.0),
    ];
    let unit = |q: Quat| q.as_dquat().normalize();
    // By the chord: the arc cosine has no digits left near zero.
    let chord = |f: &Quat| {
        let turned = unit(a) * f.as_dquat();
        (turned - unit(b)).length().min((turned + unit(b)).length())
    };
    let chord = flips.iter().map(chord).fold(f64::INFINITY, f64::min);
    (4.0 * (0.5 * chord).min(1.0).asin()).to_degrees() as f32
}

/// Partner of every Gaussian of `read` in `reference`: nearest in position, scale, opacity and colour; `None` where a
/// second one is nearly as near. Without `reordered` it is the one of the same id.
fn partners(reference: &Cloud, read: &Cloud, reordered: bool) -> Vec<Option<usize>> {
    if !reordered {
        return (0..read.len()).map(Some).collect();
    }
    const CELL: f32 = 0.004;
    let cell = |v: Vec3| (v / CELL).floor().as_ivec3().to_array();
    let mut grid: std::collections::HashMap<[i32; 3], Vec<usize>> = std::collections::HashMap::new();
    for i in 0..reference.len() {
        grid.entry(cell(reference.means()[i])).or_default().push(i);
    }
    let distance = |i: usize, j: usize| {
        let color = |c: &Cloud, i: usize| c.base_color(i).clamp(Vec3::ZERO, Vec3::ONE);
        (300.0 * (read.means()[i] - reference.means()[j])).length_squared()
            + (color(read, i) - color(reference, j)).length_squared()
            + (read.opacity(i) - reference.opacity(j)).powi(2)
            + (30.0 * (read.scale(i) - reference.scale(j))).length_squared()
    };
    (0..read.len())
        .map(|i| {
            let at = cell(read.means()[i]);
            let mut best = (f32::INFINITY, 0);
            let mut second = f32::INFINITY;
            for d in 0..27 {
                let near = [at[0] + d % 3 - 1, at[1] + d / 3 % 3 - 1, at[2] + d / 9 - 1];
                for &j in grid.get(&near).map_or(&[][..], Vec::as_slice) {
                    let d = distance(i, j);
                    if d < best.0 {
                        second = best.0;
                        best = (d, j);
                    } else {
                        second = second.min(d);
                    }
                }
            }
            (second > 16.0 * best.0 + 2e-4 && best.0.is_finite()).then_some(best.1)
        })
        .collect()
}

fn compare(reference: &Cloud, read: &Cloud, partners: &[Option<usize>]) -> Differences {
    let mut d = Differences::default();
    let mut angles = Vec::new();
    let (mut squares, mut count) = (0.0f64, 0.0f64);
    let coefficients = sh::coefficient_count(read.sh_degree().min(reference.sh_degree()));
    for (i, j) in partners.iter().enumerate().filter_map(|(i, j)| Some((i, (*j)?))) {
        let worst = |v: Vec3| v.abs().max_element();
        d.position = d.position.max(worst(read.means()[i] - reference.means()[j]));
        d.sigma = d.sigma.max(worst(read.scale(i) - reference.scale(j)));
        for axis in 0..3 {
            let stored = reference.log_scales()[j][axis];
            if stored >= -9.0 {
                d.log_sigma = d.log_sigma.max((read.log_scales()[i][axis] - stored).abs());
            }
        }
        angles.push(angle(read.rotation(i), reference.rotation(j)));
        d.alpha = d.alpha.max((read.opacity(i) - reference.opacity(j)).abs());
        let (a, b) = (read.base_color(i), reference.base_color(j));
        for channel in 0..3 {
            let difference = (a[channel] - b[channel]).abs();
            d.rgb = d.rgb.max(difference);
            if (0.0..=1.0).contains(&b[channel]) {
                d.rgb_in_gamut = d.rgb_in_gamut.max(difference);
            }
        }
        for (a, b) in read.sh_of(i)[3..3 * coefficients].iter().zip(&reference.sh_of(j)[3..3 * coefficients]) {
            d.sh[0] = d.sh[0].max((a - b).abs());
            squares += f64::from(a - b).powi(2);
            count += 1.0;
        }
        d.compared += 1;
    }
    angles.sort_by(f32::total_cmp);
    d.rotation = [*angles.last().unwrap_or(&0.0), angles.get(angles.len() * 99 / 100).copied().unwrap_or(0.0)];
    d.sh[1] = (squares / count.max(1.0)).sqrt() as f32;
    d
}

fn check(name: &str, reference: &Cloud, read: &Cloud, reordered: bool, bounds: &Bounds) {
    assert_eq!((read.len(), read.sh_degree()), (reference.len(), bounds.degree), "{name}");
    let partners = partners(reference, read, reordered);
    let d = compare(reference, read, &partners);
    assert!(d.compared * 100 >= reference.len() * 99, "{name}: only {} Gaussians found again", d.compared);
    let pairs = [
        ("position", d.position, bounds.position),
        ("sigma", d.sigma, bounds.sigma),
        ("log sigma", d.log_sigma, bounds.log_sigma),
        ("rotation", d.rotation[0], bounds.rotation[0]),
        ("rotation of 99 in 100", d.rotation[1], bounds.rotation[1]),
        ("alpha", d.alpha, bounds.alpha),
        ("colour", d.rgb_in_gamut, bounds.rgb.0),
        ("all colours", d.rgb, bounds.rgb.1.unwrap_or(f32::INFINITY)),
        ("SH", d.sh[0], bounds.sh.map_or(0.0, |b| b[0])),
        ("mean square of SH", d.sh[1], bounds.sh.map_or(0.0, |b| b[1])),
    ];
    for (what, found, allowed) in pairs {
        // The table is rounded up, our arithmetic is in 32 bits.
        assert!(found <= allowed * 1.02 + 2e-6, "{name}: {what} differs by {found}, {allowed} is allowed ({d:?})");
    }
}

/// Rows of the table in the captures' README: file, whether its order changed, bounds.
fn table() -> Vec<(&'static str, bool, Bounds)> {
    let exact = Bounds {
        position: 0.0,
        sigma: 1e-7,
        log_sigma: 2e-6,
        rotation: [0.002, 0.001],
        alpha: 1e-6,
        rgb: (1e-6, Some(4e-6)),
        sh: Some([1e-6, 1e-6]),
        degree: 3,
    };
    let spz = Bounds {
        position: 1.3e-4,
        sigma: 0.0027,
        log_sigma: 0.0313,
        rotation: [0.21, 0.17],
        alpha: 0.0020,
        rgb: (0.0037, None),
        sh: Some([0.555, 0.0324]),
        degree: 3,
    };
    let ksplat = Bounds {
        position: 4e-5,
        sigma: 5e-5,
        log_sigma: 0.001,
        rotation: [0.06, 0.05],
        alpha: 0.0040,
        rgb: (0.0040, None),
        sh: Some([9e-4, 9e-5]),
        degree: 2,
    };
    vec![
        ("sample.ply", false, Bounds { log_sigma: 0.0, rgb: (0.0, Some(0.0)), ..exact }),
        ("sample.khr.glb", false, exact),
        (
            "sample.compressed.ply",
            true,
            Bounds {
                position: 2.4e-4,
                sigma: 4.2e-4,
                log_sigma: 0.0080,
                rotation: [0.25, 0.15],
                alpha: 2e-6,
                rgb: (0.0054, Some(0.0054)),
                sh: Some([0.0157, 0.0070]),
                degree: 3,
            },
        ),
        (
            "sample.splat",
            false,
            Bounds {
                log_sigma: 1e-5,
                rotation: [0.85, 0.72],
                alpha: 0.0040,
                rgb: (0.0040, None),
                sh: None,
                degree: 0,
                ..exact
            },
        ),
        ("sample_v2_rdf.spz", false, Bounds { rotation: [10.4, 2.3], ..spz }),
        ("sample_v3.spz", false, spz),
        ("sample_v4.spz", false, spz),
        (
            "sample_v2.sog",
            true,
            Bounds {
                position: 1.7e-5,
                sigma: 7e-4,
                log_sigma: 0.033,
                rotation: [0.45, 0.05],
                // Its writer cut the one opacity of 1 - 1e-6 down to 254 / 255; all others are exact.
                alpha: 0.0040,
                rgb: (0.0060, Some(0.0095)),
                sh: Some([0.0077, 0.0014]),
                degree: 3,
            },
        ),
        (
            "sample_sog_v2_dir",
            true,
            Bounds {
                position: 1.7e-5,
                sigma: 1e-6,
                log_sigma: 1e-4,
                rotation: [2.0, 1.4],
                alpha: 0.0040,
                rgb: (0.0011, Some(0.0128)),
                sh: Some([0.532, 0.0225]),
                degree: 3,
            },
        ),
        (
            "sample_sog_v1_dir",
            false,
            Bounds {
                position: 1e-5,
                sigma: 0.0022,
                log_sigma: 0.034,
                rotation: [0.45, 0.05],
                alpha: 0.0084,
                rgb: (0.0058, Some(0.0058)),
                sh: None,
                degree: 0,
            },
        ),
        ("sample_l1_sh2.ksplat", true, ksplat),
        ("sample_l2_sh2.ksplat", true, Bounds { sh: Some([0.0100, 0.0060]), ..ksplat }),
    ]
}

/// The cloud turned by 180 degrees about an axis, by the signs of coordinates (as the formats' axes differ).
fn turned(cloud: &Cloud, signs: Vec3) -> Cloud {
    let mut arrays = cloud.clone().into_arrays();
    let around = Quat::from_vec4(
        if signs.x > 0.0 {
            Vec3::X
        } else if signs.y > 0.0 {
            Vec3::Y
        } else {
            Vec3::Z
        }
        .extend(0.0),
    );
    for mean in &mut arrays.means {
        *mean *= signs;
    }
    for rotation in &mut arrays.rotations {
        *rotation = around * *rotation;
    }
    // Harmonics of a turned direction: each keeps its value or changes its sign, found by trying one direction.
    let direction = Vec3::new(0.36, 0.48, 0.8);
    let (mut before, mut after) = ([0.0; 25], [0.0; 25]);
    sh::basis(arrays.sh_degree, direction, &mut before);
    sh::basis(arrays.sh_degree, direction * signs, &mut after);
    let stride = 3 * sh::coefficient_count(arrays.sh_degree);
    for (i, value) in arrays.sh.iter_mut().enumerate() {
        let k = i % stride / 3;
        *value *= (after[k] / before[k]).round();
    }
    Cloud::new(arrays).unwrap()
}

#[test]
fn files_of_other_programs_agree_with_the_reference() {
    let Some(folder) = capture("formats") else { return };
    let (reference, _) = splat_io::read(folder.join("sample.ply")).unwrap();
    let mut formats = std::collections::BTreeSet::new();
    for (file, reordered, bounds) in table() {
        let known = if file.ends_with("dir") { "sog" } else { file.rsplit('.').next().unwrap() };
        if format_named(known).is_none() {
            continue;
        }
        let (read, report) = match splat_io::read(folder.join(file)) {
            Ok(read) => read,
            Err(error) => panic!("{file}: {error}"),
        };
        // Some formats have axes of their own, and one file was written without turning the data (see its README).
        let signs = match read.source().axes.as_str() {
            "RUB" => Vec3::new(1.0, -1.0, -1.0),
            "LUF" => Vec3::new(-1.0, -1.0, 1.0),
            _ => Vec3::ONE,
        };
        let read = if signs == Vec3::ONE { read } else { turned(&read, signs) };
        let read = if file == "sample_v2_rdf.spz" { turned(&read, Vec3::new(1.0, -1.0, -1.0)) } else { read };
        check(file, &reference, &read, reordered, &bounds);
        formats.insert(report.format);
    }
    let known: std::collections::BTreeSet<_> = FORMATS.iter().map(|f| f.name()).collect();
    assert_eq!(formats, known, "a format without a file to check it with");
}

/// What a format may change in a cloud of `random_cloud`.
fn quantisation(format: &str) -> Bounds {
    let exact = Bounds {
        position: 0.0,
        sigma: 1e-6,
        log_sigma: 4e-6,
        rotation: [0.002, 0.001],
        alpha: 1e-6,
        rgb: (1e-6, Some(1e-6)),
        sh: Some([0.0, 0.0]),
        degree: 3,
    };
    let byte = 0.5 / 255.0;
    match format {
        "ply" | "gltf" | "glb" => exact,
        // Chunks of 256 random Gaussians span much of the cloud: its extent over 2046 and 1023 steps.
        "compressed-ply" => Bounds {
            position: 0.005,
            sigma: 0.0013,
            log_sigma: 0.0035,
            rotation: [0.2, 0.17],
            alpha: byte,
            rgb: (byte, Some(byte)),
            sh: Some([8.0 / 512.0, 0.01]),
            ..exact
        },
        "splat" => Bounds { rotation: [0.9, 0.9], alpha: byte, rgb: (byte, Some(byte)), sh: None, degree: 0, ..exact },
        // Steps of SPZ: 1/4096 (or finer), 1/16, and 8 or 16 of 128 for SH.
        "spz" => Bounds {
            position: 0.5 / 4096.0,
            sigma: 0.012,
            log_sigma: 0.5 / 16.0,
            rotation: [0.25, 0.2],
            alpha: byte,
            rgb: (0.5 / 255.0 / 0.15 * sh::C0, None),
            sh: Some([0.5 * 16.0 / 128.0, 0.04]),
            ..exact
        },
        // Codebooks and palettes depend on the data; these are loose.
        "sog" => Bounds {
            position: 2e-4,
            sigma: 0.01,
            log_sigma: 0.05,
            // Three bytes for the smaller components: 2 * 2 * sqrt(3) * 0.5 / 127.5 / sqrt(2) at worst.
            rotation: [1.1, 0.8],
            alpha: byte,
            rgb: (0.02, Some(0.05)),
            sh: Some([1.2, 0.3]),
            ..exact
        },
        other => panic!("add the quantisation of `{other}`"),
    }
}

#[test]
fn every_writable_format_gives_back_what_it_was_given_within_its_quantisation() {
    for format in FORMATS.iter().filter(|f| f.writable()) {
        for (seed, count) in [(1, 1), (2, 3), (3, 257), (4, 3000)] {
            let cloud = random_cloud(seed, count, 3);
            let mut file = Vec::new();
            let options = WriteOptions::default();
            let written = write_as(*format, &cloud, &options, &mut file).unwrap();
            assert_eq!(written.bytes, file.len() as u64, "{}", format.name());
            let name = format!("random.{}", format.extensions()[0]);
            let (read, report) = read_bytes(&file, &name).unwrap();
            assert_eq!(report.format, format.name());
            // Names help only between candidates: the content alone must do.
            assert_eq!(read_bytes(&file, "no ending").unwrap().1.format, format.name());
            let expected = written.order.as_ref().map_or_else(|| cloud.clone(), |order| cloud.pick(order));
            if let Some(order) = &written.order {
                let mut ids = order.clone();
                ids.sort_unstable();
                assert!(ids.iter().enumerate().all(|(i, &id)| i == id as usize), "{}: ids are lost", format.name());
            }
            check(format.name(), &expected, &read, false, &quantisation(format.name()));
            if !format.lossy() {
                assert_eq!(expected.means(), read.means());
            }
            let mut again = Vec::new();
            write_as(*format, &cloud, &options, &mut again).unwrap();
            assert!(file == again, "{}: a second run wrote other bytes", format.name());
        }
    }
}

#[test]
fn losses_are_told() {
    let mut arrays = random_cloud(7, 50, 3).into_arrays();
    arrays.means[4].x = f32::NAN;
    let cloud = Cloud::new(arrays).unwrap();
    for name in ["splat", "compressed-ply"] {
        let mut file = Vec::new();
        let written = write_as(format_named(name).unwrap(), &cloud, &WriteOptions::default(), &mut file).unwrap();
        assert!(written.losses.iter().any(|l| l.contains("1 Gaussians with NaN")), "{:?}", written.losses);
        let (read, report) = read_bytes(&file, name).unwrap();
        let at = written.order.map_or(4, |order| order.iter().position(|&id| id == 4).unwrap());
        assert!(read.opacity(at) < 1e-5 && report.not_finite == 0);
    }
}

#[test]
fn every_cut_of_every_format_is_one_clear_error_or_a_shorter_cloud() {
    for format in FORMATS.iter().filter(|f| f.writable()) {
        let mut file = Vec::new();
        write_as(*format, &random_cloud(5, 20, 1), &WriteOptions::default(), &mut file).unwrap();
        for cut in 0..file.len() {
            match read_bytes(&file[..cut], "cut") {
                // Records without a header cannot tell; everything else must.
                Ok((cloud, _)) => assert!(format.name() == "splat" && cloud.len() < 20, "{} at {cut}", format.name()),
                Err(error) => assert!(error.to_string().contains("cut"), "{error}"),
            }
        }
    }
}
