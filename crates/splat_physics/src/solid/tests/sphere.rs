//! The sphere of `facts`, with floaters and without its underside.

use std::f64::consts::PI;

use glam::DVec3;

use super::*;
use crate::solid::{Leaks, Solid, SolidError, SolidSettings};
use crate::{MassProperties, Material};

const VOLUME: f64 = PI / 6.0;

/// Of 1000 kg/m^3.
fn mass(solid: &Solid) -> MassProperties {
    solid.mass_properties(&[Material { density: 1000.0, ..Material::preset("rubber").unwrap() }])
}

fn assert_is_the_sphere(solid: &Solid) {
    let MassProperties { mass, center, inertia } = mass(solid);
    println!("volume {} mass {mass} center {center} inertia {inertia} {:?}", solid.volume(), solid.report);
    assert!((solid.volume() / VOLUME - 1.0).abs() < 0.03, "{}", solid.volume());
    assert!((mass - 1000.0 * solid.volume()).abs() < 1e-6);
    assert!(center.length() < 0.005, "{center}");
    for (axis, column) in [inertia.x_axis, inertia.y_axis, inertia.z_axis].into_iter().enumerate() {
        let expected = 0.4 * 1000.0 * VOLUME * 0.25;
        assert!((column[axis] / expected - 1.0).abs() < 0.05, "{inertia} for {expected}");
        assert!((column.length_squared() - column[axis].powi(2)).sqrt() < 0.01 * expected, "{inertia}");
    }
    assert!(!solid.report.leaked && solid.report.pieces == 1, "{:?}", solid.report);
}

#[test]
fn a_sphere_of_gaussians_has_the_volume_centre_and_inertia_of_a_ball() {
    let solid = Shell::sphere(20_000, |_| true).solid(&settings()).unwrap();
    assert_is_the_sphere(&solid);
    assert_eq!(solid.report.used, 20_000);
    assert_eq!(solid.report.notes().count(), 0);
}

#[test]
fn floaters_around_change_nothing() {
    for count in [200, 1000] {
        let solid = Shell::sphere(20_000, |_| true).floaters(count, 2.0).solid(&settings()).unwrap();
        assert_is_the_sphere(&solid);
        assert!(solid.report.unused.far > count / 2, "{:?}", solid.report);
    }
}

#[test]
fn a_missing_underside_is_closed_or_told() {
    let shell = Shell::sphere(20_000, |p| p.z > -0.3);
    // A ball without its lowest cap of height 0.2: pi h^2 (3 r - h) / 3 less.
    let expected = VOLUME - PI * 0.04 * (1.5 - 0.2) / 3.0;
    let solid = shell.solid(&settings()).unwrap();
    println!("{} {:?}", solid.volume() / expected, solid.report);
    assert!((solid.volume() / expected - 1.0).abs() < 0.05, "{} for {expected}", solid.volume());
    assert!(solid.report.base > 300 && !solid.report.leaked, "{:?}", solid.report);

    let open = SolidSettings { close_bottom: false, leaks: Leaks::Refuse, ..settings() };
    let error = shell.solid(&open).unwrap_err();
    println!("{error}");
    let SolidError::ShellLeaks { closing_tried: 4, filled, shell: of_shell, .. } = error else { panic!("{error}") };
    assert!(filled < 1.5 * of_shell);

    // Its hull is nearly as good here, and says what it is.
    let hull = shell.solid(&SolidSettings { leaks: Leaks::Hull, ..open.clone() }).unwrap();
    println!("{} {:?}", hull.volume() / expected, hull.report);
    assert!(hull.report.leaked && hull.report.notes().count() == 1);
    assert!((hull.volume() / expected - 1.0).abs() < 0.05, "{} for {expected}", hull.volume());
    let alone = shell.solid(&SolidSettings { leaks: Leaks::Shell, ..open }).unwrap();
    assert!(alone.report.leaked && alone.volume() < 0.3 * expected);
}

#[test]
fn the_underside_is_closed_whichever_way_is_up() {
    let shell = Shell::sphere(20_000, |p| p.z > -0.3);
    let expected = VOLUME - PI * 0.04 * (1.5 - 0.2) / 3.0;
    let ways =
        [DVec3::X, DVec3::Y, DVec3::NEG_X, DVec3::NEG_Z, DVec3::new(0.5, -0.7, 0.3), DVec3::new(-1.0, 1.0, -1.0)];
    for up in ways.map(DVec3::normalize) {
        let turn = glam::DQuat::from_rotation_arc(DVec3::Z, up);
        let solid = shell.clone().moved(1.0, turn, DVec3::ZERO).solid(&SolidSettings { up, ..settings() }).unwrap();
        println!("{up} {} {:?}", solid.volume() / expected, solid.report);
        assert!(!solid.report.leaked, "{up}");
        assert!((solid.volume() / expected - 1.0).abs() < 0.06, "{} for {expected}, up {up}", solid.volume());
    }
}

#[test]
fn a_hollow_ball_weighs_what_its_wall_does() {
    let shell = Shell::sphere(20_000, |_| true);
    for wall in [0.2, 0.1, 0.05, 0.01, 0.001] {
        let solid = shell.solid(&SolidSettings { hollow: Some(wall), ..settings() }).unwrap();
        let inner = 0.5f64 - wall;
        let expected = 4.0 / 3.0 * PI * (0.125 - inner.powi(3));
        println!("{wall} {}", solid.volume() / expected);
        assert!((solid.volume() / expected - 1.0).abs() < 0.08, "{} for {expected}, wall {wall}", solid.volume());
        let ratio = mass(&solid).inertia.x_axis.x / (1000.0 * solid.volume());
        let exact = 0.4 * (0.5f64.powi(5) - inner.powi(5)) / (0.5f64.powi(3) - inner.powi(3));
        assert!((ratio / exact - 1.0).abs() < 0.08, "{ratio} for {exact}, wall {wall}");
    }
}
