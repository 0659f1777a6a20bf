//! Gaussians on surfaces: a shell of cells, candidates pulled onto the surface, and of those a blue-noise choice whose
//! spacing and stretch follow the picture on the surface and its curvature.

use std::collections::HashMap;

use glam::DVec3;

use crate::math::{Rng, frame_of, sin_cos, smooth};
use crate::shapes::Solid;

/// A place chosen for a Gaussian.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    /// On the surface, in the room.
    pub(crate) at: DVec3,
    /// Outward normal.
    pub(crate) normal: DVec3,
    /// Direction of its longer side.
    pub(crate) along: DVec3,
    /// Distance to its neighbours, in metres.
    pub(crate) spacing: f64,
    /// Longer side over spacing; its shorter side is spacing over this.
    pub(crate) stretch: f64,
    /// 1 where nothing changes around it, 0 on a fine picture or an edge.
    pub(crate) plain: f64,
    /// Which solid.
    pub(crate) solid: usize,
}

/// Longest stretch: sides of 1 to 4.
const STRETCH: f64 = 2.0;

fn normal(solid: &Solid, p: DVec3) -> DVec3 {
    let e = 5e-4;
    let d = |x: f64, y: f64, z: f64| solid.shape.distance(p + DVec3::new(x, y, z));
    DVec3::new(d(e, 0.0, 0.0) - d(-e, 0.0, 0.0), d(0.0, e, 0.0) - d(0.0, -e, 0.0), d(0.0, 0.0, e) - d(0.0, 0.0, -e))
        .normalize_or(DVec3::Y)
}

/// Pulls a point onto the surface; `None` where it does not come to rest.
fn pull(solid: &Solid, mut p: DVec3) -> Option<(DVec3, DVec3)> {
    let mut n = DVec3::Y;
    for _ in 0..6 {
        n = normal(solid, p);
        let d = solid.shape.distance(p);
        p -= n * d;
        if d.abs() < 1e-4 {
            return Some((p, n));
        }
    }
    (solid.shape.distance(p).abs() < 8e-4).then_some((p, n))
}

/// Cells of side `size` that the surface may pass through.
fn shell(solid: &Solid, size: f64) -> Vec<DVec3> {
    let (middle, half) = (solid.shape.middle(), solid.shape.half() + DVec3::splat(size));
    let levels = (0..24).find(|&k| size * f64::from(1 << k) >= half.max_element() * 2.0).unwrap_or(24);
    let side = size * f64::from(1 << levels);
    let n = (half * 2.0 / side).ceil().max(DVec3::ONE);
    let mut todo = Vec::new();
    for x in 0..n.x as usize {
        for y in 0..n.y as usize {
            for z in 0..n.z as usize {
                let k = DVec3::new(x as f64, y as f64, z as f64) + DVec3::splat(0.5) - n * 0.5;
                todo.push((middle + k * side, side));
            }
        }
    }
    let mut out = Vec::new();
    while let Some((at, side)) = todo.pop() {
        // Some distances are bounds from below: the reach of a cell is its half diagonal, no less.
        if solid.shape.distance(at).abs() > side * 0.87 || ((at - middle).abs() - half).max_element() > side * 0.5 {
            continue;
        }
        if side <= size * 1.001 {
            out.push(at);
            continue;
        }
        for k in 0..8 {
            let s = |bit: i32| if k >> bit & 1 == 1 { 0.25 } else { -0.25 };
            todo.push((at + DVec3::new(s(0), s(1), s(2)) * side, side * 0.5));
        }
    }
    out
}

/// What changes about a point when it moves by `d` and back: light given back, and the normal.
fn change(solid: &Solid, p: DVec3, d: DVec3) -> f64 {
    let both = [p + d, p - d].map(|q| {
        let n = normal(solid, q);
        let q = q - n * solid.shape.distance(q);
        let look = solid.material.look(q, n);
        ((look.albedo + look.glow).max(DVec3::ZERO).min(DVec3::ONE), n)
    });
    let color = both[0].0 - both[1].0;
    let color = (color * color).element_sum().sqrt() / (0.25 + both[0].0.max(both[1].0).max_element().sqrt());
    color * 3.2 + (both[0].1 - both[1].1).length() * 0.55
}

