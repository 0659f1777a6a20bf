//! The edge of an extracted object: Gaussians that straddle it are found and, on request, split or trimmed.
//!
//! A selection takes Gaussians whole. One that reaches over the object's edge takes a strip of the background along (a halo),
//! or leaves a strip of the object behind. [`extract`] gives two clouds, object and rest, in which such Gaussians are kept as they
//! are ([`Boundary::Keep`]), cut into pieces that go to either side ([`Boundary::Split`]; both clouds together still look
//! like the input), or shortened to their own side ([`Boundary::Trim`]). The selection itself stays in input ids.

mod find;
mod profile;

pub use find::{Cut, StraddleSettings, Straddler, share_spread, straddlers};
pub use profile::{Piece, split, trim};

use std::sync::Arc;

use glam::{Mat3, Vec3};
use rayon::prelude::*;
use splat_core::{Cloud, CloudArrays, Mask2d, Selection, View};
use splat_raster::{Features, Rasterizer, Scene};

use crate::aggregations::MaskedView;
use crate::{Run, SegmentError};

/// What happens to Gaussians that straddle the edge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Boundary {
    /// They stay whole, on the side the selection says. They are counted.
    #[default]
    Keep,
    /// They are cut along the axis that crosses the edge into about this many pieces (2 to 8), which go to either side.
    Split {
        /// Pieces per Gaussian; 4 looks like the input, 2 is smaller.
        pieces: usize,
    },
    /// They are shortened along that axis to their own side; what is cut off is gone.
    Trim,
}

impl Boundary {
    /// Splitting into 4 pieces.
    pub const SPLIT: Self = Self::Split { pieces: 4 };
}

/// What was done at the edge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BoundaryReport {
    /// Gaussians on the edge, by any of the three signs below.
    pub straddling: usize,
    /// Of those: the share of inside votes is in between.
    pub mixed: usize,
    /// Of those: views contradict each other.
    pub contested: usize,
    /// Of those: an axis reaches over the edge, so that they can be cut.
    pub reaching: usize,
    /// Selected Gaussians that were split or trimmed.
    pub cut_selected: usize,
    /// Unselected Gaussians that were split or trimmed.
    pub cut_rest: usize,
    /// Pieces of split Gaussians that went to the object.
    pub pieces_object: usize,
    /// Pieces of split Gaussians that went to the rest.
    pub pieces_rest: usize,
}

/// An object taken out of its cloud.
#[derive(Clone, Debug, PartialEq)]
pub struct Extraction {
    /// The object.
    pub object: Cloud,
    /// What is left.
    pub rest: Cloud,
    /// For every Gaussian of the object the input id it is or came from, rising.
    pub object_from: Vec<u32>,
    /// For every Gaussian of the rest the input id it is or came from, rising.
    pub rest_from: Vec<u32>,
    /// What was done at the edge.
    pub report: BoundaryReport,
}

