//! Stage 1: Gaussians to splats, with everything culled that no pixel sees.

#![expect(
    clippy::needless_range_loop,
    reason = "iterators over registers are calls where the compiler does not inline them into kernels"
)]

use glam::{Mat3, Vec3};
use splat_core::deform::{Deformation, LocalDeformation};
use splat_core::{Cloud, Projection, Selection, View, sh};

use super::simd::{GROUP, Group, Kernel, Simd, exp2_precise, log2};
use super::splat::{Cover, LEVELS, Splat, TILE};
use crate::Instance;

/// Variance added to both axes of a splat, in px^2 (INRIA's low-pass).
const LOW_PASS: f32 = 0.3;
/// Variance of a splat beyond which both axes are shrunk alike, in px^2, so that products stay finite: a splat of a
/// thousand million pixels is as flat as one of more.
const LARGEST_VARIANCE: f32 = 1e18;

/// No colour is brighter: an infinity would spoil pixels that its splat has weight 0 in.
const BRIGHTEST: f32 = 1e6;

/// One instance seen from one view, in the numbers that the kernel needs.
pub(super) struct Setup<'a> {
    cloud: &'a Cloud,
    hidden: Option<&'a Selection>,
    /// The cloud's ids of the instance's Gaussians, unless it has all.
    subset: Option<&'a [u32]>,
    tint: Option<&'a [[u8; 4]]>,
    deformation: Option<&'a Deformation>,
    /// Scene-wide id of the first Gaussian.
    first_id: u32,
    /// Rows map the cloud's space to camera space, scale included.
    rows: [Vec3; 3],
    /// Where the cloud's origin is in camera space.
    origin: Vec3,
    /// Camera centre in the cloud's space.
    camera: Vec3,
    /// Viewing direction in the cloud's space where it is the same for all Gaussians.
    parallel: Option<Vec3>,
    focal: [f32; 2],
    center: [f32; 2],
    /// Least and largest x / z and y / z for which the projection is linearised.
    limits: [[f32; 2]; 2],
    size: [f32; 2],
    near: f32,
    antialiased: bool,
    color: bool,
}

impl<'a> Setup<'a> {
    pub(super) fn new(instance: &'a Instance, first_id: u32, view: &View, color: bool) -> Self {
        let transform = &instance.transform;
        let turn = transform.rotation_matrix().as_dmat3();
        let view_from_world = view.pose.world_from_view.transpose().as_dmat3();
        let position = view.pose.position.as_dvec3();
        let scale = f64::from(transform.scale);
        let translation = transform.translation.as_dvec3();
        let view_from_cloud: Mat3 = (view_from_world * turn * scale).as_mat3();
        let size = [view.width as f32, view.height as f32];
        let i = &view.intrinsics;
        let limits = |size: f32, center: f32, focal: f32| {
            let margin = 0.3 * 0.5 * size / focal;
            [-(center / focal + margin), (size - center) / focal + margin]
        };
        Self {
            cloud: &instance.cloud,
            hidden: instance.hidden.as_deref(),
            subset: instance.subset.as_deref(),
            tint: instance.tint.as_deref(),
            deformation: instance.deformation.as_deref(),
            first_id,
            rows: [view_from_cloud.row(0), view_from_cloud.row(1), view_from_cloud.row(2)],
            origin: (view_from_world * (translation - position)).as_vec3(),
            camera: (turn.transpose() * (position - translation) / scale).as_vec3(),
            parallel: (view.projection == Projection::Orthographic)
                .then(|| (turn.transpose() * view.forward().as_dvec3()).as_vec3()),
            focal: [i.fx, i.fy],
            center: [i.cx, i.cy],
            limits: [limits(size[0], i.cx, i.fx), limits(size[1], i.cy, i.fy)],
            size,
            near: view.near,
            antialiased: instance.cloud.source().antialiased,
            color,
        }
    }
}

/// What a block of Gaussians became.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block {
    /// Scene-wide id of its first Gaussian.
    pub(super) start: u32,
    /// Splats that may be seen: so many [`Project::keys`] are valid.
    pub(super) count: u32,
    /// Least and largest of the high halves of the keys.
    pub(super) depths: (u32, u32),
}

