//! Lifting a 2D mask to Gaussians without any tracking (the paper's manual projections, its section 4.3).
//!
//! - [`Lift::Frustum`]: everything in the sweep of the mask through the view, front to back.
//! - [`Lift::Depth`]: of that, what lies at the depth that is seen.
//! - [`Lift::Surface`]: exactly the Gaussians that are hit first.
//!
//! Each gives a [`Selection`] of scene-wide ids, to be combined by [`Selection::apply`] with a
//! [`SelectMode`](splat_core::SelectMode). Hidden Gaussians and those behind the near plane are never in it.

use glam::{Mat3, Vec2, Vec3};
use rayon::prelude::*;
use splat_core::{Mask2d, Projection, Selection, View};
use splat_raster::{Depth, Frame, Instance, Rasterizer, Scene, VOTE_UNIT};

use crate::SegmentError;
use crate::votes::SEEN_TOTAL;

/// When a Gaussian counts as inside the mask.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Footprint {
    /// Its mean projects into the mask.
    #[default]
    Center,
    /// Some pixel of its projected 1-sigma ellipse is in the mask.
    Ellipse,
    /// More than this share, 0..=1, of what is seen of it in this view is in the mask; needs one frame of votes.
    Weight(f32),
}

/// How far from the seen depth a Gaussian may lie.
///
/// Tolerance of Gaussian i at a pixel of depth D: `max(floor * D, factor * (sigma_ray_i + spread))`, with the standard
/// deviation `sigma_ray_i` of the Gaussian along the view's forward axis and the local spread of depth, which is
/// the steepness of the surface there (differences to the nearer of two opposite neighbours, so that a silhouette
/// does not count). No fixed distance: it works at any scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthTolerance {
    /// Multiple of both spreads, 2 by default.
    pub factor: f32,
    /// Least tolerance as a share of the depth, 0.005 by default.
    pub floor: f32,
}

impl Default for DepthTolerance {
    fn default() -> Self {
        Self { factor: 2.0, floor: 0.005 }
    }
}

/// How a mask becomes a set of Gaussians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lift {
    /// All Gaussians in the sweep of the mask through the view.
    Frustum(Footprint),
    /// Those of the sweep that lie at the median depth of their pixel.
    Depth(Footprint, DepthTolerance),
    /// The first hits of the mask's pixels at this tau (0.5 by convention): exactly what is seen.
    Surface(f32),
}

/// Gaussians of `scene` that `mask` means in `view`.
///
/// # Errors
/// [`SegmentError::Raster`] if the view is unusable or the mask has another size.
pub fn lift(
    raster: &mut dyn Rasterizer,
    scene: &Scene,
    view: &View,
    mask: &Mask2d,
    how: Lift,
) -> Result<Selection, SegmentError> {
    check_size(view, mask)?;
    match how {
        Lift::Frustum(Footprint::Weight(theta)) => by_weight(raster, scene, view, mask, theta),
        Lift::Frustum(footprint) => Ok(frustum(scene, view, mask, footprint)),
        Lift::Depth(footprint, tolerance) => {
            let mut inside = match footprint {
                Footprint::Weight(theta) => by_weight(raster, scene, view, mask, theta)?,
                other => frustum(scene, view, mask, other),
            };
            let depth = raster.depth(scene, view, Depth::Median)?;
            inside.apply(splat_core::SelectMode::Intersect, &at_depth(scene, view, &depth, tolerance));
            Ok(inside)
        }
        Lift::Surface(tau) => {
            let hits = raster.first_hits(scene, view, tau)?;
            let inside = hits.iter().zip(mask.values()).filter(|&(&id, &m)| id != Frame::NO_ID && m >= Mask2d::HALF);
            Ok(Selection::from_ids(scene.len(), inside.map(|(&id, _)| id)))
        }
    }
}

pub(crate) fn check_size(view: &View, mask: &Mask2d) -> Result<(), SegmentError> {
    view.check().map_err(splat_raster::RasterError::from)?;
    let (mask, view) = ((mask.width(), mask.height()), (view.width, view.height));
    if mask != view {
        return Err(splat_raster::RasterError::SizeMismatch { mask, view }.into());
    }
    Ok(())
}

