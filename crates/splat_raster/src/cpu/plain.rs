//! Scalar blending of tiles.

use glam::{Mat3, Vec3};
use rayon::prelude::*;
use splat_core::{Projection, Selection, View, sh};

use crate::{Frame, Outputs, Scene, Votes};

const TILE: usize = 16;

#[derive(Clone, Copy)]
struct Splat {
    id: u32,
    u: f32,
    v: f32,
    conic: [f32; 3],
    opacity: f32,
    color: [f32; 3],
    z: f32,
    tiles: [u32; 4],
}

fn project(scene: &Scene, view: &View, want_color: bool) -> Vec<Splat> {
    let (w, h) = (view.width as f32, view.height as f32);
    let i = &view.intrinsics;
    let (tan_x, tan_y) = (0.5 * w / i.fx, 0.5 * h / i.fy);
    let x_limits = (-(i.cx / i.fx + 0.3 * tan_x), (w - i.cx) / i.fx + 0.3 * tan_x);
    let y_limits = (-(i.cy / i.fy + 0.3 * tan_y), (h - i.cy) / i.fy + 0.3 * tan_y);
    let mut splats = Vec::new();
    for (k, instance) in scene.instances.iter().enumerate() {
        let offset = scene.offset(k) as u32;
        let cloud = &*instance.cloud;
        let turn = instance.transform.rotation_matrix();
        let view_from_cloud = view.pose.world_from_view.transpose() * turn * instance.transform.scale;
        let camera = instance.transform.inverse().apply(view.pose.position);
        let forward = (turn.transpose() * view.forward()).normalize_or_zero();
        let antialiased = cloud.source().antialiased;
        let part: Vec<Splat> = (0..cloud.len())
            .into_par_iter()
            .filter_map(|g| {
                if instance.hidden.as_ref().is_some_and(|s| s.contains(g)) || !cloud.drawable(g) {
                    return None;
                }
                let t = view.to_view(instance.transform.apply(cloud.means()[g]));
                if !(t.z > view.near) {
                    return None;
                }
                let (u, v, j0, j1);
                if view.projection == Projection::Perspective {
                    (u, v) = (i.fx * t.x / t.z + i.cx, i.fy * t.y / t.z + i.cy);
                    let x = (t.x / t.z).clamp(x_limits.0, x_limits.1);
                    let y = (t.y / t.z).clamp(y_limits.0, y_limits.1);
                    j0 = Vec3::new(i.fx / t.z, 0.0, -i.fx * x / t.z);
                    j1 = Vec3::new(0.0, i.fy / t.z, -i.fy * y / t.z);
                } else {
                    (u, v) = (i.fx * t.x + i.cx, i.fy * t.y + i.cy);
                    j0 = Vec3::new(i.fx, 0.0, 0.0);
                    j1 = Vec3::new(0.0, i.fy, 0.0);
                }
                let m = view_from_cloud * Mat3::from_quat(cloud.rotation(g)) * Mat3::from_diagonal(cloud.scale(g));
                let (p, q) = (m.transpose() * j0, m.transpose() * j1);
                let det0 = p.cross(q).length_squared();
                let (a0, b, c0) = (p.length_squared(), p.dot(q), q.length_squared());
                let (a, c) = (a0 + 0.3, c0 + 0.3);
                let det = det0 + 0.3 * (a0 + c0) + 0.09;
                let mut opacity = cloud.opacity(g);
                if antialiased {
                    opacity *= (det0 / det).max(0.0).sqrt();
                }
                let reach = 2.0 * (255.0 * opacity).ln();
                if !(reach >= 0.0) || !(det > 0.0) || !det.is_finite() {
                    return None;
                }
                let (hw, hh) = ((reach * a).sqrt() + 0.01, (reach * c).sqrt() + 0.01);
                let (x0, x1) = ((u - hw - 0.5).ceil().max(0.0), (u + hw - 0.5).floor().min(w - 1.0));
                let (y0, y1) = ((v - hh - 0.5).ceil().max(0.0), (v + hh - 0.5).floor().min(h - 1.0));
                if !(x0 <= x1 && y0 <= y1) {
                    return None;
                }
                let direction = match view.projection {
                    Projection::Perspective => (cloud.means()[g] - camera).normalize_or_zero(),
                    Projection::Orthographic => forward,
                };
                let color = if want_color {
                    sh::color(cloud.sh_degree(), cloud.sh_of(g), direction).to_array()
                } else {
                    [0.0; 3]
                };
                let tile = |x: f32| x as u32 / TILE as u32;
                Some(Splat {
                    id: offset + g as u32,
                    u,
                    v,
                    conic: [c / det, -b / det, a / det],
                    opacity,
                    color,
                    z: t.z,
                    tiles: [tile(x0), tile(y0), tile(x1), tile(y1)],
                })
            })
            .collect();
        splats.extend(part);
    }
    splats.par_sort_by_key(|s| s.z.to_bits());
    splats
}

