//! [`CHECKS`]: every test that `splat check` makes. To add one: a function in the file it belongs to, and its line here.

use std::sync::OnceLock;

use splat_core::bounds::robust_bounds;
use splat_core::glam::Vec3;
use splat_core::{Cloud, CloudArrays, Neighbours};

use super::{conventions, gaussians};

/// Neighbours looked at per Gaussian.
pub(super) const NEIGHBOURS: usize = 8;

/// A test.
pub(super) struct Check {
    /// Short name, as in `--keep`.
    pub(super) name: &'static str,
    /// What is looked for, in one line.
    pub(super) about: &'static str,
    /// What to do about it, in one sentence.
    pub(super) advice: &'static str,
    /// Gives what was found, if anything.
    pub(super) find: fn(&Look) -> Option<Finding>,
}

/// What a test found.
pub(super) struct Finding {
    /// How many Gaussians.
    pub(super) count: usize,
    /// What is the matter with them, in one sentence.
    pub(super) what: String,
    /// How to put it right.
    pub(super) repair: Repair,
}

/// How to put something right.
pub(super) enum Repair {
    /// Without these Gaussians.
    Drop(Vec<u32>),
    /// With other values; gives what was done in a few words.
    Change(Box<dyn FnOnce(&mut CloudArrays) -> String>),
    /// Only the user can tell.
    Nothing,
}

/// What several tests look at, found once.
pub(super) struct Look<'a> {
    pub(super) cloud: &'a Cloud,
    /// Median of the means and the radius that holds 90 % of them.
    pub(super) bulk: Option<(Vec3, f32)>,
    neighbours: OnceLock<Neighbours>,
}

impl<'a> Look<'a> {
    pub(super) fn new(cloud: &'a Cloud) -> Self {
        let bulk = robust_bounds(cloud).map(|b| (b.center, b.radius));
        Self { cloud, bulk, neighbours: OnceLock::new() }
    }

    /// The nearest others of every Gaussian, found on first use.
    pub(super) fn neighbours(&self) -> &Neighbours {
        self.neighbours.get_or_init(|| Neighbours::build(self.cloud.means(), NEIGHBOURS))
    }

    /// Ids of the Gaussians that pass a test.
    pub(super) fn ids(&self, test: impl Fn(usize) -> bool) -> Vec<u32> {
        (0..self.cloud.len()).filter(|&i| test(i)).map(|i| i as u32).collect()
    }
}

impl Finding {
    /// Gaussians that should go; nothing if there are none.
    pub(super) fn drop(ids: Vec<u32>, what: impl Into<String>) -> Option<Self> {
        (!ids.is_empty()).then(|| Self { count: ids.len(), what: what.into(), repair: Repair::Drop(ids) })
    }

    /// Values that should change; nothing if `count` is 0.
    pub(super) fn change(
        count: usize,
        what: impl Into<String>,
        change: impl FnOnce(&mut CloudArrays) -> String + 'static,
    ) -> Option<Self> {
        (count > 0).then(|| Self { count, what: what.into(), repair: Repair::Change(Box::new(change)) })
    }
}

/// Every test, in the order of repairs.
pub(super) static CHECKS: &[Check] = &[
    Check { name: "empty", about: "no Gaussians at all", advice: "export the capture again", find: conventions::empty },
    Check {
        name: "linear-scales",
        about: "scales stored as lengths where logarithms belong",
        advice: "repair takes their logarithms; otherwise everything is a fog of unit-sized blobs",
        find: conventions::linear_scales,
    },
    Check {
        name: "linear-opacity",
        about: "opacities stored from 0 to 1 where logits belong",
        advice: "repair turns them into logits; otherwise everything is half transparent",
        find: conventions::linear_opacity,
    },
    Check {
        name: "plain-colors",
        about: "colours stored from 0 to 1 or 0 to 255 where SH coefficients belong",
        advice: "repair turns them into coefficients; otherwise everything is pale",
        find: conventions::plain_colors,
    },
    Check {
        name: "tilted",
        about: "a floor that is not level, or above everything",
        advice: "`splat orient FILE --floor -o OUT` makes it level; --up names the direction that shall be up",
        find: conventions::tilted,
    },
    Check {
        name: "not-finite",
        about: "NaN or infinity in position, scale, rotation or opacity",
        advice: "they are never drawn; repair drops them",
        find: gaussians::not_finite,
    },
    Check {
        name: "colors",
        about: "NaN or infinity among SH coefficients",
        advice: "they can blacken whole pixels; repair sets those coefficients to 0",
        find: gaussians::bad_colors,
    },
    Check {
        name: "rotations",
        about: "rotations of length zero",
        advice: "they are drawn unrotated; repair writes that down",
        find: gaussians::zero_rotations,
    },
    Check {
        name: "unused-sh",
        about: "SH degrees in which every coefficient is 0",
        advice: "repair leaves them out: the file shrinks, the picture is the same",
        find: gaussians::unused_sh,
    },
    Check {
        name: "transparent",
        about: "opacities below 1/255, which no pixel shows",
        advice: "repair drops them: the picture is the same",
        find: gaussians::transparent,
    },
    Check {
        name: "duplicates",
        about: "Gaussians that equal an earlier one in every value",
        advice: "repair keeps the first of each; where they lie over each other the picture becomes more transparent",
        find: gaussians::duplicates,
    },
    Check {
        name: "far",
        about: "Gaussians a hundred times farther out than the bulk",
        advice: "they spoil bounds and depth; repair drops them",
        find: gaussians::far,
    },
    Check {
        name: "giants",
        about: "Gaussians with a standard deviation larger than the whole bulk",
        advice: "they are a haze over everything, or a sky; repair drops them unless you --keep giants",
        find: gaussians::giants,
    },
    Check {
        name: "floaters",
        about: "lone Gaussians, far from their neighbours for their size",
        advice: "look at them with `splat render`; repair drops them unless you --keep floaters",
        find: gaussians::floaters,
    },
];
