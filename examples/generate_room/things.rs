//! The small things: books, crockery, fruit, vases, flowers, the plant and the toys.

use glam::{DMat3, DVec2, DVec3};

use crate::furniture::{SIDEBOARD, SIDEBOARD_TOP, TABLE};
use crate::materials::{Material, rgb};
use crate::math::{Rng, frame_of, sin_cos, turn, v};
use crate::room::label;
use crate::shapes::{Builder, Shape};

/// Adds all of it.
pub(crate) fn all(b: &mut Builder) {
    books(b);
    cup(b);
    fruit(b);
    let (at, axes) = on_table(v(0.33, 0.0, -0.20));
    vase(b, "vase A", at, axes);
    tulips(b, at);
    vase(b, "vase B", v(SIDEBOARD.x - 0.50, SIDEBOARD_TOP, SIDEBOARD.y + 0.02), turn(1, 40.0));
    vase(b, "vase C", v(SIDEBOARD.x - 0.27, SIDEBOARD_TOP, SIDEBOARD.y - 0.05), turn(1, 160.0));
    plant(b);
    ball(b);
    teddy(b);
}

/// A place on the table, given in the table's own frame.
fn on_table(p: DVec3) -> (DVec3, DMat3) {
    let axes = turn(1, TABLE.1);
    (TABLE.0 + axes * p, axes)
}

fn books(b: &mut Builder) {
    let mut y = 0.0;
    for (name, half, cover, print, turned, dx) in [
        ("green book", v(0.122, 0.021, 0.165), rgb(44, 84, 66), rgb(214, 182, 104), 8.0, 0.0),
        ("red book", v(0.108, 0.016, 0.150), rgb(166, 46, 42), rgb(240, 226, 196), -9.0, 0.006),
        ("blue book", v(0.092, 0.013, 0.128), rgb(50, 92, 152), rgb(236, 232, 220), 21.0, -0.008),
    ] {
        let (at, axes) = on_table(v(-0.36 + dx, y + half.y, 0.03));
        b.object(label(name), at, axes * turn(1, turned + 90.0)).detail(0.0064, 0.013);
        b.add(Shape::Block(half, 0.003), Material::Book(cover, print, half), DVec3::ZERO);
        y += 2.0 * half.y;
    }
}

fn cup(b: &mut Builder) {
    let white = Material::Glaze(rgb(236, 230, 218), rgb(58, 92, 140), 0.004);
    let (at, axes) = on_table(v(-0.06, 0.0, 0.22));
    b.object(label("saucer"), at, axes).detail(0.0075, 0.012);
    let line =
        vec![DVec2::new(0.0, 0.004), DVec2::new(0.042, 0.004), DVec2::new(0.062, 0.011), DVec2::new(0.080, 0.019)];
    b.add(Shape::Turned(line, 0.0028), white, DVec3::ZERO);
    let blue = Material::Glaze(rgb(206, 92, 58), rgb(244, 232, 212), 0.088);
    b.object(label("mug"), at + v(0.0, 0.0075, 0.0), axes * turn(1, 35.0)).detail(0.0058, 0.009);
    let line = vec![
        DVec2::new(0.0, 0.004),
        DVec2::new(0.030, 0.004),
        DVec2::new(0.037, 0.012),
        DVec2::new(0.040, 0.05),
        DVec2::new(0.041, 0.090),
    ];
    b.add(Shape::Turned(line, 0.0030), blue, DVec3::ZERO);
    b.add(Shape::Drum(0.037, 0.002, 0.001), Material::Plain(rgb(58, 34, 20)), v(0.0, 0.072, 0.0));
    b.add_turned(Shape::Ring(0.026, 0.0062), blue, v(0.056, 0.047, 0.0), turn(0, 90.0));
}

fn fruit(b: &mut Builder) {
    let clay = Material::Glaze(rgb(232, 222, 204), rgb(150, 112, 84), 0.066);
    let (at, axes) = on_table(v(0.10, 0.0, -0.04));
    let at = at + axes * v(0.16, 0.0, 0.13);
    b.object(label("bowl"), at, axes).detail(0.0085, 0.014);
    let line = vec![
        DVec2::new(0.0, 0.010),
        DVec2::new(0.045, 0.010),
        DVec2::new(0.085, 0.026),
        DVec2::new(0.112, 0.052),
        DVec2::new(0.124, 0.078),
    ];
    b.add(Shape::Turned(line, 0.0038), clay, DVec3::ZERO);
    b.add(Shape::Ring(0.043, 0.006), clay, v(0.0, 0.006, 0.0));
    b.object(label("oranges"), at, axes).detail(0.0082, 0.013);
    let r = 0.041;
    for (k, (x, y, z)) in [(0.045, 0.058, 0.014), (-0.036, 0.057, 0.036), (-0.014, 0.057, -0.047), (0.0, 0.118, 0.0)]
        .into_iter()
        .enumerate()
    {
        let axes = turn(0, 40.0 + 70.0 * k as f64) * turn(1, 50.0 * k as f64);
        b.add_turned(Shape::Egg(v(r, r * 0.94, r)), Material::Orange, v(x, y, z), axes);
    }
}