impl Default for Block {
    fn default() -> Self {
        Self { start: 0, count: 0, depths: (u32::MAX, 0) }
    }
}

/// Projects a block of consecutive Gaussians.
pub(super) struct Project<'a> {
    pub(super) setup: &'a Setup<'a>,
    /// Position in the instance of the first Gaussian.
    pub(super) start: usize,
    /// One per Gaussian of the block; written where it survives.
    pub(super) splats: &'a mut [Splat],
    /// As `splats`.
    pub(super) covers: &'a mut [Cover],
    /// Written from the front, in order of ids: bits of z in the high half, id in the low half.
    pub(super) keys: &'a mut [u64],
}

/// Values of 16 Gaussians.
#[derive(Default)]
struct Lanes {
    mean: [Group<f32>; 3],
    log_scale: [Group<f32>; 3],
    rotation: [Group<f32>; 4],
    logit: Group<f32>,
    /// Columns of the deformation gradients, and the quaternions of their rotations; not written where nothing is bent.
    gradient: [Group<f32>; 9],
    turn: [Group<f32>; 4],
    /// Camera-space means.
    view: [Group<f32>; 3],
    /// The splat's own numbers, in the order of [`Splat`]'s fields up to `z`.
    splat: [Group<f32>; 8],
    /// First and last pixel centre across and down.
    bounds: [Group<f32>; 4],
}

impl Kernel for Project<'_> {
    type Output = Block;

    #[inline(always)]
    fn run<S: Simd>(self, s: S) -> Block {
        match self.setup.subset {
            None => self.all(s, |position| position),
            Some(ids) => self.all(s, |position| ids[position] as usize),
        }
    }
}

impl Project<'_> {
    /// `cloud_id` gives the Gaussian at a position of the instance.
    #[inline(always)]
    fn all<S: Simd>(self, s: S, cloud_id: impl Fn(usize) -> usize) -> Block {
        let Self { setup, start, splats, covers, keys } = self;
        let cloud = setup.cloud;
        let (means, log_scales) = (cloud.means(), cloud.log_scales());
        let (rotations, logits) = (cloud.rotations(), cloud.opacity_logits());
        let degree = cloud.sh_degree();
        let coefficients = sh::coefficient_count(degree);
        let stride = cloud.sh_stride();
        let mut lanes = Lanes::default();
        let mut harmonics = [Group([0.0; GROUP]); 25];
        let mut block = Block { start: setup.first_id + start as u32, ..Block::default() };
        let end = start + splats.len();
        let mut at = start;
        while at < end {
            let count = GROUP.min(end - at);
            let mut alive = (1u32 << count) - 1;
            if let Some(hidden) = setup.hidden {
                alive &= !match setup.subset {
                    None => hidden_bits(hidden, at),
                    Some(_) => (0..count).fold(0, |bits, i| bits | u32::from(hidden.contains(cloud_id(at + i))) << i),
                };
            }
            for i in 0..count {
                let mut m = means[cloud_id(at + i)];
                if let Some(deformation) = setup.deformation {
                    let local = deformation.at(m);
                    bend(&mut lanes, i, &local);
                    m = local.position;
                }
                lanes.mean[0].0[i] = m.x;
                lanes.mean[1].0[i] = m.y;
                lanes.mean[2].0[i] = m.z;
            }
            alive &= to_view(s, setup, &mut lanes);
            if alive != 0 {
                for i in 0..count {
                    let id = cloud_id(at + i);
                    let l = log_scales[id];
                    lanes.log_scale[0].0[i] = l.x;
                    lanes.log_scale[1].0[i] = l.y;
                    lanes.log_scale[2].0[i] = l.z;
                    let q = rotations[id];
                    lanes.rotation[0].0[i] = q.x;
                    lanes.rotation[1].0[i] = q.y;
                    lanes.rotation[2].0[i] = q.z;
                    lanes.rotation[3].0[i] = q.w;
                    lanes.logit.0[i] = logits[id];
                }
                alive &= to_pixels(s, setup, &mut lanes);
                if setup.color && alive != 0 && degree > 0 {
                    basis(s, setup, degree, &mut lanes, &mut harmonics);
                }
            }
            while alive != 0 {
                let i = alive.trailing_zeros() as usize;
                alive &= alive - 1;
                let Some(tiles) = tile_box(&lanes, i) else { continue };
                let id = setup.first_id + (at + i) as u32;
                let mut color = [0.0; 3];
                if setup.color {
                    let gaussian = cloud_id(at + i);
                    let sh = &cloud.sh()[gaussian * stride..][..stride];
                    color = blend_harmonics(&harmonics, i, sh, coefficients);
                    if let Some(tint) = setup.tint {
                        color = tinted(color, tint[gaussian]);
                    }
                }
                let f = &lanes.splat;
                let splat = Splat {
                    mean: [f[0].0[i], f[1].0[i]],
                    along: f[2].0[i],
                    shear: f[3].0[i],
                    across: f[4].0[i],
                    lean: f[5].0[i],
                    level: f[6].0[i],
                    z: f[7].0[i],
                    color,
                    id,
                    tiles,
                };
                let place = at + i - start;
                splats[place] = splat;
                covers[place] = Cover::of(s, &splat);
                let depth = splat.z.to_bits();
                block.depths = (block.depths.0.min(depth), block.depths.1.max(depth));
                keys[block.count as usize] = u64::from(depth) << 32 | u64::from(id);
                block.count += 1;
            }
            at += count;
        }
        block
    }
}