/// A Gaussian as a view sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projected {
    /// Pixel coordinates of the mean.
    pub center: Vec2,
    /// Camera depth of the mean, in scene units.
    pub depth: f32,
    /// Projected covariance with the frame's low-pass of 0.3: xx, xy, yy, in square pixels.
    pub cov: [f32; 3],
    /// Standard deviation along the view's forward axis, in scene units.
    pub sigma_ray: f32,
}

/// Mean and covariance of Gaussian `i` of an instance in the scene's space.
pub fn placed(instance: &Instance, i: usize) -> (Vec3, Mat3) {
    (instance.mean(i), instance.covariance(i))
}

/// A Gaussian in a view; `None` at or behind the near plane or where a number is not finite.
///
/// The affine (EWA) approximation of the frame, with the same clamp of the slope at 1.3 times half the picture's opening.
pub fn project(view: &View, mean: Vec3, cov: Mat3) -> Option<Projected> {
    let (center, depth) = view.project(mean)?;
    let i = &view.intrinsics;
    let t = view.to_view(mean);
    let w = view.pose.world_from_view.transpose();
    let c = w * cov * w.transpose();
    let (rx, ry) = match view.projection {
        Projection::Perspective => {
            let (width, height) = (view.width as f32, view.height as f32);
            let (margin_x, margin_y) = (0.15 * width / i.fx, 0.15 * height / i.fy);
            let x = (t.x / t.z).clamp(-i.cx / i.fx - margin_x, (width - i.cx) / i.fx + margin_x);
            let y = (t.y / t.z).clamp(-i.cy / i.fy - margin_y, (height - i.cy) / i.fy + margin_y);
            (Vec3::new(i.fx, 0.0, -i.fx * x) / t.z, Vec3::new(0.0, i.fy, -i.fy * y) / t.z)
        }
        Projection::Orthographic => (Vec3::new(i.fx, 0.0, 0.0), Vec3::new(0.0, i.fy, 0.0)),
    };
    let cov = [rx.dot(c * rx) + 0.3, rx.dot(c * ry), ry.dot(c * ry) + 0.3];
    let p = Projected { center, depth, cov, sigma_ray: c.z_axis.z.max(0.0).sqrt() };
    (center.is_finite() && cov.iter().all(|v| v.is_finite()) && p.sigma_ray.is_finite()).then_some(p)
}

/// `test` of every drawn Gaussian in front of the near plane, by scene-wide id; `false` for the others.
pub(crate) fn select_placed(scene: &Scene, test: impl Fn(usize, Vec3, &Instance, usize) -> bool + Sync) -> Selection {
    let mut bits: Vec<bool> = Vec::with_capacity(scene.len());
    let mut offset = 0;
    for instance in &scene.instances {
        let n = instance.cloud.len();
        bits.par_extend((0..n).into_par_iter().map(|i| {
            let hidden = instance.hidden.as_ref().is_some_and(|h| h.contains(i));
            !hidden
                && instance.cloud.drawable(i)
                && test(offset + i, instance.transform.apply(instance.cloud.means()[i]), instance, i)
        }));
        offset += n;
    }
    Selection::from_fn(bits.len(), |i| bits[i])
}

fn frustum(scene: &Scene, view: &View, mask: &Mask2d, footprint: Footprint) -> Selection {
    if footprint == Footprint::Ellipse {
        let rows = RowSums::new(mask);
        return select_placed(scene, |_, _, instance, i| {
            let (mean, cov) = placed(instance, i);
            project(view, mean, cov).is_some_and(|p| rows.meets_ellipse(&p, 1.0))
        });
    }
    select_placed(scene, |_, mean, _, _| {
        view.project(mean).is_some_and(|(uv, _)| view.contains(uv) && mask.contains(uv.x as u32, uv.y as u32))
    })
}

fn by_weight(
    raster: &mut dyn Rasterizer,
    scene: &Scene,
    view: &View,
    mask: &Mask2d,
    theta: f32,
) -> Result<Selection, SegmentError> {
    let votes = raster.votes(scene, view, &[mask])?;
    let theta = f64::from(theta);
    Ok(Selection::from_fn(votes.total.len(), |i| {
        votes.total[i] >= SEEN_TOTAL
            && votes.inside[0][i] as f64 * VOTE_UNIT > theta * (votes.total[i] as f64 * VOTE_UNIT)
    }))
}

