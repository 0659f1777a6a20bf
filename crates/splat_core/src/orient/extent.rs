//! How long something is along a direction, floaters left out: [`extent_along`].

use glam::Vec3;

use super::weights;
use crate::{Cloud, Selection};

/// Share of the area at either end that does not count.
const TRIM: f64 = 0.005;

/// From where to where the selected Gaussians (all without a selection) reach along a direction, in scene units.
///
/// Each Gaussian reaches one standard deviation beyond its mean; half a percent of the area at either end does not count. `None` if
/// nothing can be drawn.
///
/// # Panics
/// If the selection belongs to a cloud of another length.
pub fn extent_along(cloud: &Cloud, selection: Option<&Selection>, direction: Vec3) -> Option<(f32, f32)> {
    assert!(selection.is_none_or(|s| s.len() == cloud.len()), "a selection of another cloud");
    let direction = direction.try_normalize()?;
    let weights = weights(cloud, selection);
    let mut reaches: Vec<(f32, f32, f64)> = (0..cloud.len())
        .filter(|&i| weights[i] > 0.0)
        .map(|i| {
            let at = direction.dot(cloud.means()[i]);
            let deviation = direction.dot(cloud.covariance(i) * direction).max(0.0).sqrt();
            (at - deviation, at + deviation, weights[i])
        })
        .collect();
    let total: f64 = reaches.iter().map(|r| r.2).sum();
    let mut first_beyond = |key: fn(&(f32, f32, f64)) -> f32| {
        reaches.sort_by(|a, b| key(a).total_cmp(&key(b)));
        let mut sum = 0.0;
        let beyond = |r: &&(f32, f32, f64)| {
            sum += r.2;
            sum > TRIM * total
        };
        reaches.iter().find(beyond).or(reaches.last()).map(key)
    };
    let low = first_beyond(|r| r.0)?;
    let high = -first_beyond(|r| -r.1)?;
    // Of one Gaussian, or a few alike, both ends are its own.
    Some((low.min(high), high.max(low)))
}
