//! Procedural pictures on solids: colours are given sRGB-like and squared into linear light.

use glam::DVec3;

use crate::math::{fbm, hash3, mix, noise, smooth, v};

/// What a solid is made of; the textures live in the solid's own space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Material {
    /// Oak boards along x.
    Boards,
    /// Painted wall: colour.
    Paint(DVec3),
    /// Wood with its grain along an axis: colour, axis.
    Wood(DVec3, usize),
    /// Woven cloth: colour.
    Cloth(DVec3),
    /// The rug's pattern, for these half extents.
    Rug(f64, f64),
    /// Zigzag bands on a cushion.
    Zigzag(DVec3, DVec3),
    /// A book lying flat, back at -z: cover colour, colour of its print, half extents.
    Book(DVec3, DVec3, DVec3),
    /// Glazed clay with bands at a height: colour, colour of the bands, height of the middle band.
    Glaze(DVec3, DVec3, f64),
    /// Plain, slightly uneven: colour.
    Plain(DVec3),
    /// Metal: colour.
    Metal(DVec3),
    /// Fur: colour.
    Fur(DVec3),
    /// Knitted in rings: two colours.
    Knit(DVec3, DVec3),
    /// A ball of six coloured segments.
    Ball,
    /// The painting on the wall, for these half extents.
    Painting(f64, f64),
    /// What one sees through the window, for these half extents.
    Outdoors(f64, f64),
    /// The inside and outside of a lit lamp shade.
    Shade,
    /// A leaf along x: length, colour.
    Leaf(f64, DVec3),
    /// An orange.
    Orange,
    /// Earth in a pot.
    Soil,
}

/// How one place of a surface looks.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Look {
    /// Share of the light that it gives back, linear.
    pub(crate) albedo: DVec3,
    /// Light of its own, linear.
    pub(crate) glow: DVec3,
    /// Strength of its highlight, 0..1.
    pub(crate) gloss: f64,
}

/// A colour of 0..255 numbers.
pub(crate) const fn rgb(r: u8, g: u8, b: u8) -> DVec3 {
    DVec3::new(r as f64 / 255.0, g as f64 / 255.0, b as f64 / 255.0)
}

const CREAM: DVec3 = rgb(226, 211, 182);
const NAVY: DVec3 = rgb(38, 52, 84);
const WINE: DVec3 = rgb(138, 40, 44);
const OCHRE: DVec3 = rgb(201, 146, 62);

