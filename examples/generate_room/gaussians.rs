//! From places on surfaces to the Gaussians that training would leave: coats, haze, hair, straddlers, junk and floaters.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use crate::cameras::{Camera, held_back, training};
use crate::field::Field;
use crate::light::{develop, highlight, shade};
use crate::materials::{Look, Material};
use crate::math::{Rng, fbm, frame_of, mix, smooth, v};
use crate::room::{BACK, FRONT, HIGH, LEFT, RIGHT};
use crate::sample::{Place, places, thin_out};
use crate::shapes::{Shape, Solid};

/// Label of Gaussians that belong to two objects at once: no score counts them.
pub(crate) const IGNORE: u8 = 255;

/// A Gaussian in the room's space.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Dab {
    /// Centre.
    pub(crate) at: DVec3,
    /// Columns: directions of its sides.
    pub(crate) axes: DMat3,
    /// Standard deviations along them, in metres.
    pub(crate) sigma: DVec3,
    /// 0..1.
    pub(crate) opacity: f64,
    /// For the display.
    pub(crate) color: DVec3,
    /// Colour of its highlight, zero for none.
    pub(crate) sheen: DVec3,
    /// Viewing direction, away from the eye, that mirrors the light.
    pub(crate) mirror: DVec3,
    /// Object, 0 or [`IGNORE`].
    pub(crate) label: u8,
}

/// All Gaussians of the room.
pub(crate) fn dabs(solids: &[Solid], seed: u64) -> Vec<Dab> {
    let field = Field::new(solids);
    let cameras: Vec<Camera> = training().into_iter().chain(held_back()).collect();
    // Each solid has a seed of its own, so that threads do not matter.
    let mut out: Vec<Dab> =
        (0..solids.len()).into_par_iter().flat_map_iter(|k| of_solid(&field, &cameras, k, seed)).collect();
    let mut rng = Rng::new(seed ^ 0xf10a);
    floaters(&field, &cameras, &mut rng, &mut out);
    out
}

/// Whether a face of floor or wall is one that a capture has, and how much of it is left towards its ends.
fn on_shell(solid: &Solid, at: DVec3, n: DVec3) -> f64 {
    match solid.material {
        Material::Boards | Material::Paint(_) => {}
        _ => return smooth(RIGHT + 0.05, RIGHT - 0.4, at.x) * smooth(FRONT + 0.05, FRONT - 0.4, at.z),
    }
    let inside = at.x > LEFT - 0.01 && at.z > BACK - 0.01 && at.y > -0.01;
    let ragged = 0.55 * (fbm(at * 1.9, 3) - 0.5);
    let left = smooth(RIGHT, RIGHT - 0.5, at.x + ragged)
        * smooth(FRONT, FRONT - 0.5, at.z + ragged)
        * smooth(HIGH, HIGH - 0.35, at.y + 0.6 * ragged);
    let facing = if matches!(solid.material, Material::Boards) { n.y > 0.9 } else { n.x > 0.9 || n.z > 0.9 };
    if inside && facing { left } else { 0.0 }
}

fn of_solid(field: &Field, cameras: &[Camera], index: usize, seed: u64) -> Vec<Dab> {
    let solid = &field.solids[index];
    let background = solid.label == 0;
    let spare = |at: DVec3, n: DVec3| {
        let behind = matches!(solid.shape, Shape::Cloth(..)) && (solid.axes.transpose() * n).z < 0.1;
        if background && (behind || on_shell(solid, at, n) <= 0.02) {
            return 0.0;
        }
        // Large ones stay clear of what stands near, or they would be drawn over it from aslant.
        0.5 * clearance(field, solid, at)
    };
    let mut rng = Rng::new(seed.wrapping_mul(31) ^ (index as u64) << 24);
    let small = !matches!(solid.material, Material::Boards | Material::Paint(_));
    let mut out = Vec::new();
    let mut coat = Vec::new();
    for place in places(solid, index, seed, &spare) {
        let fade = if background { on_shell(solid, place.at, place.normal) } else { 1.0 };
        if rng.unit() > fade {
            continue;
        }
        match buried(field, &place) {
            // A few Gaussians stay where two solids of one object meet, or under what stands on them.
            Some(deep) if deep < -0.004 && (background || rng.unit() > 0.06) => continue,
            _ => {}
        }
        let seen = cameras.iter().any(|c| {
            (c.at - place.at).dot(place.normal) > 0.0
                && c.frames(place.at)
                && field.clear(place.at + place.normal * 0.006, c.at)
        });
        if seen {
            coat.push(place);
        } else if matches!(solid.material, Material::Paint(_)) && behind_cloth(field, place.at) {
            // Behind curtains a wall is dim but whole: training sees glimpses of it.
            let dim = unseen(solid, &place, &mut rng);
            let light = look_at(solid, place.at, place.normal).albedo * rng.range(0.28, 0.42);
            out.push(Dab {
                opacity: rng.range(0.6, 0.95),
                sigma: dim.sigma * v(1.3, 1.6, 0.2),
                color: develop(light),
                ..dim
            });
        } else if !(background && small) && rng.unit() < if background { 0.06 } else { 0.20 } {
            out.push(unseen(solid, &place, &mut rng));
        }
    }
    if !solid.thin() {
        under(field, &coat, &mut rng, &mut out);
    }
    for place in &coat {
        visible(field, place, &mut rng, &mut out);
    }
    out
}