fn at_depth(scene: &Scene, view: &View, depth: &[f32], tolerance: DepthTolerance) -> Selection {
    let spread = depth_spread(view.width as usize, view.height as usize, depth);
    select_placed(scene, |_, _, instance, i| {
        let (mean, cov) = placed(instance, i);
        let Some(p) = project(view, mean, cov).filter(|p| view.contains(p.center)) else { return false };
        let k = p.center.y as usize * view.width as usize + p.center.x as usize;
        let limit = (tolerance.factor * (p.sigma_ray + spread[k])).max(tolerance.floor * depth[k]);
        // NaN (no surface at this pixel) must fail, so the comparison is not negated.
        (p.depth - depth[k]).abs() <= limit
    })
}

/// Steepness of a depth picture per pixel, in scene units per pixel; 0 where there is no depth.
///
/// Per axis the difference to the nearer in depth of the two neighbours: on a slope both are alike, at a silhouette
/// the one on the same surface counts.
pub(crate) fn depth_spread(width: usize, height: usize, depth: &[f32]) -> Vec<f32> {
    let step = |here: f32, a: Option<f32>, b: Option<f32>| {
        let d = |v: Option<f32>| v.map_or(f32::INFINITY, |v| (v - here).abs());
        // `min` of f32 passes over NaN.
        let m = d(a).min(d(b));
        if m.is_finite() { m } else { 0.0 }
    };
    let mut out = vec![0.0; depth.len()];
    if width == 0 || height == 0 {
        return out;
    }
    out.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        for (x, out) in row.iter_mut().enumerate() {
            let k = y * width + x;
            let dx = step(depth[k], (x > 0).then(|| depth[k - 1]), (x + 1 < width).then(|| depth[k + 1]));
            let dy = step(depth[k], (y > 0).then(|| depth[k - width]), (y + 1 < height).then(|| depth[k + width]));
            *out = dx.hypot(dy);
        }
    });
    out
}

/// Number of mask pixels left of every pixel of every row: a span is counted in constant time.
#[derive(Clone, Debug)]
pub(crate) struct RowSums {
    width: usize,
    height: usize,
    sums: Vec<u32>,
}

impl RowSums {
    pub(crate) fn new(mask: &Mask2d) -> Self {
        let (width, height) = (mask.width() as usize, mask.height() as usize);
        let mut sums = Vec::with_capacity((width + 1) * height);
        for row in mask.values().chunks_exact(width.max(1)) {
            let mut n = 0;
            sums.push(0);
            for &v in row {
                n += u32::from(v >= Mask2d::HALF);
                sums.push(n);
            }
        }
        Self { width, height, sums }
    }

    /// Mask pixels of row `y` from `x0` to `x1`, both included, clipped to the picture.
    fn count(&self, y: usize, x0: f32, x1: f32) -> u32 {
        let from = x0.max(0.0);
        let to = (x1 + 1.0).min(self.width as f32);
        if to <= from {
            return 0;
        }
        let row = &self.sums[y * (self.width + 1)..];
        row[to as usize] - row[from as usize]
    }

    /// Whether the mask has a pixel whose centre lies in the ellipse of `sigmas` standard deviations, or that holds its centre.
    pub(crate) fn meets_ellipse(&self, p: &Projected, sigmas: f32) -> bool {
        let [a, b, c] = p.cov;
        let half_height = sigmas * c.sqrt();
        let inside = |v: f32, n: usize| v >= 0.0 && v < n as f32;
        if inside(p.center.x, self.width) && inside(p.center.y, self.height) {
            let x = p.center.x.floor();
            if self.count(p.center.y as usize, x, x) > 0 {
                return true;
            }
        }
        let top = (p.center.y - half_height - 0.5).ceil().max(0.0);
        let bottom = (p.center.y + half_height - 0.5).floor().min(self.height as f32 - 1.0);
        if bottom < top {
            return false;
        }
        (top as usize..=bottom as usize).any(|y| {
            // Of the points at this height the ellipse holds those within `half` of the conditional mean.
            let dy = y as f32 + 0.5 - p.center.y;
            let mean = p.center.x + b / c * dy;
            let variance = (a - b * b / c) * (sigmas * sigmas - dy * dy / c);
            if variance < 0.0 {
                return false;
            }
            let half = variance.sqrt();
            let (x0, x1) = ((mean - half - 0.5).ceil(), (mean + half - 0.5).floor());
            x1 >= x0 && self.count(y, x0, x1) > 0
        })
    }
}