struct Tile {
    color: Vec<[f32; 4]>,
    median: Vec<f32>,
    expected: Vec<f32>,
    features: Vec<f32>,
    hits: Vec<u32>,
    strongest: Vec<u32>,
    seen: Vec<u32>,
    votes: Vec<(u32, u64, Vec<u64>)>,
}

/// Draws the whole frame.
pub(super) fn draw(scene: &Scene, view: &View, outputs: &Outputs, frame: &mut Frame) {
    let splats = project(scene, view, outputs.color);
    let (w, h) = (view.width as usize, view.height as usize);
    let (across, down) = (w.div_ceil(TILE), h.div_ceil(TILE));
    let mut lists = vec![Vec::new(); across * down];
    for (k, s) in splats.iter().enumerate() {
        for ty in s.tiles[1]..=s.tiles[3] {
            for tx in s.tiles[0]..=s.tiles[2] {
                lists[ty as usize * across + tx as usize].push(k as u32);
            }
        }
    }
    let tiles: Vec<Tile> = lists
        .par_iter()
        .enumerate()
        .map(|(k, list)| tile(&splats, list, (k % across * TILE, k / across * TILE), (w, h), outputs))
        .collect();
    *frame = Frame { width: view.width, height: view.height, ..Frame::default() };
    let count = scene.len();
    let channels = outputs.features.map_or(0, |f| f.channels);
    let sized = |on: bool| if on { w * h } else { 0 };
    frame.color = vec![[0.0; 4]; sized(outputs.color)];
    frame.median_depth = vec![f32::NAN; sized(outputs.median_depth)];
    frame.expected_depth = vec![f32::NAN; sized(outputs.expected_depth)];
    frame.features = vec![0.0; w * h * channels];
    frame.first_hits = vec![Frame::NO_ID; sized(outputs.first_hits.is_some())];
    frame.strongest = vec![Frame::NO_ID; sized(outputs.strongest)];
    if outputs.visibility.is_some() {
        frame.visibility = Selection::none(count);
    }
    if let Some(masks) = outputs.votes {
        frame.votes = Votes { inside: vec![vec![0; count]; masks.len()], total: vec![0; count] };
    }
    for (k, tile) in tiles.iter().enumerate() {
        let (x0, y0) = (k % across * TILE, k / across * TILE);
        for y in y0..(y0 + TILE).min(h) {
            for x in x0..(x0 + TILE).min(w) {
                let (to, from) = (y * w + x, (y - y0) * TILE + x - x0);
                if outputs.color {
                    frame.color[to] = tile.color[from];
                }
                if outputs.median_depth {
                    frame.median_depth[to] = tile.median[from];
                }
                if outputs.expected_depth {
                    frame.expected_depth[to] = tile.expected[from];
                }
                if outputs.first_hits.is_some() {
                    frame.first_hits[to] = tile.hits[from];
                }
                if outputs.strongest {
                    frame.strongest[to] = tile.strongest[from];
                }
                frame.features[to * channels..(to + 1) * channels]
                    .copy_from_slice(&tile.features[from * channels..(from + 1) * channels]);
            }
        }
        for &id in &tile.seen {
            frame.visibility.insert(id as usize);
        }
        for (id, total, inside) in &tile.votes {
            frame.votes.total[*id as usize] += total;
            for (m, v) in inside.iter().enumerate() {
                frame.votes.inside[m][*id as usize] += v;
            }
        }
    }
    for inside in &mut frame.votes.inside {
        for v in inside {
            *v /= 255;
        }
    }
}

