//! The adjoint of `features` with one channel, made of votes.

use splat_core::{Mask2d, View};
use splat_raster::{Rasterizer, Scene, VOTE_UNIT};

use crate::SegmentError;

/// `g_i = sum_p w_i(p) residual(p)` for every Gaussian: the gradient of a picture of one channel, through the
/// rasteriser's votes alone.
///
/// `residual`: one value per pixel, row-major, any sign; pixels that are not finite count as 0. Its positive and
/// negative parts are voted for as two masks of 8 bits each (16 in all), so that the error per pixel stays under 2^-16 of the
/// largest residual. One frame without colour.
///
/// # Errors
/// [`SegmentError::Length`] if there is not one residual per pixel, [`SegmentError::Raster`] if the view is unusable.
pub fn adjoint(
    raster: &mut dyn Rasterizer,
    scene: &Scene,
    view: &View,
    residual: &[f32],
) -> Result<Vec<f64>, SegmentError> {
    let expected = view.width as usize * view.height as usize;
    if residual.len() != expected {
        return Err(SegmentError::Length { what: "residual", found: residual.len(), expected });
    }
    let largest = residual.iter().filter(|r| r.is_finite()).fold(0.0f32, |m, r| m.max(r.abs()));
    if largest == 0.0 {
        return Ok(vec![0.0; scene.len()]);
    }
    let mut parts: [Vec<u8>; 4] = std::array::from_fn(|_| vec![0; expected]);
    for (k, &r) in residual.iter().enumerate().filter(|(_, r)| r.is_finite()) {
        let level = (f64::from(r.abs()) / f64::from(largest) * 65_535.0).round() as u16;
        let [high, low] = level.to_be_bytes();
        let sign = if r < 0.0 { 2 } else { 0 };
        parts[sign][k] = high;
        parts[sign + 1][k] = low;
    }
    let masks = parts.map(|values| Mask2d::new(view.width, view.height, values));
    let [a, b, c, d] = masks;
    let masks = [a?, b?, c?, d?];
    let votes = raster.votes(scene, view, &[&masks[0], &masks[1], &masks[2], &masks[3]])?;
    let scale = f64::from(largest) * VOTE_UNIT * 255.0 / 65_535.0;
    let at = |k: usize, i: usize| votes.inside[k][i] as f64;
    Ok((0..scene.len()).map(|i| scale * ((256.0 * at(0, i) + at(1, i)) - (256.0 * at(2, i) + at(3, i)))).collect())
}