/// A colour with another mixed over it, as [`Instance::tint`] says.
fn tinted(color: [f32; 3], tint: [u8; 4]) -> [f32; 3] {
    let strength = f32::from(tint[3]) / 255.0;
    [0, 1, 2].map(|c| color[c] + (f32::from(tint[c]) / 255.0 - color[c]) * strength)
}

/// Notes in lane `i` what a deformation does to its Gaussian.
fn bend(lanes: &mut Lanes, i: usize, local: &LocalDeformation) {
    for (to, v) in lanes.gradient.iter_mut().zip(local.gradient.to_cols_array()) {
        to.0[i] = v;
    }
    for (to, v) in lanes.turn.iter_mut().zip(local.rotation.to_array()) {
        to.0[i] = v;
    }
}

/// A covector at the deformed Gaussians, as one at those at rest: `F^T v`.
#[inline(always)]
fn pulled_back<S: Simd>(s: S, gradient: &[Group<f32>; 9], part: usize, v: [S::F; 3]) -> [S::F; 3] {
    let column = |k: usize| {
        let c = [0, 1, 2].map(|r| s.load(&gradient[3 * k + r], part));
        dot(s, c, v)
    };
    [column(0), column(1), column(2)]
}

/// A direction turned back by unit quaternions.
#[inline(always)]
fn turned_back<S: Simd>(s: S, turn: &[Group<f32>; 4], part: usize, v: [S::F; 3]) -> [S::F; 3] {
    let [x, y, z, w] = [0, 1, 2, 3].map(|k| s.load(&turn[k], part));
    let cross = |a: [S::F; 3]| {
        [s.fnma(a[2], y, s.mul(a[1], z)), s.fnma(a[0], z, s.mul(a[2], x)), s.fnma(a[1], x, s.mul(a[0], y))]
    };
    let t = cross(v).map(|t| s.add(t, t));
    let u = cross(t);
    [0, 1, 2].map(|k| s.add(s.fma(w, t[k], v[k]), u[k]))
}

/// Hidden bits of 16 Gaussians from `at` on.
fn hidden_bits(hidden: &Selection, at: usize) -> u32 {
    // Blocks start at multiples of 16, so a group never straddles two words.
    (hidden.words()[at / 64] >> (at % 64)) as u32 & 0xffff
}

