//! A frame in f64, straight from the formulas, one Gaussian after the other: slow and obvious.
//!
//! It also says where a decision (a threshold, an order) hangs on rounding, so that pictures can be compared closely
//! everywhere else.

use splat_core::glam::{DMat3, DQuat, DVec3};
use splat_core::{Projection, View};
use splat_raster::{Frame, Scene};

/// The picture of everything.
pub(crate) struct SlowFrame {
    pub(crate) color: Vec<[f64; 4]>,
    pub(crate) median: Vec<f64>,
    pub(crate) expected: Vec<f64>,
    pub(crate) features: Vec<f64>,
    pub(crate) hits: Vec<u32>,
    pub(crate) strongest: Vec<u32>,
    /// Largest weight per Gaussian over pixels that are not in doubt.
    pub(crate) largest: Vec<f64>,
    /// Sum of weights per Gaussian.
    pub(crate) total: Vec<f64>,
    /// Sum of weights per Gaussian over pixels that are not in doubt.
    pub(crate) certain: Vec<f64>,
    /// Pixels where a contribution is near a threshold or two are nearly equally deep.
    pub(crate) doubt: Vec<bool>,
    /// Pixels where T comes near the threshold of the median or the first hit, or the strongest is nearly a tie.
    pub(crate) pick_doubt: Vec<bool>,
}

struct Projected {
    id: usize,
    mean: [f64; 2],
    conic: [f64; 3],
    opacity: f64,
    z: f64,
    color: [f64; 3],
    radius: f64,
}

fn harmonics(degree: u8, d: DVec3) -> Vec<f64> {
    let (x, y, z) = (d.x, d.y, d.z);
    let (x2, y2, z2) = (x * x, y * y, z * z);
    let all = vec![
        0.28209479177387814,
        -0.4886025119029199 * y,
        0.4886025119029199 * z,
        -0.4886025119029199 * x,
        1.0925484305920792 * x * y,
        -1.0925484305920792 * y * z,
        0.31539156525252005 * (2.0 * z2 - x2 - y2),
        -1.0925484305920792 * x * z,
        0.5462742152960396 * (x2 - y2),
        -0.5900435899266435 * y * (3.0 * x2 - y2),
        2.890611442640554 * x * y * z,
        -0.4570457994644658 * y * (4.0 * z2 - x2 - y2),
        0.3731763325901154 * z * (2.0 * z2 - 3.0 * x2 - 3.0 * y2),
        -0.4570457994644658 * x * (4.0 * z2 - x2 - y2),
        1.445305721320277 * z * (x2 - y2),
        -0.5900435899266435 * x * (x2 - 3.0 * y2),
        2.5033429417967046 * x * y * (x2 - y2),
        -1.7701307697799304 * y * z * (3.0 * x2 - y2),
        0.9461746957575601 * x * y * (7.0 * z2 - 1.0),
        -0.6690465435572892 * y * z * (7.0 * z2 - 3.0),
        0.10578554691520431 * (z2 * (35.0 * z2 - 30.0) + 3.0),
        -0.6690465435572892 * x * z * (7.0 * z2 - 3.0),
        0.47308734787878004 * (x2 - y2) * (7.0 * z2 - 1.0),
        -1.7701307697799304 * x * z * (x2 - 3.0 * y2),
        0.6258357354491761 * (x2 * (x2 - 3.0 * y2) - y2 * (3.0 * x2 - y2)),
    ];
    all[..(usize::from(degree) + 1).pow(2)].to_vec()
}

