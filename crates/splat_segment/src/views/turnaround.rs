//! A circle of views about what an annotated mask shows.

use glam::{Quat, Vec2, Vec3};
use rayon::prelude::*;
use splat_core::{Mask2d, Pose, Selection, View};
use splat_raster::{Frame, Instance, Outputs, Rasterizer, Scene};

use super::VISIBLE_WEIGHT;
use super::visibility::within;
use crate::project::check_size;
use crate::{Run, SegmentError};

/// How a turnaround is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TurnaroundSettings {
    /// Views on the circle, 50 by default.
    pub count: usize,
    /// Least and largest share of the picture's short side that the object's sphere may fill, 0.4 and 0.7 by default. The
    /// distance of the annotated view is kept if it is in between; `None` keeps it in any case, as the paper does.
    pub fill: Option<(f32, f32)>,
    /// Share of the object's Gaussians seen by itself that must be seen among everything else too, 0.2 by default; a
    /// view below it is lifted, moved nearer or dropped.
    pub least_visible: f32,
}

impl Default for TurnaroundSettings {
    fn default() -> Self {
        Self { count: 50, fill: Some((0.4, 0.7)), least_visible: 0.2 }
    }
}

/// A view of the circle that could not be used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dropped {
    /// Its number on the circle.
    pub number: usize,
    /// The largest share of the object that any of its variants saw.
    pub visible: f32,
}

/// A circle of views.
#[derive(Clone, Debug, PartialEq)]
pub struct Turnaround {
    /// Views in order around the axis; they have the size and opening of the annotated one.
    pub views: Vec<View>,
    /// What they look at: the median of the surface under the mask, in scene space.
    pub center: Vec3,
    /// Radius of the object's sphere: 90 % of the surface under the mask is within it, in scene units.
    pub radius: f32,
    /// Views moved from the plain circle (nearer or higher) because the object was hidden there.
    pub moved: usize,
    /// Views left out because the object is hidden there whatever is done.
    pub dropped: Vec<Dropped>,
}

/// Views on a circle about the surface that `mask` shows in `view`.
///
/// The axis goes through the centre along the view's own up; height and distance are those of `view`. View 0 stands where
/// `view` stands but looks at the centre, so it is `view` only if that is centred: keep both.
///
/// # Errors
/// [`SegmentError::NothingUnderMask`] if no Gaussian is hit inside the mask, [`SegmentError::Raster`],
/// [`SegmentError::Cancelled`].
pub fn turnaround(
    raster: &mut dyn Rasterizer,
    scene: &Scene,
    view: &View,
    mask: &Mask2d,
    settings: &TurnaroundSettings,
    run: &Run,
) -> Result<Turnaround, SegmentError> {
    check_size(view, mask)?;
    let mut frame = Frame::default();
    let outputs = Outputs { first_hits: Some(0.5), median_depth: true, ..Outputs::default() };
    raster.draw(scene, view, &outputs, &mut frame)?;
    let (points, hits) = surface(scene, view, mask, &frame);
    if points.is_empty() {
        return Err(SegmentError::NothingUnderMask);
    }
    let center = Vec3::from_array(std::array::from_fn(|k| quantile(points.iter().map(|p| p[k]), 0.5)));
    let radius = quantile(points.iter().map(|p| p.distance(center)), 0.9).max(1e-6);

    let up = -view.pose.world_from_view.y_axis;
    let eye = framed_eye(view, center, radius, settings.fill) - center;
    let alone = alone(scene, &hits);
    let mut out = Turnaround { views: Vec::new(), center, radius, moved: 0, dropped: Vec::new() };
    for number in 0..settings.count {
        run.step("turnaround", number, settings.count)?;
        let turn = Quat::from_axis_angle(up, std::f32::consts::TAU * number as f32 / settings.count as f32);
        let mut most = 0.0f32;
        let mut found = None;
        for (variant, eye) in variants(eye, up, radius).into_iter().enumerate() {
            let candidate = View { pose: Pose::look_at(center + turn * eye, center, up), ..*view };
            if encloses(scene, candidate.pose.position, center) {
                continue;
            }
            let small = within(&candidate, 320);
            let by_itself = raster.visibility(&alone, &small, VISIBLE_WEIGHT)?;
            let mut seen = raster.visibility(scene, &small, VISIBLE_WEIGHT)?;
            seen.apply(splat_core::SelectMode::Intersect, &by_itself);
            let share = seen.count() as f32 / by_itself.count().max(1) as f32;
            most = most.max(share);
            if share >= settings.least_visible {
                found = Some((variant, candidate));
                break;
            }
        }
        match found {
            Some((variant, candidate)) => {
                out.moved += usize::from(variant > 0);
                out.views.push(candidate);
            }
            None => out.dropped.push(Dropped { number, visible: most }),
        }
    }
    Ok(out)
}

