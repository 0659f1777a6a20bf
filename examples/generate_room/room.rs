//! What stands where. The room's own space: metres, x along the back wall, y up, z towards the open side;
//! the left wall is at x = -2.3, the back wall at z = -2.0, the floor at y = 0.

use glam::{DMat3, DVec2, DVec3};

use crate::furniture;
use crate::materials::{Material, rgb};
use crate::math::{turn, v};
use crate::shapes::{Builder, Shape, Solid};
use crate::things;

/// Where the left wall's face is.
pub(crate) const LEFT: f64 = -2.3;
/// Where the back wall's face is.
pub(crate) const BACK: f64 = -2.0;
/// How far floor and walls reach.
pub(crate) const RIGHT: f64 = 3.5;
/// How far the floor and the left wall reach towards the open side.
pub(crate) const FRONT: f64 = 3.3;
/// Height of the walls.
pub(crate) const HIGH: f64 = 2.9;
/// Middle of the window: height, z.
pub(crate) const WINDOW: DVec2 = DVec2::new(1.55, 0.35);
/// Half extents of the window: along z, upwards.
pub(crate) const WINDOW_HALF: DVec2 = DVec2::new(0.68, 0.62);
/// The bulb of the floor lamp.
pub(crate) const BULB: DVec3 = DVec3::new(-1.72, 1.52, -1.42);

/// Names of the objects; the label of the first is 1.
pub(crate) const NAMES: [&str; 24] = [
    "rug",
    "sofa",
    "cushion",
    "table",
    "chair A",
    "chair B",
    "green book",
    "red book",
    "blue book",
    "mug",
    "saucer",
    "bowl",
    "oranges",
    "vase A",
    "tulips",
    "vase B",
    "vase C",
    "sideboard",
    "picture",
    "floor lamp",
    "plant",
    "ball",
    "teddy",
    "hat",
];

/// Label of an object by its name.
pub(crate) fn label(name: &str) -> u8 {
    NAMES.iter().position(|n| *n == name).map_or(0, |k| k as u8 + 1)
}

/// All solids of the room.
pub(crate) fn solids() -> Vec<Solid> {
    let mut b = Builder::default();
    shell(&mut b);
    window(&mut b);
    furniture::all(&mut b);
    things::all(&mut b);
    b.solids
}

fn shell(b: &mut Builder) {
    let white = Material::Plain(rgb(232, 228, 220));
    b.object(0, DVec3::ZERO, DMat3::IDENTITY);
    let (mx, mz) = ((LEFT + RIGHT) * 0.5, (BACK + FRONT) * 0.5);
    let (hx, hz) = ((RIGHT - LEFT) * 0.5 + 0.1, (FRONT - BACK) * 0.5 + 0.1);
    b.detail(0.0135, 0.045).add(Shape::Block(v(hx, 0.05, hz), 0.001), Material::Boards, v(mx, -0.05, mz));
    b.detail(0.03, 0.085);
    let sage = Material::Paint(rgb(176, 188, 168));
    let sand = Material::Paint(rgb(224, 214, 196));
    b.add(Shape::Block(v(hx, HIGH * 0.5, 0.05), 0.001), sage, v(mx, HIGH * 0.5, BACK - 0.05));
    b.add(Shape::Block(v(0.05, HIGH * 0.5, hz), 0.001), sand, v(LEFT - 0.05, HIGH * 0.5, mz));
    b.detail(0.015, 0.027);
    b.add(Shape::Block(v(hx, 0.055, 0.009), 0.004), white, v(mx, 0.055, BACK + 0.009));
    b.add(Shape::Block(v(0.009, 0.055, hz), 0.004), white, v(LEFT + 0.009, 0.055, mz));
}

fn window(b: &mut Builder) {
    let white = Material::Plain(rgb(238, 236, 230));
    let (hz, hy) = (WINDOW_HALF.x, WINDOW_HALF.y);
    b.object(0, v(LEFT, WINDOW.x, WINDOW.y), turn(1, 90.0));
    b.detail(0.022, 0.04).add(Shape::Block(v(hz, hy, 0.006), 0.001), Material::Outdoors(hz, hy), DVec3::ZERO);
    b.detail(0.0125, 0.019);
    for s in [-1.0, 1.0] {
        b.add(Shape::Block(v(0.035, hy + 0.07, 0.03), 0.006), white, v(s * (hz + 0.035), 0.0, 0.03));
        b.add(Shape::Block(v(hz + 0.07, 0.035, 0.03), 0.006), white, v(0.0, s * (hy + 0.035), 0.03));
    }
    b.add(Shape::Block(v(0.017, hy, 0.018), 0.005), white, v(0.0, 0.0, 0.018));
    b.add(Shape::Block(v(hz, 0.014, 0.016), 0.005), white, v(0.0, 0.12, 0.016));
    b.add(Shape::Block(v(hz + 0.13, 0.018, 0.075), 0.008), white, v(0.0, -hy - 0.085, 0.075));
    let linen = Material::Cloth(rgb(228, 214, 190));
    b.detail(0.018, 0.026);
    for s in [-1.0, 1.0] {
        b.add(Shape::Cloth(0.19, 0.98, 0.034, 8.0), linen, v(s * (hz + 0.24), -0.12, 0.12));
    }
    let iron = Material::Metal(rgb(70, 62, 56));
    b.detail(0.012, 0.03).rod(v(-hz - 0.5, 0.87, 0.12), v(hz + 0.5, 0.87, 0.12), 0.011, 0.011, iron);
}