/// Means to camera space; which are beyond the near plane.
#[inline(always)]
fn to_view<S: Simd>(s: S, setup: &Setup, lanes: &mut Lanes) -> u32 {
    let mut alive = 0;
    for part in 0..GROUP / S::LANES {
        let [x, y, z] = load3(s, &lanes.mean, part);
        let mut depth = x;
        for k in 0..3 {
            let row = setup.rows[k];
            let t = s.fma(s.splat(row.z), z, s.splat(setup.origin[k]));
            depth = s.fma(s.splat(row.x), x, s.fma(s.splat(row.y), y, t));
            s.store(&mut lanes.view[k], part, depth);
        }
        // NaN fails this.
        alive |= s.bits(s.gt(depth, s.splat(setup.near))) << (part * S::LANES);
    }
    alive
}

/// Covariance, opacity and bounds in pixels; which may reach a pixel of the picture.
#[inline(always)]
fn to_pixels<S: Simd>(s: S, setup: &Setup, lanes: &mut Lanes) -> u32 {
    let mut alive = 0;
    let (zero, one) = (s.splat(0.0), s.splat(1.0));
    let log2_e = s.splat(std::f32::consts::LOG2_E);
    for part in 0..GROUP / S::LANES {
        let log_scale = load3(s, &lanes.log_scale, part);
        let r = &lanes.rotation;
        let stored = [s.load(&r[0], part), s.load(&r[1], part), s.load(&r[2], part), s.load(&r[3], part)];
        let logit = s.load(&lanes.logit, part);
        let [x, y, z] = load3(s, &lanes.view, part);

        // Zero times what is not finite is NaN, and stays so.
        let mut finite = zero;
        for v in [log_scale[0], log_scale[1], log_scale[2], stored[0], stored[1], stored[2], stored[3], x, y, z] {
            finite = s.fma(v, zero, finite);
        }

        // Where the mean is, and the projection linearised there.
        let scale = if setup.parallel.is_some() { one } else { s.div(one, z) };
        let (px, py) = (s.mul(x, scale), s.mul(y, scale));
        let u = s.fma(s.splat(setup.focal[0]), px, s.splat(setup.center[0]));
        let v = s.fma(s.splat(setup.focal[1]), py, s.splat(setup.center[1]));
        let (lx, ly) = match setup.parallel {
            Some(_) => (zero, zero),
            None => (limit(s, px, setup.limits[0]), limit(s, py, setup.limits[1])),
        };
        let mut j0 = jacobian_row(s, setup, 0, scale, lx);
        let mut j1 = jacobian_row(s, setup, 1, scale, ly);
        if setup.deformation.is_some() {
            j0 = pulled_back(s, &lanes.gradient, part, j0);
            j1 = pulled_back(s, &lanes.gradient, part, j1);
        }

        // Both rows of the Jacobian in the Gaussian's own axes, times its scales: the covariance is their products.
        let axes = rotation_columns(s, stored);
        let mut p = [zero; 3];
        let mut q = [zero; 3];
        for k in 0..3 {
            let sigma = exp2_precise(s, s.min(s.mul(log_scale[k], log2_e), s.splat(40.0)));
            p[k] = s.mul(sigma, dot(s, axes[k], j0));
            q[k] = s.mul(sigma, dot(s, axes[k], j1));
        }
        let shrink =
            s.sqrt(s.min(one, s.div(s.splat(LARGEST_VARIANCE), s.max(s.max(dot(s, p, p), dot(s, q, q)), one))));
        for k in 0..3 {
            p[k] = s.mul(p[k], shrink);
            q[k] = s.mul(q[k], shrink);
        }
        let (a0, b, c0) = (dot(s, p, p), dot(s, p, q), dot(s, q, q));
        // Lagrange's identity: a c - b^2 without the cancellation.
        let cross = [
            s.fnma(p[2], q[1], s.mul(p[1], q[2])),
            s.fnma(p[0], q[2], s.mul(p[2], q[0])),
            s.fnma(p[1], q[0], s.mul(p[0], q[1])),
        ];
        let det0 = dot(s, cross, cross);
        let low_pass = s.splat(LOW_PASS);
        let (a, c) = (s.add(a0, low_pass), s.add(c0, low_pass));
        let det = s.add(s.fma(low_pass, s.add(a0, c0), s.splat(LOW_PASS * LOW_PASS)), det0);

        // log2 of the opacity, compensated for the low-pass where the file was trained so.
        let odds = exp2_precise(s, s.min(s.mul(s.sub(zero, logit), log2_e), s.splat(127.0)));
        let mut level = s.sub(zero, log2(s, s.add(one, odds)));
        if setup.antialiased {
            level = s.fma(s.splat(0.5), log2(s, s.max(s.div(det0, det), s.splat(1e-30))), level);
        }
        let reach = s.add(level, s.splat(LEVELS));

        // The box of the ellipse on which alpha is 1/255, a hundredth of a pixel larger, as pixel centres.
        let k = s.mul(reach, s.splat(2.0 * std::f32::consts::LN_2));
        let (x0, x1) = bounds(s, u, s.mul(k, a), setup.size[0]);
        let (y0, y1) = bounds(s, v, s.mul(k, c), setup.size[1]);

        let mut keep = s.and(s.ge(finite, zero), s.ge(reach, zero));
        keep = s.and(keep, s.and(s.ge(logit, logit), s.gt(det, zero)));
        keep = s.and(keep, s.and(s.ge(x1, x0), s.ge(y1, y0)));
        alive |= s.bits(keep) << (part * S::LANES);

        let half_log2_e = s.splat(0.5 * std::f32::consts::LOG2_E);
        let along = s.sqrt(s.mul(half_log2_e, s.div(c, det)));
        let across = s.sqrt(s.div(half_log2_e, c));
        let numbers = [u, v, along, s.div(b, c), across, s.div(b, a), level, z];
        for k in 0..numbers.len() {
            s.store(&mut lanes.splat[k], part, numbers[k]);
        }
        let bounds = [x0, x1, y0, y1];
        for k in 0..bounds.len() {
            s.store(&mut lanes.bounds[k], part, bounds[k]);
        }
    }
    alive
}

