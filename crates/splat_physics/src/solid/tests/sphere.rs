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
    assert!((solid.volume() / expected - 1.0).abs() < 0.05, "{} for {expected}", solid.volume());
    assert!(solid.report.base > 300 && !solid.report.leaked, "{:?}", solid.report);

    let open = SolidSettings { close_bottom: false, leaks: Leaks::Refuse, ..settings() };
    let error = shell.solid(&open).unwrap_err();
    let SolidError::ShellLeaks { closing_tried: 4, filled, shell: of_shell, .. } = error else { panic!("{error}") };
    assert!(filled < 1.1 * of_shell);

    // Its hull is nearly as good here, and says what it is.
    let hull = shell.solid(&SolidSettings { leaks: Leaks::Hull, ..open.clone() }).unwrap();
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
        assert!(!solid.report.leaked, "{up}");
        assert!((solid.volume() / expected - 1.0).abs() < 0.06, "{} for {expected}, up {up}", solid.volume());
    }
}

/// Of a ball's wall of a thickness, in m^3, and its inertia over mass, in m^2.
fn wall_of_ball(wall: f64) -> (f64, f64) {
    let inner = (0.5 - wall).max(0.0);
    let (third, fifth) = (0.125 - inner.powi(3), 0.5f64.powi(5) - inner.powi(5));
    (4.0 / 3.0 * PI * third, 0.4 * fifth / third)
}

#[test]
fn a_hollow_ball_weighs_what_its_wall_does() {
    let shell = Shell::sphere(20_000, |_| true);
    let whole = shell.solid(&settings()).unwrap();
    for wall in [0.3, 0.2, 0.1, 0.05, 0.01, 0.001] {
        let solid = shell.solid(&SolidSettings { hollow: Some(wall), ..settings() }).unwrap();
        // The inner side is known to half a voxel; thinner walls than one are as heavy as their area and thickness say.
        let slack = (0.5 * solid.grid.voxel).min(0.1 * wall + 0.1 * solid.grid.voxel);
        let (least, most) = (wall_of_ball(wall - slack).0, wall_of_ball(wall + slack).0);
        let volume = solid.volume();
        assert!(volume > 0.97 * least && volume < 1.03 * most, "{volume} for {least}..{most}, wall {wall}");
        let ratio = mass(&solid).inertia.x_axis.x / mass(&solid).mass;
        let exact = wall_of_ball(wall).1;
        assert!((ratio / exact - 1.0).abs() < 0.06, "{ratio} for {exact}, wall {wall}");
        assert!((solid.report.volume - volume).abs() < 1e-12 && volume < whole.volume());
    }
    // A wall as thick as the ball leaves nothing out.
    let full = shell.solid(&SolidSettings { hollow: Some(0.6), ..settings() }).unwrap();
    assert!((full.volume() / whole.volume() - 1.0).abs() < 0.01);
}