/// Whether the eye stands inside something: within two standard deviations of a Gaussian that is not mostly transparent. Those
/// as large as the way to the centre are surroundings and do not count.
fn encloses(scene: &Scene, eye: Vec3, center: Vec3) -> bool {
    let way = eye.distance(center);
    scene.instances.iter().any(|instance| {
        let cloud = &instance.cloud;
        let local = instance.transform.inverse().apply(eye);
        let way = way / instance.transform.scale;
        (0..cloud.len()).into_par_iter().any(|i| {
            let d = local - cloud.means()[i];
            let largest = cloud.log_scales()[i].max_element().exp();
            // Cheap tests first: this runs over all Gaussians.
            d.length() < 2.0 * largest
                && largest < 0.5 * way
                && cloud.drawable(i)
                && cloud.opacity(i) >= 0.3
                && !instance.hidden.as_ref().is_some_and(|h| h.contains(i))
                && ((cloud.rotation(i).inverse() * d) / cloud.scale(i)).length() < 2.0
        })
    })
}

/// Positions to try where the object is hidden, the plain one first: nearer, then higher, then both.
fn variants(eye: Vec3, up: Vec3, radius: f32) -> Vec<Vec3> {
    let side = up.cross(eye).try_normalize().unwrap_or_else(|| up.any_orthonormal_vector());
    let nearer = |eye: Vec3, k: f32| eye.normalize_or_zero() * (eye.length() * k).max(1.5 * radius).min(eye.length());
    // Rotating about `side = up x eye` by a negative angle lifts the eye towards `up`; it stops short of the pole.
    let above = up.angle_between(eye);
    let lifted = |angle: f32| Quat::from_axis_angle(side, -angle.min((above - 0.17).max(0.0))) * eye;
    let (low, high) = (lifted(0.35), lifted(0.7));
    vec![eye, nearer(eye, 0.7), low, nearer(low, 0.7), nearer(eye, 0.45), high, nearer(high, 0.6)]
}

/// Position of the annotated camera, moved along its line to the centre if the object would be too small or too large.
fn framed_eye(view: &View, center: Vec3, radius: f32, fill: Option<(f32, f32)>) -> Vec3 {
    let eye = view.pose.position;
    let distance = eye.distance(center);
    let Some((least, most)) = fill.filter(|_| distance > 1e-9) else { return eye };
    // A sphere of radius r at distance d is f r / d pixels in radius.
    let short = view.width.min(view.height) as f32;
    let focal = view.intrinsics.fx.min(view.intrinsics.fy);
    let at_fill = |share: f32| 2.0 * focal * radius / (share * short);
    let wanted = distance.clamp(at_fill(most.max(least)), at_fill(least.min(most)));
    center + (eye - center) * (wanted / distance)
}

/// World points under the mask at the median depth, and the Gaussians hit.
pub(crate) fn surface(scene: &Scene, view: &View, mask: &Mask2d, frame: &Frame) -> (Vec<Vec3>, Selection) {
    let mut hits = Selection::none(scene.len());
    let mut points = Vec::new();
    let width = view.width as usize;
    for (k, (&id, &m)) in frame.first_hits.iter().zip(mask.values()).enumerate() {
        let depth = frame.median_depth.get(k).copied().unwrap_or(f32::NAN);
        if m < Mask2d::HALF || id == Frame::NO_ID || !depth.is_finite() {
            continue;
        }
        hits.insert(id as usize);
        let pixel = Vec2::new((k % width) as f32 + 0.5, (k / width) as f32 + 0.5);
        points.push(view.unproject(pixel, depth));
    }
    (points, hits)
}

/// The scene with only `shown` drawn.
pub(crate) fn alone(scene: &Scene, shown: &Selection) -> Scene {
    let mut offset = 0;
    let instances = scene.instances.iter().map(|instance| {
        let n = instance.cloud.len();
        let was = instance.hidden.as_ref();
        let hidden = Selection::from_fn(n, |i| !shown.contains(offset + i) || was.is_some_and(|h| h.contains(i)));
        offset += n;
        Instance { hidden: Some(hidden.into()), ..instance.clone() }
    });
    Scene { instances: instances.collect() }
}

/// Value below which `share` of the values lie.
fn quantile(values: impl Iterator<Item = f32>, share: f32) -> f32 {
    let mut v: Vec<f32> = values.collect();
    if v.is_empty() {
        return 0.0;
    }
    let k = ((v.len() - 1) as f32 * share).round() as usize;
    *v.select_nth_unstable_by(k, f32::total_cmp).1
}
