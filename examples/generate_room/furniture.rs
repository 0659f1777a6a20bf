//! Table, chairs, sofa, sideboard, lamp, rug and the picture on the wall.

use glam::{DMat3, DVec2, DVec3};

use crate::materials::{Material, rgb};
use crate::math::{turn, v};
use crate::room::{BACK, BULB, label};
use crate::shapes::{Builder, Shape};

const WALNUT: Material = Material::Wood(rgb(146, 96, 62), 0);
const WALNUT_Y: Material = Material::Wood(rgb(138, 90, 58), 1);

/// Middle of the table's top face and its turn, in degrees: what stands on it is placed from here.
pub(crate) const TABLE: (DVec3, f64) = (DVec3::new(1.0, 0.74, -0.05), -14.0);
/// Height of the sideboard's top face.
pub(crate) const SIDEBOARD_TOP: f64 = 0.72;
/// Middle of the sideboard: x, z.
pub(crate) const SIDEBOARD: DVec2 = DVec2::new(0.55, -1.74);

/// Adds all of it.
pub(crate) fn all(b: &mut Builder) {
    rug(b);
    sofa(b);
    table(b);
    chair(b, "chair A", v(0.98, 0.0, 0.68), -18.0 + 180.0);
    chair(b, "chair B", v(0.13, 0.0, 0.10), 76.0);
    sideboard(b);
    picture(b);
    lamp(b);
}

fn rug(b: &mut Builder) {
    let (hx, hz) = (0.98, 0.72);
    b.object(label("rug"), v(-0.55, 0.006, 0.62), turn(1, 7.0)).detail(0.0107, 0.022);
    b.add(Shape::Block(v(hx, 0.007, hz), 0.004), Material::Rug(hx, hz), DVec3::ZERO);
    b.detail(0.012, 0.02);
    let yarn = Material::Plain(rgb(214, 200, 172));
    for k in 0..44 {
        let z = -hz + 0.018 + f64::from(k) * (2.0 * hz - 0.036) / 43.0;
        for s in [-1.0, 1.0] {
            let lean = libm::sin(f64::from(k) * 2.4) * 0.012;
            b.rod(v(s * hx, 0.003, z), v(s * (hx + 0.055), -0.001, z + lean), 0.0045, 0.0035, yarn);
        }
    }
}

fn sofa(b: &mut Builder) {
    let linen = Material::Cloth(rgb(96, 116, 132));
    let dark = Material::Cloth(rgb(84, 102, 118));
    let leg = Material::Wood(rgb(96, 62, 40), 1);
    // Its front is +z before the turn: it looks along +x.
    b.object(label("sofa"), v(-1.80, 0.0, 0.40), turn(1, 88.0)).detail(0.019, 0.032);
    b.add(Shape::Block(v(0.92, 0.12, 0.40), 0.03), dark, v(0.0, 0.23, 0.0));
    for s in [-1.0, 1.0] {
        b.add(Shape::Pillow(v(0.385, 0.10, 0.34), 0.05), linen, v(s * 0.385, 0.425, 0.07));
        b.add_turned(Shape::Pillow(v(0.37, 0.12, 0.22), 0.05), linen, v(s * 0.38, 0.66, -0.20), turn(0, 76.0));
        b.add(Shape::Block(v(0.085, 0.22, 0.40), 0.07), linen, v(s * 0.85, 0.40, 0.0));
        for z in [-0.32, 0.32] {
            b.rod(v(s * 0.82, 0.13, z), v(s * 0.84, 0.0, z), 0.024, 0.016, leg);
        }
    }
    b.add(Shape::Block(v(0.92, 0.26, 0.085), 0.06), linen, v(0.0, 0.55, -0.34));
    let (a, c) = (rgb(214, 122, 70), rgb(240, 226, 198));
    b.object(label("cushion"), v(-1.70, 0.70, -0.06), turn(1, 62.0)).detail(0.0105, 0.022);
    b.add_turned(Shape::Pillow(v(0.20, 0.085, 0.20), 0.012), Material::Zigzag(a, c), DVec3::ZERO, turn(0, 68.0));
}

fn table(b: &mut Builder) {
    let (at, turned) = TABLE;
    b.object(label("table"), v(at.x, 0.0, at.z), turn(1, turned)).detail(0.0118, 0.03);
    b.add(Shape::Block(v(0.62, 0.018, 0.40), 0.008), WALNUT, v(0.0, at.y - 0.018, 0.0));
    b.detail(0.018, 0.03);
    for s in [-1.0, 1.0] {
        b.add(Shape::Block(v(0.53, 0.035, 0.011), 0.003), WALNUT, v(0.0, at.y - 0.071, s * 0.33));
        b.add(
            Shape::Block(v(0.011, 0.035, 0.32), 0.003),
            Material::Wood(rgb(138, 90, 58), 2),
            v(s * 0.53, at.y - 0.071, 0.0),
        );
        for z in [-1.0, 1.0] {
            b.rod(v(s * 0.53, at.y - 0.04, z * 0.33), v(s * 0.57, 0.016, z * 0.365), 0.030, 0.017, WALNUT_Y);
        }
    }
}