/// Places on one solid, in a shuffled order; `room` tells by place and normal in the room the largest
/// spacing there, zero where nothing is wanted.
pub(crate) fn places(solid: &Solid, index: usize, seed: u64, room: &dyn Fn(DVec3, DVec3) -> f64) -> Vec<Place> {
    let mut rng = Rng::new(seed ^ (index as u64) << 20);
    let size = solid.fine;
    let mut candidates = Vec::new();
    for cell in shell(solid, size) {
        for _ in 0..2 {
            let start = cell + (rng.normal3() * 0.3).clamp(DVec3::splat(-0.6), DVec3::splat(0.6)) * size;
            let Some((p, n)) = pull(solid, start) else { continue };
            let (at, normal) = (solid.world(p), (solid.axes * n).normalize());
            let largest = room(at, normal);
            if largest <= 0.0 {
                continue;
            }
            let frame = frame_of(n);
            let mut most = (0.0, 0usize);
            let mut least = f64::MAX;
            for k in 0..4 {
                let (s, c) = sin_cos(k as f64 * std::f64::consts::FRAC_PI_4);
                let d = (frame.x_axis * c + frame.z_axis * s) * (size * 0.8);
                let x = change(solid, p, d);
                least = least.min(x);
                if x > most.0 {
                    most = (x, k);
                }
            }
            let busy = smooth(0.02, 0.55, most.0);
            let spacing = solid.coarse + (solid.fine - solid.coarse) * busy.sqrt();
            let spacing = spacing.min(largest.max(solid.fine));
            let ratio = if busy > 0.02 { ((most.0 + 0.03) / (least + 0.03)).sqrt().clamp(1.0, STRETCH) } else { 1.0 };
            // The longer side lies across the strongest change.
            let turn = if busy > 0.02 {
                (most.1 as f64 + 2.0) * std::f64::consts::FRAC_PI_4
            } else {
                (rng.unit() * 8.0).floor() * std::f64::consts::FRAC_PI_4
            };
            let (s, c) = sin_cos(turn);
            let along = (solid.axes * (frame.x_axis * c + frame.z_axis * s)).normalize();
            candidates.push(Place { at, normal, along, spacing, stretch: ratio, plain: 1.0 - busy, solid: index });
        }
    }
    for k in (1..candidates.len()).rev() {
        let j = (rng.unit() * (k + 1) as f64) as usize;
        candidates.swap(k, j);
    }
    thin_out(candidates, solid.coarse, 1.0)
}

/// Keeps candidates, first come first served, that are no nearer to each other than their spacing times `factor`,
/// measured along and across their sides. `largest`: the largest spacing.
pub(crate) fn thin_out(candidates: Vec<Place>, largest: f64, factor: f64) -> Vec<Place> {
    let cell = largest * factor;
    let reach = if candidates.iter().any(|c| c.stretch > 1.01) { STRETCH.ceil() as i64 } else { 1 };
    let mut grid: HashMap<(i64, i64, i64), Vec<u32>> = HashMap::new();
    let mut kept: Vec<Place> = Vec::new();
    let key = |p: DVec3| {
        let q = (p / cell).floor();
        (q.x as i64, q.y as i64, q.z as i64)
    };
    for c in candidates {
        let (x, y, z) = key(c.at);
        let free = (-reach..=reach).all(|i| {
            (-reach..=reach).all(|j| {
                (-reach..=reach).all(|k| {
                    grid.get(&(x + i, y + j, z + k)).is_none_or(|list| {
                        list.iter().all(|&o| {
                            let o = &kept[o as usize];
                            let r = 0.5 * (c.spacing + o.spacing) * factor;
                            let d = o.at - c.at;
                            let far = r * STRETCH;
                            if d.length_squared() >= far * far {
                                return true;
                            }
                            // Two faces of a thin sheet do not thin each other out.
                            let apart = if c.normal.dot(o.normal) < 0.0 { r * r } else { 0.0 };
                            0.5 * (measure(&c, d) + measure(o, d)) + apart >= r * r
                        })
                    })
                })
            })
        });
        if free {
            grid.entry((x, y, z)).or_default().push(kept.len() as u32);
            kept.push(c);
        }
    }
    kept
}

/// Squared length of `d` where the longer side of a place counts less and its shorter side more.
fn measure(place: &Place, d: DVec3) -> f64 {
    let a = place.along.dot(d) / place.stretch;
    let b = place.along.cross(place.normal).dot(d) * place.stretch;
    let n = place.normal.dot(d);
    a * a + b * b + n * n
}