impl Material {
    /// The look at `p`, where the outward normal is `n`, both in the solid's space.
    pub(crate) fn look(&self, p: DVec3, n: DVec3) -> Look {
        let mut gloss = 0.0;
        let mut glow = DVec3::ZERO;
        let color = match *self {
            Material::Boards => boards(p),
            Material::Paint(c) => c * (0.985 + 0.03 * fbm(p * 1.1, 2)) * (0.992 + 0.016 * noise(p * 90.0)),
            Material::Wood(c, axis) => {
                gloss = 0.12;
                wood(c, p, axis)
            }
            Material::Cloth(c) => {
                let weave = noise(p * v(260.0, 260.0, 260.0));
                glow = c * c * if p.z.abs() < 0.05 && c.x > c.z { 0.10 } else { 0.0 };
                c * (0.90 + 0.10 * weave + 0.12 * (fbm(p * 7.0, 3) - 0.5))
            }
            Material::Rug(hx, hz) => rug(p, hx, hz) * (0.86 + 0.22 * noise(p * 150.0)),
            Material::Zigzag(a, b) => {
                let t = (p.x * 9.0 + (p.z * 14.0 - (p.z * 14.0).round()).abs() * 0.9).rem_euclid(1.0);
                let s = smooth(0.28, 0.34, t) * (1.0 - smooth(0.66, 0.72, t));
                let thin = smooth(0.80, 0.83, t) * (1.0 - smooth(0.87, 0.90, t));
                mix(mix(a, b, s), OCHRE, thin) * (0.92 + 0.14 * noise(p * 200.0))
            }
            Material::Book(cover, print, half) => book(cover, print, half, p, n),
            Material::Glaze(c, band, y) => {
                gloss = 1.0;
                let t = ((p.y - y) / 0.018).abs();
                let wide = 1.0 - smooth(0.9, 1.05, t);
                let thin = (smooth(1.5, 1.62, t) - smooth(1.9, 2.02, t)).max(0.0);
                let run = fbm(p * v(26.0, 7.0, 26.0), 3);
                mix(c * (0.78 + 0.4 * run), band, (wide + thin).min(1.0))
            }
            Material::Plain(c) => {
                gloss = 0.25;
                c * (0.97 + 0.05 * noise(p * 40.0))
            }
            Material::Metal(c) => {
                gloss = 0.8;
                c * (0.93 + 0.1 * noise(p * v(30.0, 160.0, 30.0)))
            }
            Material::Fur(c) => {
                let tuft = fbm(p * 85.0, 3);
                c * (0.66 + 0.55 * tuft)
            }
            Material::Knit(a, b) => {
                let ring = (p.y * 26.0).rem_euclid(1.0);
                let s = smooth(0.44, 0.5, ring) * (1.0 - smooth(0.94, 1.0, ring));
                let rib = (libm::sin(libm::atan2(p.z, p.x) * 34.0) * 0.5 + 0.5) * (0.6 + 0.4 * noise(p * 120.0));
                mix(a, b, s) * (0.74 + 0.32 * rib)
            }
            Material::Ball => {
                gloss = 0.8;
                ball(p)
            }
            Material::Painting(hx, hy) => painting(p.x / hx, p.y / hy),
            Material::Outdoors(hx, hy) => {
                let c = outdoors(p.x / hx, p.y / hy);
                glow = c * c * 1.25;
                DVec3::splat(0.05)
            }
            Material::Shade => {
                let outward = n.x * p.x + n.z * p.z;
                let height = smooth(-0.02, 0.24, p.y);
                let fibre = 0.92 + 0.12 * noise(p * v(40.0, 9.0, 40.0));
                glow = if outward > 0.0 {
                    v(0.95, 0.66, 0.34) * (0.5 + 0.45 * (1.0 - (2.0 * height - 0.9).abs())) * fibre
                } else {
                    v(1.25, 1.0, 0.62)
                };
                rgb(225, 205, 170)
            }
            Material::Leaf(length, c) => {
                gloss = 0.3;
                let u = p.x / length;
                let rib = 1.0 - smooth(0.0015, 0.004, p.z.abs());
                let vein = 1.0 - smooth(0.04, 0.13, ((u * 11.0 - p.z.abs() * 60.0).rem_euclid(1.0) - 0.5).abs());
                let base = c * (0.75 + 0.4 * fbm(p * 35.0, 2));
                mix(mix(base, c * 1.25, 0.35 * vein), rgb(170, 190, 110), 0.8 * rib)
            }
            Material::Orange => {
                gloss = 0.35;
                let pit = noise(p * 320.0);
                let navel = smooth(0.012, 0.004, (p.x * p.x + p.z * p.z).sqrt()) * smooth(0.0, 0.02, p.y);
                mix(rgb(236, 138, 32) * (0.86 + 0.18 * pit), rgb(92, 96, 40), navel)
            }
            Material::Soil => rgb(64, 47, 36) * (0.5 + 0.9 * fbm(p * 90.0, 3)),
        };
        let c = color.clamp(DVec3::ZERO, DVec3::ONE);
        Look { albedo: c * c, glow, gloss }
    }
}

/// Lines of grain along `axis`.
fn wood(c: DVec3, p: DVec3, axis: usize) -> DVec3 {
    let q = match axis {
        0 => p,
        1 => v(p.y, p.x, p.z),
        _ => v(p.z, p.x, p.y),
    };
    let warp = fbm(q * v(1.6, 7.0, 7.0), 3);
    let ring = ((q.z * 34.0 + q.y * 22.0 + warp * 5.0).rem_euclid(1.0) - 0.5).abs() * 2.0;
    let fine = noise(q * v(7.0, 240.0, 240.0));
    c * (0.80 + 0.16 * ring + 0.10 * fine + 0.18 * (warp - 0.5))
}