/// A spindle-back chair; its back is at -z before the turn.
fn chair(b: &mut Builder, name: &str, at: DVec3, degrees: f64) {
    let wood = Material::Wood(rgb(206, 160, 104), 1);
    let seat = Material::Wood(rgb(208, 164, 110), 0);
    b.object(label(name), at, turn(1, degrees)).detail(0.0108, 0.020);
    b.add(Shape::Block(v(0.215, 0.019, 0.205), 0.017), seat, v(0.0, 0.445, 0.0));
    for s in [-1.0, 1.0] {
        b.rod(v(s * 0.16, 0.44, 0.15), v(s * 0.205, 0.0, 0.20), 0.018, 0.012, wood);
        b.rod(v(s * 0.15, 0.44, -0.15), v(s * 0.195, 0.0, -0.22), 0.018, 0.012, wood);
        b.rod(v(s * 0.18, 0.22, 0.175), v(s * 0.172, 0.22, -0.183), 0.009, 0.009, wood);
        b.rod(v(s * 0.185, 0.45, -0.175), v(s * 0.205, 0.87, -0.265), 0.014, 0.012, wood);
    }
    b.rod(v(-0.176, 0.22, 0.0), v(0.176, 0.22, 0.0), 0.009, 0.009, wood);
    for k in -2..=2 {
        let x = f64::from(k) * 0.062;
        b.rod(v(x, 0.45, -0.182), v(x * 1.1, 0.85, -0.268), 0.0075, 0.0065, wood);
    }
    b.add_turned(Shape::Block(v(0.225, 0.042, 0.012), 0.010), seat, v(0.0, 0.875, -0.272), turn(0, -11.0));
}

fn sideboard(b: &mut Builder) {
    let oak = Material::Wood(rgb(196, 152, 102), 0);
    let door = Material::Wood(rgb(186, 140, 90), 1);
    let brass = Material::Metal(rgb(196, 158, 82));
    let (hx, hz) = (0.78, 0.215);
    b.object(label("sideboard"), v(SIDEBOARD.x, 0.0, SIDEBOARD.y), DMat3::IDENTITY).detail(0.0145, 0.034);
    b.add(Shape::Block(v(hx, 0.016, hz), 0.005), oak, v(0.0, SIDEBOARD_TOP - 0.016, 0.0));
    b.add(Shape::Block(v(hx - 0.012, 0.255, hz - 0.02), 0.004), oak, v(0.0, SIDEBOARD_TOP - 0.285, -0.012));
    for k in 0..3 {
        let x = (f64::from(k) - 1.0) * 0.506;
        b.add(Shape::Block(v(0.247, 0.235, 0.010), 0.004), door, v(x, SIDEBOARD_TOP - 0.285, hz - 0.026));
        let knob = x + if k == 0 { 0.20 } else { -0.20 };
        b.add(Shape::Egg(v(0.013, 0.013, 0.013)), brass, v(knob, SIDEBOARD_TOP - 0.24, hz - 0.006));
    }
    for s in [-1.0, 1.0] {
        for z in [-0.14, 0.14] {
            b.rod(v(s * 0.66, 0.20, z), v(s * 0.71, 0.0, z * 1.15), 0.022, 0.013, oak);
        }
    }
}

fn picture(b: &mut Builder) {
    let frame = Material::Wood(rgb(92, 60, 38), 0);
    let (hx, hy) = (0.40, 0.29);
    b.object(label("picture"), v(0.42, 1.52, BACK + 0.012), turn(2, 0.8)).detail(0.0098, 0.026);
    b.add(Shape::Block(v(hx, hy, 0.006), 0.001), Material::Painting(hx, hy), DVec3::ZERO);
    b.detail(0.012, 0.024);
    for s in [-1.0, 1.0] {
        b.add(Shape::Block(v(hx + 0.03, 0.017, 0.017), 0.005), frame, v(0.0, s * (hy + 0.013), 0.008));
        b.add(
            Shape::Block(v(0.017, hy + 0.03, 0.017), 0.005),
            Material::Wood(rgb(92, 60, 38), 1),
            v(s * (hx + 0.013), 0.0, 0.008),
        );
    }
}

fn lamp(b: &mut Builder) {
    let iron = Material::Metal(rgb(58, 56, 56));
    b.object(label("floor lamp"), v(BULB.x, 0.0, BULB.z), DMat3::IDENTITY).detail(0.0095, 0.022);
    b.add(Shape::Drum(0.135, 0.012, 0.008), iron, v(0.0, 0.012, 0.0));
    b.rod(v(0.0, 0.02, 0.0), v(0.0, BULB.y - 0.04, 0.0), 0.0085, 0.0075, iron);
    b.add(Shape::Egg(v(0.032, 0.042, 0.032)), Material::Shade, v(0.0, BULB.y, 0.0));
    b.detail(0.014, 0.026);
    let line = vec![DVec2::new(0.205, 0.0), DVec2::new(0.135, 0.27)];
    b.add(Shape::Turned(line, 0.003), Material::Shade, v(0.0, BULB.y - 0.12, 0.0));
}