#[inline(always)]
fn load3<S: Simd>(s: S, from: &[Group<f32>; 3], part: usize) -> [S::F; 3] {
    [s.load(&from[0], part), s.load(&from[1], part), s.load(&from[2], part)]
}

#[inline(always)]
fn dot<S: Simd>(s: S, a: [S::F; 3], b: [S::F; 3]) -> S::F {
    s.fma(a[0], b[0], s.fma(a[1], b[1], s.mul(a[2], b[2])))
}

#[inline(always)]
fn limit<S: Simd>(s: S, x: S::F, limits: [f32; 2]) -> S::F {
    s.min(s.max(x, s.splat(limits[0])), s.splat(limits[1]))
}

/// Derivative of the pixel's x (`axis` 0) or y (1) by the position in the cloud's space; `slope` is x / z or y / z.
#[inline(always)]
fn jacobian_row<S: Simd>(s: S, setup: &Setup, axis: usize, scale: S::F, slope: S::F) -> [S::F; 3] {
    let (row, depth) = (setup.rows[axis], setup.rows[2]);
    let k = s.mul(s.splat(setup.focal[axis]), scale);
    [
        s.mul(k, s.fnma(slope, s.splat(depth.x), s.splat(row.x))),
        s.mul(k, s.fnma(slope, s.splat(depth.y), s.splat(row.y))),
        s.mul(k, s.fnma(slope, s.splat(depth.z), s.splat(row.z))),
    ]
}

/// First and last pixel centre, in whole pixels of a picture of that size, within the root of `square` of `mean`.
#[inline(always)]
fn bounds<S: Simd>(s: S, mean: S::F, square: S::F, size: f32) -> (S::F, S::F) {
    let half = s.add(s.sqrt(s.max(square, s.splat(0.0))), s.splat(0.01));
    let center = s.sub(mean, s.splat(0.5));
    (s.max(s.sub(center, half), s.splat(0.0)), s.min(s.add(center, half), s.splat(size - 1.0)))
}