fn boards(p: DVec3) -> DVec3 {
    let (wide, long) = (0.155, 1.35);
    let row = (p.z / wide).floor();
    let shift = hash3(row as i64, 3, 1) * long;
    let column = ((p.x + shift) / long).floor();
    let tone = hash3(row as i64, column as i64, 7);
    let warm = hash3(row as i64, column as i64, 8);
    let across = (p.z / wide - row - 0.5).abs() * wide;
    let along = ((p.x + shift) / long - column - 0.5).abs() * long;
    let seam = smooth(0.5 * wide - 0.0045, 0.5 * wide - 0.001, across).max(smooth(
        0.5 * long - 0.004,
        0.5 * long - 0.001,
        along,
    ));
    let q = p + v(tone * 31.0, 0.0, warm * 17.0);
    let base = mix(rgb(196, 147, 98), rgb(160, 108, 66), tone);
    let base = mix(base, rgb(190, 150, 112), 0.45 * warm);
    let warp = fbm(q * v(1.1, 1.0, 9.0), 3);
    let ring = ((q.z * 30.0 + warp * 7.0).rem_euclid(1.0) - 0.5).abs() * 2.0;
    let fine = noise(q * v(6.0, 1.0, 220.0));
    let knot = smooth(0.035, 0.0, length(q.x.rem_euclid(1.9) - 0.9, (across - 0.03) * 1.8)) * smooth(0.55, 0.6, tone);
    let grained = base * (0.82 + 0.17 * ring + 0.11 * fine + 0.16 * (warp - 0.5));
    mix(mix(grained, rgb(74, 44, 26), 0.7 * knot), rgb(46, 30, 20), 0.85 * seam)
}

fn rug(p: DVec3, hx: f64, hz: f64) -> DVec3 {
    let edge = (hx - p.x.abs()).min(hz - p.z.abs());
    let line = |at: f64, w: f64| smooth(at - w, at - w + 0.006, edge) * (1.0 - smooth(at + w - 0.006, at + w, edge));
    // The border: a chain of diamonds between two lines.
    let run = if hx - p.x.abs() < hz - p.z.abs() { p.z } else { p.x };
    let u = (run / 0.11).rem_euclid(1.0) - 0.5;
    let diamond = u.abs() * 0.11 + (edge - 0.115).abs();
    let mut border = mix(WINE, CREAM, 1.0 - smooth(0.034, 0.041, diamond));
    border = mix(border, NAVY, 1.0 - smooth(0.014, 0.021, diamond));
    // The field: a lattice of small crosses, a large stepped medallion in the middle.
    let (gx, gz) = ((p.x / 0.16).round(), (p.z / 0.16).round());
    let (lx, lz) = ((p.x - gx * 0.16).abs(), (p.z - gz * 0.16).abs());
    let cross = (lx + lz).min(0.5 * lx + 3.0 * lz).min(3.0 * lx + 0.5 * lz);
    let odd = (gx as i64 + gz as i64).rem_euclid(2) == 0;
    let mut field = mix(NAVY, if odd { OCHRE } else { CREAM }, 1.0 - smooth(0.022, 0.03, cross));
    let m = (p.x.abs() / 0.56).max(0.0) + p.z.abs() / 0.40 + 0.05 * ((p.x * 26.0).round().abs() % 2.0);
    field = mix(field, CREAM, 1.0 - smooth(1.0, 1.02, m));
    field = mix(field, WINE, 1.0 - smooth(0.92, 0.94, m));
    field = mix(field, OCHRE, (1.0 - smooth(0.62, 0.64, m)) * smooth(0.54, 0.56, m));
    field = mix(field, NAVY, 1.0 - smooth(0.36, 0.38, m));
    field = mix(field, CREAM, 1.0 - smooth(0.14, 0.16, m));
    let inner = smooth(0.188, 0.194, edge);
    let mut c = mix(border, field, inner);
    for (at, w) in [(0.055, 0.010), (0.178, 0.012)] {
        c = mix(c, CREAM, line(at, w));
    }
    mix(c, NAVY, 1.0 - smooth(0.030, 0.036, edge))
}

fn book(cover: DVec3, print: DVec3, half: DVec3, p: DVec3, n: DVec3) -> DVec3 {
    let leaves = n.x.abs() > 0.7 || n.z > 0.7;
    if leaves && p.y.abs() < half.y - 0.004 {
        let sheet = noise(v(p.x * 12.0, p.y * 900.0, p.z * 12.0));
        return rgb(232, 222, 198) * (0.80 + 0.22 * sheet);
    }
    let mut c = cover * (0.94 + 0.1 * noise(p * 160.0));
    if n.y.abs() > 0.7 {
        let (x, z) = (p.x / half.x, p.z / half.z);
        let frame = (x.abs() * half.x - (half.x - 0.014)).abs().min((z.abs() * half.z - (half.z - 0.014)).abs());
        let inside = x.abs() * half.x < half.x - 0.011 && z.abs() * half.z < half.z - 0.011;
        if inside {
            c = mix(c, print, 1.0 - smooth(0.0012, 0.0030, frame));
        }
        // Two lines of a title and a round emblem.
        for (at, wide, tall) in [(-0.34, 0.62, 0.05), (-0.16, 0.44, 0.035)] {
            let letters = noise(v(p.x * 130.0, at * 50.0, 2.0)) > 0.36;
            if (z - at).abs() < tall && x.abs() < wide && letters {
                c = print;
            }
        }
        let ring = (length(p.x, p.z - 0.42 * half.z) - 0.028).abs();
        c = mix(c, print, 1.0 - smooth(0.004, 0.0065, ring));
    } else if n.z < -0.7 {
        let band = 1.0 - smooth(0.006, 0.008, (p.x.abs() - 0.62 * half.x).abs());
        let letters = noise(v(p.x * 140.0, 1.0, 5.0)) > 0.42 && p.y.abs() < half.y * 0.42 && p.x.abs() < 0.45 * half.x;
        c = mix(c, print, if letters { 1.0 } else { band });
    }
    c
}

