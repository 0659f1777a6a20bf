use glam::{DVec3, Quat, Vec3};
use splat_core::{Cloud, CloudArrays};

use super::{Solid, SolidError, SolidSettings};
use crate::Material;

/// Numbers that look random, 0..1.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((self.0 >> 11) as f64) / (1u64 << 53) as f64
    }

    fn direction(&mut self) -> DVec3 {
        loop {
            let v = DVec3::new(self.next(), self.next(), self.next()) * 2.0 - 1.0;
            if (1e-3..1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    }
}

/// Flat Gaussians on a surface: places, normals and sizes.
#[derive(Default)]
struct Shell(Vec<(DVec3, DVec3, f64)>);

impl Shell {
    fn cloud(&self) -> Cloud {
        let mut noise = Noise(7);
        let mut arrays = CloudArrays::default();
        for &(place, normal, size) in &self.0 {
            arrays.means.push(place.as_vec3());
            let spread = (0.012 + 0.01 * noise.next()) / 0.017 * size;
            arrays.log_scales.push(Vec3::new(spread.ln() as f32, spread.ln() as f32, (0.1 * size).ln() as f32));
            arrays.rotations.push(Quat::from_rotation_arc(Vec3::Z, normal.as_vec3()));
            let opacity = 0.3 + 0.65 * noise.next();
            arrays.opacity_logits.push((opacity / (1.0 - opacity)).ln() as f32);
            arrays.sh.extend([0.0; 3]);
        }
        Cloud::new(arrays).unwrap()
    }

    fn sphere(count: usize) -> Self {
        let mut noise = Noise(1);
        let each = |_| {
            let d = noise.direction();
            (d * (0.5 + 0.004 * (noise.next() - 0.5)), d, 0.017)
        };
        Self((0..count).map(each).collect())
    }

    /// A box with its least corner at the origin; `sides` of its six faces, -x, x, -y, y, -z, z.
    fn cuboid(size: DVec3, sides: [bool; 6], count: usize) -> Self {
        let mut noise = Noise(3);
        let mut out = Vec::new();
        for face in (0..6).filter(|&f| sides[f]) {
            let axis = face / 2;
            for _ in 0..count {
                let mut place = DVec3::new(noise.next(), noise.next(), noise.next()) * size;
                place[axis] = if face % 2 == 0 { 0.0 } else { size[axis] };
                out.push((place, DVec3::AXES[axis], 0.017));
            }
        }
        Self(out)
    }

    fn with_floaters(mut self, share: f64, half: f64) -> Self {
        let mut noise = Noise(5);
        for _ in 0..(self.0.len() as f64 * share) as usize {
            let place = (DVec3::new(noise.next(), noise.next(), noise.next()) - 0.5) * 2.0 * half;
            self.0.push((place, noise.direction(), 0.017));
        }
        self
    }
}

fn build(cloud: &Cloud, settings: &SolidSettings) -> Result<Solid, SolidError> {
    let ids: Vec<u32> = (0..cloud.len() as u32).collect();
    Solid::build(cloud, &ids, 1.0, None, settings)
}

fn unit_density() -> Material {
    Material { density: 1.0, ..Material::preset("rubber").unwrap() }
}

const BALL: f64 = 4.0 / 3.0 * std::f64::consts::PI * 0.125;

fn assert_is_the_ball(solid: &Solid) {
    let volume = solid.volume();
    assert!((volume / BALL - 1.0).abs() < 0.03, "volume {volume} of {BALL}");
    let mass = solid.mass_properties(&[unit_density()]);
    assert!(mass.center.length() < 0.005, "{}", mass.center);
    let exact = 0.4 * mass.mass * 0.25;
    for k in 0..3 {
        let own = mass.inertia.col(k)[k];
        assert!((own / exact - 1.0).abs() < 0.05, "inertia {own} of {exact}");
        assert!((0..3).filter(|&r| r != k).all(|r| mass.inertia.col(k)[r].abs() < 0.01 * exact));
    }
    assert!(!solid.report.leaked && !solid.report.thin);
    assert_eq!(solid.report.pieces, 1);
}

#[test]
fn a_ball_of_surface_splats_has_the_volume_centre_and_inertia_of_a_ball() {
    let cloud = Shell::sphere(20_000).cloud();
    assert_is_the_ball(&build(&cloud, &SolidSettings::default()).unwrap());
    assert_is_the_ball(&build(&cloud, &SolidSettings { close_bottom: false, ..SolidSettings::default() }).unwrap());
}

#[test]
fn floaters_around_it_change_nothing() {
    let cloud = Shell::sphere(20_000).with_floaters(0.05, 2.0).cloud();
    assert_is_the_ball(&build(&cloud, &SolidSettings::default()).unwrap());
}

#[test]
fn a_missing_underside_is_closed_where_the_thing_stood() {
    let mut shell = Shell::sphere(20_000);
    shell.0.retain(|s| s.0.y > -0.3);
    let cloud = shell.cloud();
    // What is left of the ball without a cap 0.2 high.
    let cap = std::f64::consts::PI * 0.04 * (1.5 - 0.2) / 3.0;
    let exact = BALL - cap;
    let solid = build(&cloud, &SolidSettings::default()).unwrap();
    assert!((solid.volume() / exact - 1.0).abs() < 0.05, "{} of {exact}", solid.volume());
    let open = SolidSettings { close_bottom: false, hull_if_leaks: false, ..SolidSettings::default() };
    assert!(matches!(build(&cloud, &open), Err(SolidError::ShellLeaks { closing: 4, .. })));
    // To its hull it is closed as well, and says so.
    let hull = build(&cloud, &SolidSettings { close_bottom: false, ..SolidSettings::default() }).unwrap();
    assert!(hull.report.leaked);
    assert!((hull.volume() / exact - 1.0).abs() < 0.08, "{} of {exact}", hull.volume());
}

#[test]
fn a_box_without_its_underside_has_its_volume_whichever_way_is_up() {
    let size = DVec3::new(0.6, 0.4, 0.3);
    for (up, open) in [(DVec3::Y, 2), (-DVec3::X, 1), (DVec3::Z, 4)] {
        let mut sides = [true; 6];
        sides[open] = false;
        let cloud = Shell::cuboid(size, sides, 4000).cloud();
        let solid = build(&cloud, &SolidSettings { up, hull_if_leaks: false, ..SolidSettings::default() }).unwrap();
        assert!((solid.volume() / 0.072 - 1.0).abs() < 0.05, "{up}: {}", solid.volume());
        let center = solid.mass_properties(&[unit_density()]).center;
        assert!(center.distance(0.5 * size) < 0.01, "{center}");
    }
}

#[test]
fn an_open_tray_stays_open_at_the_top() {
    let mut sides = [true; 6];
    sides[3] = false;
    let cloud = Shell::cuboid(DVec3::new(0.6, 0.2, 0.6), sides, 6000).cloud();
    let settings = SolidSettings { hull_if_leaks: false, ..SolidSettings::default() };
    assert!(matches!(build(&cloud, &settings), Err(SolidError::ShellLeaks { .. })));
}

#[test]
fn an_l_is_an_l() {
    let size = DVec3::new(0.6, 0.6, 0.3);
    let mut shell = Shell::cuboid(size, [true; 6], 8000);
    // The corner beyond (0.2, 0.2) is cut out, and the two new faces put in.
    shell.0.retain(|s| !(s.0.x > 0.2 && s.0.y > 0.2));
    let mut noise = Noise(9);
    for _ in 0..5000 {
        let (t, z) = (0.2 + 0.4 * noise.next(), 0.3 * noise.next());
        shell.0.push((DVec3::new(0.2, t, z), DVec3::X, 0.017));
        shell.0.push((DVec3::new(t, 0.2, z), DVec3::Y, 0.017));
    }
    let solid = build(&shell.cloud(), &SolidSettings::default()).unwrap();
    let exact = (0.36 - 0.16) * 0.3;
    assert!((solid.volume() / exact - 1.0).abs() < 0.05, "{}", solid.volume());
    let notch = solid.grid.locate(DVec3::new(0.4, 0.4, 0.15)).unwrap();
    assert_eq!(solid.weights[notch], 0.0);
}

#[test]
fn a_hollow_ball_weighs_its_wall() {
    let cloud = Shell::sphere(20_000).cloud();
    let wall = 0.06;
    let solid = build(&cloud, &SolidSettings { hollow: Some(wall), ..SolidSettings::default() }).unwrap();
    let exact = BALL - 4.0 / 3.0 * std::f64::consts::PI * (0.5_f64 - wall).powi(3);
    assert!((solid.volume() / exact - 1.0).abs() < 0.05, "{} of {exact}", solid.volume());
}

#[test]
fn size_place_and_turn_of_the_cloud_do_not_matter() {
    let shell = Shell::cuboid(DVec3::new(0.6, 0.4, 0.3), [true; 6], 4000);
    let turn = glam::DQuat::from_axis_angle(DVec3::new(1.0, 0.5, -0.3).normalize(), 0.7);
    for scale in [1e-3, 1.0, 1e4] {
        let moved = Shell(
            shell.0.iter().map(|s| ((turn * s.0 + DVec3::new(3.0, -2.0, 1.0)) * scale, turn * s.1, s.2 * scale)).collect(),
        );
        let solid = build(&moved.cloud(), &SolidSettings::default()).unwrap();
        let volume = solid.volume() / scale.powi(3);
        assert!((volume / 0.072 - 1.0).abs() < 0.06, "{scale}: {volume}");
    }
    // The scale of the capture says how large a unit is.
    let cloud = shell.cloud();
    let ids: Vec<u32> = (0..cloud.len() as u32).collect();
    let solid = Solid::build(&cloud, &ids, 2.0, None, &SolidSettings::default()).unwrap();
    assert!((solid.volume() / (8.0 * 0.072) - 1.0).abs() < 0.05);
}

#[test]
fn materials_lie_where_their_splats_do() {
    let size = DVec3::new(0.6, 0.3, 0.3);
    let shell = Shell::cuboid(size, [true; 6], 6000);
    let labels: Vec<u8> = shell.0.iter().map(|s| u8::from(s.0.x > 0.3)).collect();
    let cloud = shell.cloud();
    let ids: Vec<u32> = (0..cloud.len() as u32).collect();
    let solid = Solid::build(&cloud, &ids, 1.0, Some(&labels), &SolidSettings::default()).unwrap();
    for v in solid.occupied() {
        let x = solid.grid.center(v).x;
        if (x - 0.3).abs() > 0.05 {
            assert_eq!(solid.regions[v], u8::from(x > 0.3), "{x}");
        }
    }
    let (light, heavy) = (unit_density(), Material { density: 3.0, ..unit_density() });
    let mass = solid.mass_properties(&[light, heavy]);
    assert!((mass.mass / (0.054 * 2.0) - 1.0).abs() < 0.05);
    // (0.15 * 1 + 0.45 * 3) / 4
    assert!((mass.center.x - 0.375).abs() < 0.01, "{}", mass.center);
}

#[test]
fn boxes_are_exact() {
    let solid = Solid::cuboid(DVec3::new(-0.1, 0.0, 0.2), DVec3::new(0.3, 0.2, 0.5), 0.02);
    assert!((solid.volume() - 0.024).abs() < 1e-12);
    let (least, most) = solid.bounds();
    assert!(least.distance(DVec3::new(-0.1, 0.0, 0.2)) < 1e-12 && most.distance(DVec3::new(0.3, 0.2, 0.5)) < 1e-12);
    let mass = solid.mass_properties(&[Material { density: 1000.0, ..unit_density() }]);
    assert!((mass.mass - 24.0).abs() < 1e-9 && mass.center.distance(DVec3::new(0.1, 0.1, 0.35)) < 1e-12);
    let exact = 24.0 / 12.0 * DVec3::new(0.04 + 0.09, 0.16 + 0.09, 0.16 + 0.04);
    assert!(mass.inertia.abs_diff_eq(glam::DMat3::from_diagonal(exact), 1e-9));
}

#[test]
fn the_same_part_gives_the_same_bits_on_any_number_of_threads() {
    let cloud = Shell::sphere(5000).with_floaters(0.05, 1.0).cloud();
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| build(&cloud, &SolidSettings::default()).unwrap())
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn parts_without_a_shape_say_why() {
    let settings = SolidSettings::default();
    let few = Shell::sphere(49).cloud();
    assert_eq!(build(&few, &settings), Err(SolidError::TooFewSplats { have: 49, need: 50 }));
    let cloud = Shell::sphere(500).cloud();
    let ids: Vec<u32> = (0..500).collect();
    for scale in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e300] {
        let found = Solid::build(&cloud, &ids, scale, None, &settings);
        assert!(matches!(found, Err(SolidError::ScaleOutOfRange { .. })), "{scale}");
    }
    let found = Solid::build(&cloud, &[1, 2, 900], 1.0, None, &settings);
    assert_eq!(found, Err(SolidError::UnknownGaussian { id: 900, len: 500 }));
    let found = Solid::build(&cloud, &ids, 1.0, Some(&[0; 3]), &settings);
    assert_eq!(found, Err(SolidError::Regions { regions: 3, gaussians: 500 }));
    for wrong in [
        SolidSettings { voxels: 2, ..settings },
        SolidSettings { cut: f32::NAN, ..settings },
        SolidSettings { up: DVec3::ZERO, ..settings },
        SolidSettings { hollow: Some(-1.0), ..settings },
    ] {
        assert!(matches!(build(&cloud, &wrong), Err(SolidError::Setting { .. })));
    }
}