/// Whether hanging cloth is near.
fn behind_cloth(field: &Field, at: DVec3) -> bool {
    let near = field.near(at).iter().map(|&k| &field.solids[usize::from(k)]);
    near.filter(|s| matches!(s.shape, Shape::Cloth(..))).any(|s| s.distance(at) < 0.15)
}

/// How deep a place is inside another solid (negative), if it is.
fn buried(field: &Field, place: &Place) -> Option<f64> {
    let deepest = field
        .near(place.at)
        .iter()
        .filter(|&&k| usize::from(k) != place.solid)
        .map(|&k| field.solids[usize::from(k)].distance(place.at))
        .fold(f64::MAX, f64::min);
    (deepest < 0.0).then_some(deepest)
}

/// Distance from a place on a solid to the nearest solid of another object, up to half a metre.
fn clearance(field: &Field, solid: &Solid, at: DVec3) -> f64 {
    let others = field.near(at).iter().map(|&k| &field.solids[usize::from(k)]);
    let shell = |s: &Solid| matches!(s.material, Material::Boards | Material::Paint(_));
    // Of the background's own solids, walls and floor stay clear of the rest, which lies flat on them.
    let apart = |s: &&Solid| s.label != solid.label || (shell(solid) && !shell(s));
    others.filter(apart).map(|s| s.distance(at).max(0.0)).fold(0.5, f64::min)
}

/// The look of a solid at a place of the room on or near its surface.
fn look_at(solid: &Solid, at: DVec3, n: DVec3) -> Look {
    solid.material.look(solid.local(at), solid.axes.transpose() * n)
}

/// The mean look over what a Gaussian covers: its centre alone would break thin lines into dashes.
fn look_over(solid: &Solid, at: DVec3, axes: DMat3, sigma: DVec3) -> Look {
    let mut mean = Look { albedo: DVec3::ZERO, glow: DVec3::ZERO, gloss: 0.0 };
    for (x, y, w) in COVER {
        let look = look_at(solid, at + axes.x_axis * (x * sigma.x) + axes.y_axis * (y * sigma.y), axes.z_axis);
        mean.albedo += look.albedo * w;
        mean.glow += look.glow * w;
        mean.gloss += look.gloss * w;
    }
    mean
}

/// Offsets in deviations and weights of [`look_over`].
const COVER: [(f64, f64, f64); 9] = [
    (0.0, 0.0, 0.20),
    (0.8, 0.0, 0.12),
    (-0.8, 0.0, 0.12),
    (0.0, 0.8, 0.12),
    (0.0, -0.8, 0.12),
    (0.7, 0.7, 0.08),
    (-0.7, 0.7, 0.08),
    (0.7, -0.7, 0.08),
    (-0.7, -0.7, 0.08),
];

fn axes_of(place: &Place) -> DMat3 {
    DMat3::from_cols(place.along, place.normal.cross(place.along), place.normal)
}

/// A Gaussian on a face that no camera sees: fewer, larger, of a colour that nothing held in check.
fn unseen(solid: &Solid, place: &Place, rng: &mut Rng) -> Dab {
    let look = look_at(solid, place.at, place.normal);
    // What is no thicker than a shell must not show its other side through.
    let thin = solid.thin() || matches!(solid.shape, Shape::Turned(..));
    let s = place.spacing * if thin { rng.range(0.3, 0.5) } else { rng.range(0.5, 0.9) };
    let thick = if thin { 0.0008 } else { s * rng.range(0.10, 0.35) };
    Dab {
        at: place.at - place.normal * (0.5 * thick) + rng.normal3() * (0.1 * thick),
        axes: axes_of(place),
        sigma: v(s, s * rng.range(0.5, 1.0), thick),
        opacity: rng.range(0.1, 0.95),
        color: (develop(look.albedo * if thin { rng.range(0.15, 0.45) } else { rng.range(0.03, 0.35) })
            + rng.normal3() * 0.05)
            .clamp(DVec3::ZERO, DVec3::ONE),
        sheen: DVec3::ZERO,
        mirror: DVec3::Y,
        label: solid.label,
    }
}