fn ball(p: DVec3) -> DVec3 {
    let d = p.normalize_or_zero();
    let turn = libm::atan2(d.z, d.x) / std::f64::consts::TAU * 6.0 + 6.0;
    let k = turn.floor() as usize % 6;
    let colors = [
        rgb(214, 58, 46),
        rgb(240, 236, 226),
        rgb(240, 186, 48),
        rgb(52, 118, 178),
        rgb(240, 236, 226),
        rgb(64, 148, 92),
    ];
    let near = (turn - turn.round()).abs() * (1.0 - d.y * d.y).max(0.0).sqrt();
    let c = mix(colors[k], rgb(206, 202, 196), 1.0 - smooth(0.014, 0.034, near));
    mix(rgb(244, 242, 238), c, smooth(0.13, 0.155, (1.0 - d.y.abs()) * 2.0))
}

/// A landscape with hills, a lake and a low sun; x and y in -1..1.
fn painting(x: f64, y: f64) -> DVec3 {
    if x.abs() > 0.86 || y.abs() > 0.82 {
        return rgb(238, 234, 224);
    }
    let stroke = fbm(v(x * 9.0, y * 26.0, 1.0), 3) - 0.5;
    let sky = mix(rgb(244, 196, 120), rgb(96, 142, 178), smooth(-0.1, 0.8, y + 0.25 * stroke));
    let sun = length(x - 0.3, (y - 0.22) * 0.72);
    let mut c = mix(sky, rgb(255, 236, 190), 1.0 - smooth(0.10, 0.16, sun));
    for (k, (base, tall, color)) in
        [(0.10, 0.34, rgb(116, 128, 152)), (-0.08, 0.26, rgb(74, 96, 110)), (-0.30, 0.20, rgb(52, 78, 66))]
            .into_iter()
            .enumerate()
    {
        let ridge = base + tall * (fbm(v(x * 1.7 + k as f64 * 7.3, k as f64, 0.0), 3) - 0.45);
        c = mix(c, color * (1.0 + 0.5 * stroke), 1.0 - smooth(ridge - 0.02, ridge + 0.02, y));
    }
    let shore = -0.42 + 0.05 * noise(v(x * 3.0, 4.0, 0.0));
    let ripple = noise(v(x * 6.0, y * 60.0, 3.0));
    let glint = (1.0 - smooth(0.0, 0.22, (x - 0.3).abs())) * smooth(0.45, 0.7, ripple);
    let lake = mix(mix(rgb(70, 108, 132), rgb(120, 150, 156), ripple), rgb(252, 218, 150), glint);
    mix(c, lake, 1.0 - smooth(shore - 0.02, shore + 0.01, y))
}

/// A bright garden, out of focus; x and y in -1..1.
fn outdoors(x: f64, y: f64) -> DVec3 {
    let sky = mix(rgb(236, 240, 242), rgb(168, 204, 238), smooth(-0.2, 1.0, y));
    let tree = -0.1 + 0.6 * (fbm(v(x * 1.6 + 2.0, 1.0, 0.5), 3) - 0.4);
    let leaves = mix(rgb(120, 160, 88), rgb(186, 206, 130), fbm(v(x * 5.0, y * 5.0, 2.0), 2));
    let c = mix(sky, leaves, 1.0 - smooth(tree - 0.12, tree + 0.12, y));
    mix(c, rgb(206, 216, 160), 1.0 - smooth(-0.75, -0.45, y))
}

fn length(x: f64, y: f64) -> f64 {
    (x * x + y * y).sqrt()
}