#[test]
fn odd_parts_are_solids_or_errors_and_never_panics() {
    let settings = SolidSettings::default();
    // All in one point.
    let point = Shell((0..100).map(|_| (DVec3::ONE, DVec3::Z, 0.017)).collect());
    if let Ok(solid) = build(&point.cloud(), &settings) {
        assert!(solid.volume().is_finite() && solid.volume() > 0.0);
    }
    // A sheet is nothing but shell.
    let sheet = Shell::cuboid(DVec3::new(0.6, 0.6, 0.01), [false, false, false, false, true, false], 4000).cloud();
    let solid = build(&sheet, &settings).unwrap();
    assert!(solid.report.thin);
    // Two far islands are two pieces.
    let mut two = Shell::sphere(3000);
    let other: Vec<_> = two.0.iter().map(|s| (s.0 + DVec3::X * 20.0, s.1, s.2)).collect();
    two.0.extend(other);
    let solid = build(&two.cloud(), &SolidSettings { voxels: 256, ..settings }).unwrap();
    assert_eq!(solid.report.pieces, 2);
    // Numbers that are none do not count.
    let mut arrays = CloudArrays::default();
    for (k, s) in Shell::sphere(2000).0.iter().enumerate() {
        let bad = k % 10 == 0;
        arrays.means.push(if bad { Vec3::NAN } else { s.0.as_vec3() });
        arrays.log_scales.push(Vec3::splat(if k % 10 == 1 { 80.0 } else { -3.5 }));
        arrays.rotations.push(Quat::IDENTITY);
        arrays.opacity_logits.push(2.0);
        arrays.sh.extend([0.0; 3]);
    }
    if let Ok(cloud) = Cloud::new(arrays) {
        let solid = build(&cloud, &settings).unwrap();
        assert!((solid.volume() / BALL - 1.0).abs() < 0.3, "{}", solid.volume());
    }
}