fn project(scene: &Scene, view: &View) -> Vec<Projected> {
    let mut out = Vec::new();
    let (width, height) = (f64::from(view.width), f64::from(view.height));
    let i = view.intrinsics;
    let (fx, fy, cx, cy) = (f64::from(i.fx), f64::from(i.fy), f64::from(i.cx), f64::from(i.cy));
    let view_from_world = view.pose.world_from_view.as_dmat3().transpose();
    let eye = view.pose.position.as_dvec3();
    let mut id = 0;
    for instance in &scene.instances {
        let cloud = &instance.cloud;
        let k = f64::from(instance.transform.scale);
        let turn = DMat3::from_quat(instance.transform.rotation.as_dquat());
        let shift = instance.transform.translation.as_dvec3();
        let all: Vec<u32> = (0..cloud.len() as u32).collect();
        for &g in instance.subset.as_deref().unwrap_or(&all) {
            let g = g as usize;
            id += 1;
            let hidden = instance.hidden.as_ref().is_some_and(|h| h.contains(g));
            let (mean, q) = (cloud.means()[g], cloud.rotations()[g]);
            let (log_scale, logit) = (cloud.log_scales()[g], cloud.opacity_logits()[g]);
            if hidden || !mean.is_finite() || !q.is_finite() || !log_scale.is_finite() || logit.is_nan() {
                continue;
            }
            let world = k * (turn * mean.as_dvec3()) + shift;
            let t = view_from_world * (world - eye);
            if t.z <= f64::from(view.near) {
                continue;
            }
            let q = DQuat::from_xyzw(q.x.into(), q.y.into(), q.z.into(), q.w.into());
            let q = if q.length() > 1e-12 { q.normalize() } else { DQuat::IDENTITY };
            let s = log_scale.as_dvec3();
            let m = DMat3::from_quat(q) * DMat3::from_diagonal(DVec3::new(s.x.exp(), s.y.exp(), s.z.exp()));
            let sigma =
                view_from_world * turn * (m * m.transpose()) * (k * k) * turn.transpose() * view_from_world.transpose();
            let (u, v, j0, j1);
            if view.projection == Projection::Perspective {
                (u, v) = (fx * t.x / t.z + cx, fy * t.y / t.z + cy);
                let (tan_x, tan_y) = (width / (2.0 * fx), height / (2.0 * fy));
                let x = t.z * (t.x / t.z).clamp(-(cx / fx + 0.3 * tan_x), (width - cx) / fx + 0.3 * tan_x);
                let y = t.z * (t.y / t.z).clamp(-(cy / fy + 0.3 * tan_y), (height - cy) / fy + 0.3 * tan_y);
                j0 = DVec3::new(fx / t.z, 0.0, -fx * x / (t.z * t.z));
                j1 = DVec3::new(0.0, fy / t.z, -fy * y / (t.z * t.z));
            } else {
                (u, v) = (fx * t.x + cx, fy * t.y + cy);
                (j0, j1) = (DVec3::new(fx, 0.0, 0.0), DVec3::new(0.0, fy, 0.0));
            }
            let (mut a, b, mut c) = (j0.dot(sigma * j0), j0.dot(sigma * j1), j1.dot(sigma * j1));
            let before = a * c - b * b;
            a += 0.3;
            c += 0.3;
            let det = a * c - b * b;
            let mut opacity = 1.0 / (1.0 + (-f64::from(logit)).exp());
            if cloud.source().antialiased {
                opacity *= (before / det).max(0.0).sqrt();
            }
            if det <= 0.0 {
                continue;
            }
            let direction = match view.projection {
                Projection::Perspective => turn.transpose() * (world - eye).normalize(),
                Projection::Orthographic => turn.transpose() * view.pose.world_from_view.as_dmat3().z_axis,
            };
            let y = harmonics(cloud.sh_degree(), direction);
            let sh = cloud.sh_of(g);
            let color = [0, 1, 2].map(|channel| {
                let sum: f64 = y.iter().enumerate().map(|(k, y)| y * f64::from(sh[3 * k + channel])).sum();
                let own = (0.5 + sum).max(0.0);
                let Some(tint) = &instance.tint else { return own };
                let strength = f64::from(tint[g][3]) / 255.0;
                own * (1.0 - strength) + f64::from(tint[g][channel]) / 255.0 * strength
            });
            // No pixel further than this has alpha of 1/255: a circle about the ellipse.
            let radius = (a.max(c) * 2.0 * 2.0 * (255.0 * opacity).ln().max(0.0)).sqrt() + 1.0;
            let conic = [c / det, -b / det, a / det];
            out.push(Projected { id: id - 1, mean: [u, v], conic, opacity, z: t.z, color, radius });
        }
    }
    out.sort_by(|a, b| a.z.total_cmp(&b.z).then(a.id.cmp(&b.id)));
    out
}

/// Draws everything: `features` has `channels` values per Gaussian, hits are at `tau`.
pub(crate) fn draw(scene: &Scene, view: &View, channels: usize, features: &[f32], tau: f64) -> SlowFrame {
    draw_limited(scene, view, channels, features, tau, &[])
}