/// Takes `selection` out of `cloud`.
///
/// `views`: masks of the object in views of the cloud's own space; [`silhouettes`] makes some where there are none. Without any,
/// nothing is known about the edge and everything stays whole. Properties beyond the standard ones are copied to pieces.
///
/// # Errors
/// As [`straddlers`].
pub fn extract(
    raster: &mut dyn Rasterizer,
    cloud: &Arc<Cloud>,
    selection: &Selection,
    views: &[MaskedView<'_>],
    boundary: Boundary,
    settings: &StraddleSettings,
    run: &Run,
) -> Result<Extraction, SegmentError> {
    let scene = Scene::of(cloud.clone());
    let found = straddlers(raster, &scene, cloud, selection, views, settings, run)?;
    extract_with(cloud, selection, &found, boundary)
}

/// As [`extract`], with the straddling Gaussians already found (by rising id).
///
/// # Errors
/// [`SegmentError::Cloud`] if pieces make a cloud of more Gaussians than ids can name.
pub fn extract_with(
    cloud: &Cloud,
    selection: &Selection,
    found: &[Straddler],
    boundary: Boundary,
) -> Result<Extraction, SegmentError> {
    let mut report = BoundaryReport {
        straddling: found.len(),
        mixed: found.iter().filter(|s| s.mixed).count(),
        contested: found.iter().filter(|s| s.contested).count(),
        reaching: found.iter().filter(|s| s.cut.is_some()).count(),
        ..BoundaryReport::default()
    };
    let cuts: Vec<(u32, Cut)> = found.iter().filter_map(|s| s.cut.map(|c| (s.id, c))).collect();
    let pieces: Vec<Vec<Piece>> = cuts
        .par_iter()
        .map(|&(id, cut)| {
            let opacity = f64::from(cloud.opacity(id as usize)).clamp(0.0, 0.99);
            let (low, high) = (f64::from(cut.low), f64::from(cut.high));
            match boundary {
                Boundary::Keep => Vec::new(),
                Boundary::Split { pieces } => split(opacity, low, high, pieces.clamp(2, 8)),
                Boundary::Trim => vec![trim(opacity, low, high)],
            }
        })
        .collect();

    let mut object = Side::default();
    let mut rest = Side::default();
    let mut next = 0;
    for id in 0..cloud.len() as u32 {
        let selected = selection.contains(id as usize);
        while next < cuts.len() && cuts[next].0 < id {
            next += 1;
        }
        let cut = (next < cuts.len() && cuts[next].0 == id && !pieces[next].is_empty())
            .then(|| (&cuts[next].1, &pieces[next]));
        let Some((cut, pieces)) = cut else {
            if selected { &mut object } else { &mut rest }.from.push(id);
            continue;
        };
        *(if selected { &mut report.cut_selected } else { &mut report.cut_rest }) += 1;
        for piece in pieces {
            let to_object =
                if selected { piece.own } else { !piece.own && clear_of(cut, piece, cloud.scale(id as usize)) };
            *(if to_object { &mut report.pieces_object } else { &mut report.pieces_rest }) += 1;
            let side = if to_object { &mut object } else { &mut rest };
            side.changed.push((side.from.len(), cut.axis, *piece));
            side.from.push(id);
        }
    }
    Ok(Extraction {
        object: object.build(cloud)?,
        rest: rest.build(cloud)?,
        object_from: object.from,
        rest_from: rest.from,
        report,
    })
}

/// Whether the object may have a piece of an unselected Gaussian without a halo of its own: it lies beyond the cut by its standard
/// deviation at least, and is no wider across (where nothing was cut) than along.
fn clear_of(cut: &Cut, piece: &Piece, scale: Vec3) -> bool {
    let beyond = (piece.center - f64::from(cut.high)).max(f64::from(cut.low) - piece.center);
    let along = f64::from(scale[cut.axis]) * piece.sigma;
    let across = f64::from(scale[(cut.axis + 1) % 3].max(scale[(cut.axis + 2) % 3]));
    beyond >= piece.sigma && across <= along
}

/// One of the two clouds while it is put together.
#[derive(Default)]
struct Side {
    from: Vec<u32>,
    /// Position, axis and piece of those that are not whole.
    changed: Vec<(usize, usize, Piece)>,
}

impl Side {
    fn build(&self, cloud: &Cloud) -> Result<Cloud, SegmentError> {
        let mut arrays: CloudArrays = cloud.pick(&self.from).into_arrays();
        if !self.changed.is_empty() {
            // The bytes kept for writing the file back untouched belong to another cloud now.
            arrays.source.layout = None;
        }
        for &(k, axis, piece) in &self.changed {
            let id = self.from[k] as usize;
            let arm = Mat3::from_quat(cloud.rotation(id)).col(axis) * cloud.scale(id)[axis];
            arrays.means[k] += arm * piece.center as f32;
            arrays.log_scales[k][axis] += piece.sigma.ln() as f32;
            let opacity = piece.opacity;
            arrays.opacity_logits[k] = (opacity / (1.0 - opacity)).ln() as f32;
        }
        Ok(Cloud::new(arrays)?)
    }
}

/// Masks of a selection in some views: pixels of which it has more than half of the blending weight. For edges of selections that
/// were made without masks.
///
/// # Errors
/// [`SegmentError::Cancelled`], [`SegmentError::Raster`].
pub fn silhouettes(
    raster: &mut dyn Rasterizer,
    scene: &Scene,
    selection: &Selection,
    views: &[View],
    run: &Run,
) -> Result<Vec<Mask2d>, SegmentError> {
    let values: Vec<f32> = (0..scene.len()).map(|i| if selection.contains(i) { 1.0 } else { 0.0 }).collect();
    let mut masks = Vec::with_capacity(views.len());
    for (done, view) in views.iter().enumerate() {
        run.step("silhouettes", done, views.len())?;
        let picture = raster.features(scene, view, Features { channels: 1, values: &values })?;
        let soft = picture.iter().map(|v| if *v > 0.5 { 255 } else { 0 }).collect();
        masks.push(Mask2d::new(view.width, view.height, soft)?);
    }
    Ok(masks)
}

/// How far an extracted object reaches beyond its masks.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Halo {
    /// Pixels outside the masks at which the object by itself is more opaque than the threshold.
    pub pixels: u64,
    /// Sum of the object's opacity over pixels outside the masks.
    pub opacity: f64,
    /// Pixels inside the masks, to compare with.
    pub mask_pixels: u64,
}

/// Measures the halo of `object` by itself over some masks. Use views in which nothing hides the object: there the mask is
/// its whole silhouette.
///
/// # Errors
/// [`SegmentError::Raster`].
pub fn halo(
    raster: &mut dyn Rasterizer,
    object: &Arc<Cloud>,
    views: &[MaskedView<'_>],
    least_alpha: f32,
) -> Result<Halo, SegmentError> {
    let scene = Scene::of(object.clone());
    let mut out = Halo::default();
    for v in views {
        let picture = raster.render(&scene, v.view)?;
        for (c, &m) in picture.iter().zip(v.mask.values()) {
            if m >= Mask2d::HALF {
                out.mask_pixels += 1;
            } else {
                out.pixels += u64::from(c[3] > least_alpha);
                out.opacity += f64::from(c[3]);
            }
        }
    }
    Ok(out)
}