/// A coat of large Gaussians just below plain faces, so that nothing shines through between the fine ones.
fn under(field: &Field, coat: &[Place], rng: &mut Rng, out: &mut Vec<Dab>) {
    let Some(first) = coat.first() else { return };
    let solid = &field.solids[first.solid];
    let flat = |p: &Place| {
        let across = p.normal.cross(p.along);
        [p.along, -p.along, across, -across].into_iter().all(|d| {
            let q = p.at + d * (p.spacing * 2.9);
            solid.distance(q).abs() < p.spacing * 0.35
        })
    };
    let plain: Vec<Place> = coat.iter().filter(|p| flat(p)).map(|p| Place { stretch: 1.0, ..*p }).collect();
    for place in thin_out(plain, solid.coarse, 2.3) {
        let s = (place.spacing * rng.range(1.55, 1.85)).min(0.02 + 0.6 * clearance(field, solid, place.at));
        let look = look_over(solid, place.at, axes_of(&place), DVec3::splat(s));
        let light = shade(field, place.at, place.normal, &look);
        out.push(Dab {
            at: place.at - place.normal * (0.25 * place.spacing).min(0.006),
            axes: axes_of(&place),
            sigma: v(s, s * rng.range(0.75, 1.0), (0.10 * s).min(0.003)),
            opacity: rng.range(0.9, 0.99),
            color: develop(light),
            sheen: DVec3::ZERO,
            mirror: DVec3::Y,
            label: solid.label,
        });
    }
}

/// What a seen place becomes: one Gaussian in the surface and, now and then, haze, hair, junk inside or a straddler.
fn visible(field: &Field, place: &Place, rng: &mut Rng, out: &mut Vec<Dab>) {
    let solid = &field.solids[place.solid];
    let axes = axes_of(place);
    // A blue-noise choice leaves holes of up to twice its spacing; fine pictures bear less blur than plain faces.
    let cover = (0.66 + 0.10 * place.plain) * place.spacing;
    let size = 1.0 + 0.10 * rng.normal();
    let mut sigma =
        v(cover * place.stretch * size, cover / place.stretch * size.max(0.85), (0.14 * cover).clamp(0.0006, 0.0035));
    if solid.thin() {
        sigma.z = sigma.z.min(0.0012);
    }
    // A large one near an edge would stand out beyond it.
    for k in 0..2 {
        let d = axes.col(k);
        for _ in 0..6 {
            let out_by =
                solid.distance(place.at + d * (1.7 * sigma[k])).max(solid.distance(place.at - d * (1.7 * sigma[k])));
            if out_by < 0.30 * sigma[k] || sigma[k] < 0.35 * solid.fine {
                break;
            }
            sigma[k] *= 0.82;
        }
    }
    let look = look_over(solid, place.at, axes, sigma);
    let light = shade(field, place.at, place.normal, &look);
    let color = develop(light);
    let rare = rng.unit() * rng.unit() * rng.unit();
    let opacity = (0.985 - 0.10 * rng.unit() - 0.5 * rare * rare).clamp(0.3, 0.99);
    let (mirror, sheen) = highlight(field, place.at, place.normal, look.gloss);
    let at = place.at + place.normal * (0.05 * cover * rng.normal());
    let dab = Dab { at, axes, sigma, opacity, color, sheen, mirror, label: solid.label };
    out.push(dab);
    if rng.unit() < 0.045 {
        let wide = DVec3::new(1.6, 1.6, 3.0) * rng.range(0.7, 1.5);
        let at = place.at + place.normal * (0.4 * cover * rng.normal()) + place.along * (0.5 * cover * rng.normal());
        let color = (color + rng.normal3() * 0.03).clamp(DVec3::ZERO, DVec3::ONE);
        out.push(Dab { at, sigma: sigma * wide, opacity: rng.range(0.02, 0.22), color, ..dab });
    }
    if let Material::Fur(_) = solid.material {
        for _ in 0..2 {
            hair(solid, place, light, rng, out);
        }
    }
    if solid.label != 0 && rng.unit() < 0.03 && !solid.thin() {
        let at = place.at - place.normal * rng.range(0.008, 0.07);
        if field.distance(at) < -0.004 {
            let s = rng.range(0.004, 0.02);
            let sigma = v(s, s * rng.range(0.2, 1.0), s * rng.range(0.1, 0.6));
            let axes = frame_of(rng.direction());
            let color = (color * rng.range(0.05, 0.6) + rng.normal3() * 0.04).clamp(DVec3::ZERO, DVec3::ONE);
            out.push(Dab { at, axes, sigma, opacity: rng.range(0.05, 0.8), color, sheen: DVec3::ZERO, ..dab });
        }
    }
    if rng.unit() < 0.22 {
        straddler(field, place, &dab, rng, out);
    }
}