fn vase(b: &mut Builder, name: &str, at: DVec3, axes: DMat3) {
    let teal = Material::Glaze(rgb(32, 104, 112), rgb(222, 202, 158), 0.135);
    b.object(label(name), at, axes).detail(0.0082, 0.0135);
    let line = vec![
        DVec2::new(0.0, 0.005),
        DVec2::new(0.040, 0.005),
        DVec2::new(0.058, 0.035),
        DVec2::new(0.068, 0.075),
        DVec2::new(0.066, 0.115),
        DVec2::new(0.052, 0.155),
        DVec2::new(0.032, 0.190),
        DVec2::new(0.025, 0.218),
        DVec2::new(0.030, 0.240),
        DVec2::new(0.038, 0.250),
    ];
    b.add(Shape::Turned(line, 0.0036), teal, DVec3::ZERO);
}

fn tulips(b: &mut Builder, at: DVec3) {
    let stem = Material::Plain(rgb(92, 136, 62));
    b.object(label("tulips"), at, DMat3::IDENTITY);
    let mut rng = Rng::new(41);
    for (k, color) in [rgb(222, 70, 96), rgb(244, 182, 70), rgb(232, 104, 74), rgb(240, 150, 172), rgb(206, 52, 78)]
        .into_iter()
        .enumerate()
    {
        let (s, c) = sin_cos(k as f64 * 1.257 + 0.4);
        let out = rng.range(0.07, 0.12);
        let tall = rng.range(0.37, 0.45);
        let a = v(c * 0.010, 0.09, s * 0.010);
        let m = v(c * 0.020, 0.26, s * 0.020);
        let m2 = v(c * (0.02 + out * 0.42), 0.26 + (tall - 0.26) * 0.62, s * (0.02 + out * 0.42));
        let e = v(c * (0.02 + out), tall, s * (0.02 + out));
        b.detail(0.0075, 0.014);
        b.rod(a, m, 0.0036, 0.0034, stem).rod(m, m2, 0.0034, 0.0032, stem).rod(m2, e, 0.0032, 0.0030, stem);
        let up = (e - m2).normalize();
        b.detail(0.0070, 0.012);
        let petals = Material::Fur(color);
        b.add_turned(Shape::Egg(v(0.019, 0.030, 0.019)), petals, e + up * 0.024, frame_of(up));
        b.detail(0.0085, 0.014);
        let blade = frame_of(v(-s * 0.3 + c * 0.5, -0.5, c * 0.3 + s * 0.5).normalize());
        let along = DMat3::from_cols(v(c * 0.45, 0.85, s * 0.45).normalize(), blade.y_axis, blade.z_axis);
        let x = along.x_axis;
        let y = v(-s, 0.0, c).cross(x).normalize();
        let axes = DMat3::from_cols(x, y, x.cross(y));
        b.add_turned(
            Shape::Leaf(0.20, 0.017, 0.25, 0.0016),
            Material::Leaf(0.20, rgb(104, 150, 78)),
            v(c * 0.016, 0.225, s * 0.016),
            axes,
        );
    }
}