/// Columns of the rotation matrices of quaternions of any length; the identity where one has no direction.
#[inline(always)]
fn rotation_columns<S: Simd>(s: S, q: [S::F; 4]) -> [[S::F; 3]; 3] {
    let one = s.splat(1.0);
    let square = s.fma(q[0], q[0], s.fma(q[1], q[1], s.fma(q[2], q[2], s.mul(q[3], q[3]))));
    let directed = s.and(s.gt(square, s.splat(1e-24)), s.ge(s.splat(f32::MAX), square));
    let unit = s.div(one, s.sqrt(square));
    let x = s.zero_unless(directed, s.mul(q[0], unit));
    let y = s.zero_unless(directed, s.mul(q[1], unit));
    let z = s.zero_unless(directed, s.mul(q[2], unit));
    let w = s.select(directed, s.mul(q[3], unit), one);
    let (x2, y2, z2) = (s.add(x, x), s.add(y, y), s.add(z, z));
    let (xx, yy, zz) = (s.mul(x, x2), s.mul(y, y2), s.mul(z, z2));
    let (xy, xz, yz) = (s.mul(x, y2), s.mul(x, z2), s.mul(y, z2));
    let (wx, wy, wz) = (s.mul(w, x2), s.mul(w, y2), s.mul(w, z2));
    [
        [s.sub(one, s.add(yy, zz)), s.add(xy, wz), s.sub(xz, wy)],
        [s.sub(xy, wz), s.sub(one, s.add(xx, zz)), s.add(yz, wx)],
        [s.add(xz, wy), s.sub(yz, wx), s.sub(one, s.add(xx, yy))],
    ]
}

/// First and last tile across and down of lane `i`; none where its box holds no pixel centre.
#[inline(always)]
fn tile_box(lanes: &Lanes, i: usize) -> Option<[u16; 4]> {
    let b = &lanes.bounds;
    let (x0, x1, y0, y1) = (b[0].0[i], b[1].0[i] as u32, b[2].0[i], b[3].0[i] as u32);
    // Rounded up; all are at least 0.
    let x0 = x0 as u32 + u32::from((x0 as u32 as f32) < x0);
    let y0 = y0 as u32 + u32::from((y0 as u32 as f32) < y0);
    const PER: u32 = TILE as u32;
    if x0 <= x1 && y0 <= y1 {
        return Some([(x0 / PER) as u16, (x1 / PER) as u16, (y0 / PER) as u16, (y1 / PER) as u16]);
    }
    None
}