/// A long thin Gaussian that stands out of fur.
fn hair(solid: &Solid, place: &Place, light: DVec3, rng: &mut Rng, out: &mut Vec<Dab>) {
    let small = (solid.shape.half().min_element() / 0.035).min(1.0);
    let long = rng.range(0.007, 0.015) * small;
    let lean = place.normal * 0.75 + v(0.0, -0.30, 0.0) + rng.normal3() * 0.38;
    let d = lean.normalize();
    let across = place.normal.cross(place.along);
    let root = place.at + (place.along * rng.normal() + across * rng.normal()) * (0.3 * place.spacing);
    let frame = frame_of(d);
    out.push(Dab {
        at: root + d * (0.35 * long),
        axes: DMat3::from_cols(frame.y_axis, frame.z_axis, frame.x_axis),
        sigma: v(long * 0.42, rng.range(0.0007, 0.0014), rng.range(0.0006, 0.0010)),
        opacity: rng.range(0.35, 0.9),
        color: develop(light * rng.range(0.72, 1.38)),
        sheen: DVec3::ZERO,
        mirror: DVec3::Y,
        label: solid.label,
    });
}

/// A Gaussian that covers the seam between this object and another that is close.
fn straddler(field: &Field, place: &Place, dab: &Dab, rng: &mut Rng, out: &mut Vec<Dab>) {
    let own = &field.solids[place.solid];
    let Some((gap, other)) = field
        .near(place.at)
        .iter()
        .map(|&k| &field.solids[usize::from(k)])
        .filter(|s| s.label != own.label)
        .map(|s| (s.distance(place.at), s))
        .min_by(|a, b| a.0.total_cmp(&b.0))
    else {
        return;
    };
    if !(-0.002..0.011).contains(&gap) {
        return;
    }
    let e = 1e-3;
    let slope = |d: DVec3| other.distance(place.at + d * e) - other.distance(place.at - d * e);
    let away = v(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z)).normalize_or_zero();
    let at = place.at - away * (gap * rng.range(0.1, 0.9));
    let look = look_at(other, at, away);
    let light = shade(field, at + away * 0.004, away, &look);
    let (here, there) = (own.distance(at).abs(), other.distance(at).abs());
    let s = rng.range(0.004, 0.009);
    let label = if (here - there).abs() < 0.15 * s {
        IGNORE
    } else if here < there {
        own.label
    } else {
        other.label
    };
    out.push(Dab {
        at,
        axes: DMat3::from_cols(dab.axes.x_axis, dab.axes.y_axis, dab.axes.z_axis),
        sigma: v(s, s * rng.range(0.4, 0.8), s * rng.range(0.2, 0.5)),
        opacity: rng.range(0.25, 0.85),
        color: mix(dab.color, develop(light), rng.range(0.3, 0.7)),
        sheen: DVec3::ZERO,
        mirror: DVec3::Y,
        label,
    });
}

/// Gaussians in the air, and large ones far behind the walls.
fn floaters(field: &Field, cameras: &[Camera], rng: &mut Rng, out: &mut Vec<Dab>) {
    let mut left = 700;
    while left > 0 {
        let toward = rng.unit() * rng.unit();
        let at = v(rng.range(LEFT, RIGHT), 0.05 + 2.4 * rng.unit() * rng.unit(), FRONT - (FRONT - BACK) * toward);
        if field.distance(at) < 0.02 || cameras.iter().any(|c| (c.at - at).length() < 0.6) {
            continue;
        }
        left -= 1;
        let s = 0.006 * libm::exp(0.75 * rng.normal().min(2.5));
        let grey = rng.range(0.25, 0.8);
        out.push(Dab {
            at,
            axes: frame_of(rng.direction()),
            sigma: v(s, s * rng.range(0.2, 1.0), s * rng.range(0.1, 0.8)),
            opacity: 0.02 + 0.5 * rng.unit() * rng.unit() * rng.unit(),
            color: (v(grey, grey * 0.96, grey * 0.9) + rng.normal3() * 0.05).clamp(DVec3::ZERO, DVec3::ONE),
            sheen: DVec3::ZERO,
            mirror: DVec3::Y,
            label: 0,
        });
    }
    for k in 0..40 {
        let s = rng.range(0.3, 1.4);
        let (x, y, z) = (rng.range(0.7, 4.0), rng.range(-0.5, 3.0), rng.range(-3.0, 3.0));
        let at = match k % 3 {
            0 => v(LEFT - 2.5 * s - x, y, z),
            1 => v(z, y, BACK - 2.5 * s - x),
            _ => v(z, -2.5 * s - x, y - 1.5),
        };
        out.push(Dab {
            at,
            axes: frame_of(rng.direction()),
            sigma: v(s, s * 0.7, s * 0.5),
            opacity: rng.range(0.1, 0.9),
            color: DVec3::splat(rng.range(0.05, 0.5)),
            sheen: DVec3::ZERO,
            mirror: DVec3::Y,
            label: 0,
        });
    }
}