fn plant(b: &mut Builder) {
    let clay = Material::Glaze(rgb(196, 112, 76), rgb(224, 160, 118), 0.27);
    let stem = Material::Plain(rgb(104, 118, 60));
    let at = v(1.92, 0.0, -1.42);
    b.object(label("plant"), at, DMat3::IDENTITY).detail(0.016, 0.028);
    let line = vec![
        DVec2::new(0.0, 0.008),
        DVec2::new(0.115, 0.008),
        DVec2::new(0.150, 0.16),
        DVec2::new(0.165, 0.29),
        DVec2::new(0.178, 0.30),
    ];
    b.add(Shape::Turned(line, 0.007), clay, DVec3::ZERO);
    b.add(Shape::Drum(0.155, 0.012, 0.006), Material::Soil, v(0.0, 0.262, 0.0));
    let mut rng = Rng::new(77);
    for k in 0..17 {
        let turn = f64::from(k) * 2.399_963 + rng.range(-0.3, 0.3);
        let (s, c) = sin_cos(turn);
        let tall = rng.range(0.45, 1.12);
        let out = rng.range(0.10, 0.22) + 0.26 * (1.15 - tall).max(0.0);
        let p0 = v(c * 0.04, 0.26, s * 0.04);
        let p1 = v(c * (0.05 + out * 0.25), 0.26 + tall * 0.55, s * (0.05 + out * 0.25));
        let p2 = v(c * (0.05 + out), 0.26 + tall, s * (0.05 + out));
        b.detail(0.010, 0.022).rod(p0, p1, 0.0062, 0.0050, stem).rod(p1, p2, 0.0050, 0.0034, stem);
        let mut leaf = |at: DVec3, length: f64, turn: f64, rise: f64| {
            let (s, c) = sin_cos(turn);
            let x = v(c, rise, s).normalize();
            let z = (x.cross(v(0.0, 1.0, 0.0)) + v(0.0, rng.range(-0.25, 0.25), 0.0)).normalize();
            let y = z.cross(x).normalize();
            let green = rgb(52, 104, 48) * rng.range(0.85, 1.3);
            let axes = DMat3::from_cols(x, y, x.cross(y));
            let shape = Shape::Leaf(length, length * rng.range(0.20, 0.26), rng.range(0.2, 0.55), 0.0022);
            b.detail(0.0125, 0.020).add_turned(shape, Material::Leaf(length, green), at, axes);
        };
        leaf(p2, 0.25, turn, 0.25);
        leaf(p1 + (p2 - p1) * 0.55, 0.21, turn + 1.5, 0.2);
        leaf(p1 + (p2 - p1) * 0.2, 0.19, turn - 1.4, 0.1);
    }
}

fn ball(b: &mut Builder) {
    let axes = turn(0, 38.0) * turn(2, 24.0);
    b.object(label("ball"), v(-0.02, 0.145, 1.08), axes).detail(0.0105, 0.020);
    b.add(Shape::Egg(DVec3::splat(0.145)), Material::Ball, DVec3::ZERO);
}

fn teddy(b: &mut Builder) {
    let fur = Material::Fur(rgb(184, 132, 82));
    let pale = Material::Fur(rgb(226, 194, 148));
    let black = Material::Plain(rgb(28, 24, 24));
    let axes = turn(1, 38.0);
    let at = v(-0.68, 0.013, 0.42);
    b.object(label("teddy"), at, axes).detail(0.0088, 0.0125);
    b.add(Shape::Egg(v(0.115, 0.135, 0.100)), fur, v(0.0, 0.125, 0.0));
    b.add(Shape::Egg(v(0.078, 0.090, 0.05)), pale, v(0.0, 0.125, 0.058));
    b.add(Shape::Egg(v(0.102, 0.092, 0.092)), fur, v(0.0, 0.325, 0.012));
    b.add(Shape::Egg(v(0.048, 0.037, 0.036)), pale, v(0.0, 0.298, 0.092));
    for s in [-1.0, 1.0] {
        b.add(Shape::Egg(v(0.037, 0.037, 0.020)), fur, v(s * 0.086, 0.382, 0.006));
        b.add(Shape::Egg(v(0.023, 0.023, 0.008)), pale, v(s * 0.087, 0.381, 0.022));
        b.rod(v(s * 0.09, 0.205, 0.02), v(s * 0.155, 0.085, 0.085), 0.040, 0.036, fur);
        b.rod(v(s * 0.065, 0.048, 0.045), v(s * 0.115, 0.046, 0.200), 0.048, 0.046, fur);
        b.add_turned(Shape::Egg(v(0.040, 0.012, 0.043)), pale, v(s * 0.123, 0.048, 0.238), turn(0, 90.0));
        b.detail(0.006, 0.008)
            .add(Shape::Egg(v(0.014, 0.015, 0.010)), black, v(s * 0.039, 0.340, 0.099))
            .detail(0.0088, 0.0125);
    }
    b.detail(0.006, 0.009).add(Shape::Egg(v(0.016, 0.011, 0.010)), black, v(0.0, 0.312, 0.126));
    let (red, white) = (rgb(196, 44, 48), rgb(240, 232, 220));
    b.object(label("hat"), at + axes * v(0.0, 0.375, 0.0), axes * turn(0, -8.0) * turn(2, -7.0)).detail(0.0082, 0.012);
    let line = vec![
        DVec2::new(0.090, 0.0),
        DVec2::new(0.083, 0.035),
        DVec2::new(0.058, 0.085),
        DVec2::new(0.024, 0.118),
        DVec2::new(0.0, 0.128),
    ];
    b.add(Shape::Turned(line, 0.006), Material::Knit(red, red * 0.9), DVec3::ZERO);
    b.add(Shape::Ring(0.090, 0.015), Material::Knit(white, white), v(0.0, 0.004, 0.0));
    b.add(Shape::Egg(DVec3::splat(0.032)), Material::Fur(white), v(0.0, 0.146, 0.0));
}