/// The same, with nothing at or beyond a depth per pixel; an empty `limit` is none.
pub(crate) fn draw_limited(
    scene: &Scene,
    view: &View,
    channels: usize,
    features: &[f32],
    tau: f64,
    limit: &[f32],
) -> SlowFrame {
    let (width, height) = (view.width as usize, view.height as usize);
    let (pixels, count) = (width * height, scene.len());
    let mut f = SlowFrame {
        color: vec![[0.0; 4]; pixels],
        median: vec![f64::NAN; pixels],
        expected: vec![0.0; pixels],
        features: vec![0.0; pixels * channels],
        hits: vec![Frame::NO_ID; pixels],
        strongest: vec![Frame::NO_ID; pixels],
        largest: vec![0.0; count],
        total: vec![0.0; count],
        certain: vec![0.0; count],
        doubt: vec![false; pixels],
        pick_doubt: vec![false; pixels],
    };
    let mut transmittance = vec![1.0f64; pixels];
    let mut ended = vec![false; pixels];
    let mut last_z = vec![-1.0f64; pixels];
    let mut best = vec![0.0f64; pixels];
    let mut weights: Vec<(usize, usize, f64)> = Vec::new();
    for g in project(scene, view) {
        let rows = g.mean[1] - g.radius..g.mean[1] + g.radius;
        let columns = g.mean[0] - g.radius..g.mean[0] + g.radius;
        for y in rows.start.max(0.0) as usize..height.min(rows.end.max(0.0) as usize + 1) {
            for x in columns.start.max(0.0) as usize..width.min(columns.end.max(0.0) as usize + 1) {
                let p = y * width + x;
                if ended[p] {
                    continue;
                }
                if let Some(&limit) = limit.get(p) {
                    f.doubt[p] |= (g.z - f64::from(limit)).abs() < 2e-6 * g.z;
                    if g.z >= f64::from(limit) {
                        continue;
                    }
                }
                let (dx, dy) = (x as f64 + 0.5 - g.mean[0], y as f64 + 0.5 - g.mean[1]);
                let q = g.conic[0] * dx * dx + 2.0 * g.conic[1] * dx * dy + g.conic[2] * dy * dy;
                let alpha = (g.opacity * (-0.5 * q).exp()).min(0.99);
                f.doubt[p] |= (alpha * 255.0 - 1.0).abs() < 3e-3;
                if alpha < 1.0 / 255.0 {
                    continue;
                }
                let after = transmittance[p] * (1.0 - alpha);
                f.doubt[p] |= (after / 1e-4 - 1.0).abs() < 3e-3;
                let gap = g.z - last_z[p];
                f.doubt[p] |= gap != 0.0 && gap < 2e-6 * g.z;
                last_z[p] = g.z;
                if after < 1e-4 {
                    ended[p] = true;
                    continue;
                }
                let weight = alpha * transmittance[p];
                for c in 0..3 {
                    f.color[p][c] += weight * g.color[c];
                }
                f.color[p][3] += weight;
                f.expected[p] += weight * g.z;
                for c in 0..channels {
                    f.features[p * channels + c] += weight * f64::from(features[g.id * channels + c]);
                }
                if f.median[p].is_nan() && after <= 0.5 {
                    f.median[p] = g.z;
                }
                if f.hits[p] == Frame::NO_ID && after <= 1.0 - tau {
                    f.hits[p] = g.id as u32;
                }
                f.pick_doubt[p] |= (after - 0.5).abs() < 1e-4 || (after - (1.0 - tau)).abs() < 1e-4;
                f.pick_doubt[p] |= (weight - best[p]).abs() < 1e-4;
                if weight > best[p] {
                    best[p] = weight;
                    f.strongest[p] = g.id as u32;
                }
                f.total[g.id] += weight;
                weights.push((g.id, p, weight));
                transmittance[p] = after;
            }
        }
    }
    for (id, p, weight) in weights {
        if !f.doubt[p] {
            f.certain[id] += weight;
            f.largest[id] = f.largest[id].max(weight);
        }
    }
    for p in 0..pixels {
        let sum = f.color[p][3];
        f.expected[p] = if sum > 1e-3 { f.expected[p] / sum } else { f64::NAN };
    }
    f
}