/// Values of all harmonics above the constant one towards 16 Gaussians.
#[inline(always)]
fn basis<S: Simd>(s: S, setup: &Setup, degree: u8, lanes: &mut Lanes, to: &mut [Group<f32>; 25]) {
    for part in 0..GROUP / S::LANES {
        let mut d = load3(s, &lanes.mean, part);
        for k in 0..3 {
            d[k] = match setup.parallel {
                Some(direction) => s.splat(direction[k]),
                None => s.sub(d[k], s.splat(setup.camera[k])),
            };
        }
        if setup.deformation.is_some() {
            d = turned_back(s, &lanes.turn, part, d);
        }
        let square = dot(s, d, d);
        let unit = s.div(s.splat(1.0), s.sqrt(s.max(square, s.splat(1e-30))));
        let (x, y, z) = (s.mul(d[0], unit), s.mul(d[1], unit), s.mul(d[2], unit));
        s.store(&mut to[1], part, times(s, -0.488_602_52, y));
        s.store(&mut to[2], part, times(s, 0.488_602_52, z));
        s.store(&mut to[3], part, times(s, -0.488_602_52, x));
        if degree < 2 {
            continue;
        }
        let (x2, y2, z2) = (s.mul(x, x), s.mul(y, y), s.mul(z, z));
        let (xy, yz, xz) = (s.mul(x, y), s.mul(y, z), s.mul(x, z));
        let x2_y2 = s.sub(x2, y2);
        s.store(&mut to[4], part, times(s, 1.092_548_5, xy));
        s.store(&mut to[5], part, times(s, -1.092_548_5, yz));
        // On the unit sphere 2z2 - x2 - y2 = 3z2 - 1, and so on below.
        s.store(&mut to[6], part, times(s, 0.315_391_57, line(s, 3.0, z2, -1.0)));
        s.store(&mut to[7], part, times(s, -1.092_548_5, xz));
        s.store(&mut to[8], part, times(s, 0.546_274_24, x2_y2));
        if degree < 3 {
            continue;
        }
        let three_x2_y2 = s.fma(s.splat(3.0), x2, s.sub(s.splat(0.0), y2));
        let x2_three_y2 = s.fnma(s.splat(3.0), y2, x2);
        let five = line(s, 5.0, z2, -1.0);
        s.store(&mut to[9], part, s.mul(times(s, -0.590_043_6, y), three_x2_y2));
        s.store(&mut to[10], part, s.mul(times(s, 2.890_611_4, xy), z));
        s.store(&mut to[11], part, s.mul(times(s, -0.457_045_8, y), five));
        s.store(&mut to[12], part, s.mul(times(s, 0.373_176_34, z), line(s, 5.0, z2, -3.0)));
        s.store(&mut to[13], part, s.mul(times(s, -0.457_045_8, x), five));
        s.store(&mut to[14], part, s.mul(times(s, 1.445_305_7, z), x2_y2));
        s.store(&mut to[15], part, s.mul(times(s, -0.590_043_6, x), x2_three_y2));
        if degree < 4 {
            continue;
        }
        let seven = line(s, 7.0, z2, -1.0);
        let seven_three = line(s, 7.0, z2, -3.0);
        s.store(&mut to[16], part, s.mul(times(s, 2.503_343, xy), x2_y2));
        s.store(&mut to[17], part, s.mul(times(s, -1.770_130_8, yz), three_x2_y2));
        s.store(&mut to[18], part, s.mul(times(s, 0.946_174_7, xy), seven));
        s.store(&mut to[19], part, s.mul(times(s, -0.669_046_5, yz), seven_three));
        s.store(&mut to[20], part, times(s, 0.105_785_55, s.fma(z2, line(s, 35.0, z2, -30.0), s.splat(3.0))));
        s.store(&mut to[21], part, s.mul(times(s, -0.669_046_5, xz), seven_three));
        s.store(&mut to[22], part, s.mul(times(s, 0.473_087_35, x2_y2), seven));
        s.store(&mut to[23], part, s.mul(times(s, -1.770_130_8, xz), x2_three_y2));
        let fours = s.fma(x2, x2_three_y2, s.mul(s.sub(s.splat(0.0), y2), three_x2_y2));
        s.store(&mut to[24], part, times(s, 0.625_835_7, fours));
    }
}

#[inline(always)]
fn times<S: Simd>(s: S, c: f32, v: S::F) -> S::F {
    s.mul(s.splat(c), v)
}

/// `a * v + b`
#[inline(always)]
fn line<S: Simd>(s: S, a: f32, v: S::F, b: f32) -> S::F {
    s.fma(s.splat(a), v, s.splat(b))
}

/// `max(0, 0.5 + sum_k c_k Y_k)` per channel for lane `i`.
#[inline(always)]
fn blend_harmonics(harmonics: &[Group<f32>; 25], i: usize, sh: &[f32], coefficients: usize) -> [f32; 3] {
    let mut color = [0.5 + sh::C0 * sh[0], 0.5 + sh::C0 * sh[1], 0.5 + sh::C0 * sh[2]];
    // Two sums, each in a register: one would wait for itself. Four floats are one load; the fourth belongs to the next
    // coefficient and is not used.
    let (mut odd, mut even) = ([0.0; 4], [0.0; 4]);
    let whole = coefficients - 1;
    let mut k = 1;
    while k + 1 < whole {
        let (y, row) = (harmonics[k].0[i], &sh[3 * k..3 * k + 4]);
        let (next_y, next) = (harmonics[k + 1].0[i], &sh[3 * k + 3..3 * k + 7]);
        for c in 0..4 {
            odd[c] += y * row[c];
            even[c] += next_y * next[c];
        }
        k += 2;
    }
    // Up to two are left, the last without a fourth float after it.
    while k < coefficients {
        for c in 0..3 {
            odd[c] += harmonics[k].0[i] * sh[3 * k + c];
        }
        k += 1;
    }
    // Written so that NaN becomes 0.
    for c in 0..3 {
        let v = color[c] + (odd[c] + even[c]);
        color[c] = if v > 0.0 { v.min(BRIGHTEST) } else { 0.0 };
    }
    color
}