fn tile(splats: &[Splat], list: &[u32], (x0, y0): (usize, usize), (w, h): (usize, usize), outputs: &Outputs) -> Tile {
    const N: usize = TILE * TILE;
    let channels = outputs.features.map_or(0, |f| f.channels);
    let masks = outputs.votes.unwrap_or_default();
    let mut out = Tile {
        color: vec![[0.0; 4]; N],
        median: vec![f32::NAN; N],
        expected: vec![0.0; N],
        features: vec![0.0; N * channels],
        hits: vec![Frame::NO_ID; N],
        strongest: vec![Frame::NO_ID; N],
        seen: Vec::new(),
        votes: Vec::new(),
    };
    let mut t = [1.0f32; N];
    let mut best = [0.0f32; N];
    let mut open = [false; N];
    let mut left = 0;
    for y in 0..TILE.min(h - y0) {
        for x in 0..TILE.min(w - x0) {
            open[y * TILE + x] = true;
            left += 1;
        }
    }
    for &k in list {
        if left == 0 {
            break;
        }
        let s = &splats[k as usize];
        let (mut largest, mut total, mut inside) = (0.0f32, 0u64, vec![0u64; masks.len()]);
        for y in 0..TILE {
            for x in 0..TILE {
                let n = y * TILE + x;
                if !open[n] {
                    continue;
                }
                let (dx, dy) = ((x0 + x) as f32 + 0.5 - s.u, (y0 + y) as f32 + 0.5 - s.v);
                let q = s.conic[0] * dx * dx + 2.0 * s.conic[1] * dx * dy + s.conic[2] * dy * dy;
                let alpha = (s.opacity * (-0.5 * q).exp()).min(0.99);
                if !(alpha >= 1.0 / 255.0) {
                    continue;
                }
                let after = t[n] * (1.0 - alpha);
                if after < 1e-4 {
                    open[n] = false;
                    left -= 1;
                    continue;
                }
                let weight = alpha * t[n];
                for c in 0..3 {
                    out.color[n][c] += weight * s.color[c];
                }
                out.expected[n] += weight * s.z;
                if t[n] > 0.5 && after <= 0.5 {
                    out.median[n] = s.z;
                }
                if let Some(tau) = outputs.first_hits {
                    if out.hits[n] == Frame::NO_ID && after <= 1.0 - tau {
                        out.hits[n] = s.id;
                    }
                }
                if weight > best[n] {
                    best[n] = weight;
                    out.strongest[n] = s.id;
                }
                if let Some(features) = &outputs.features {
                    let f = &features.values[s.id as usize * channels..][..channels];
                    for (sum, f) in out.features[n * channels..].iter_mut().zip(f) {
                        *sum += weight * f;
                    }
                }
                largest = largest.max(weight);
                if outputs.votes.is_some() {
                    let unit = (weight * 65_536.0).round_ties_even() as u64;
                    total += unit;
                    for (sum, mask) in inside.iter_mut().zip(masks) {
                        *sum += unit * u64::from(mask.values()[(y0 + y) * w + x0 + x]);
                    }
                }
                t[n] = after;
            }
        }
        if outputs.visibility.is_some_and(|threshold| largest > threshold) {
            out.seen.push(s.id);
        }
        if total > 0 {
            out.votes.push((s.id, total, inside));
        }
    }
    for n in 0..N {
        let sum = 1.0 - t[n];
        out.color[n][3] = sum;
        out.expected[n] = if sum > 1e-3 { out.expected[n] / sum } else { f32::NAN };
    }
    out
}
