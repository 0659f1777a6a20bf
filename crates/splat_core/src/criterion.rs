//! Selections by value: [`Criterion`], and what is [`similar`] to a seed.

use std::ops::RangeInclusive;

use glam::Vec3;

use crate::{Cloud, KdTree, Selection, Similarity, color::lab_from_srgb};

/// Which Gaussians are meant, by one of their values. NaN meets no criterion.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Criterion {
    /// The mean lies in a box along the axes, faces included.
    Box {
        /// Lower corner, in scene units.
        min: Vec3,
        /// Upper corner.
        max: Vec3,
    },
    /// The mean lies in a turned box, faces included.
    OrientedBox {
        /// Maps the cube from -1 to 1 along each axis, stretched by `half`, into the scene.
        scene_from_box: Similarity,
        /// Half the sides, in units of the box's own space.
        half: Vec3,
    },
    /// The mean lies in a ball, its surface included.
    Sphere {
        /// Centre, in scene units.
        center: Vec3,
        /// Radius, in scene units.
        radius: f32,
    },
    /// Opacity, 0 to 1.
    Opacity(RangeInclusive<f32>),
    /// Largest standard deviation, in scene units.
    Scale(RangeInclusive<f32>),
    /// Largest standard deviation over the smallest: 1 for balls, large for discs and needles.
    Elongation(RangeInclusive<f32>),
    /// Volume of the one-sigma ellipsoid, in scene units cubed: `4/3 pi s1 s2 s3`.
    Volume(RangeInclusive<f32>),
    /// The base colour is at most `tolerance` away from a colour, in CIE Lab (CIE76; 2 is just noticeable, 20 a shade, 100 black to
    /// white).
    Color {
        /// The colour, sRGB-encoded, 0 to 1 per channel.
        srgb: Vec3,
        /// Distance in Lab.
        tolerance: f32,
    },
}

impl Criterion {
    /// Whether Gaussian `i` meets it.
    ///
    /// # Panics
    /// If `i` is not below the cloud's length.
    pub fn met(&self, cloud: &Cloud, i: usize) -> bool {
        let mean = cloud.means()[i];
        match self {
            Self::Box { min, max } => mean.cmpge(*min).all() && mean.cmple(*max).all(),
            Self::OrientedBox { scene_from_box, half } => scene_from_box.inverse().apply(mean).abs().cmple(*half).all(),
            Self::Sphere { center, radius } => *radius >= 0.0 && mean.distance_squared(*center) <= radius * radius,
            Self::Opacity(range) => range.contains(&cloud.opacity(i)),
            Self::Scale(range) => range.contains(&max_nan(cloud.scale(i))),
            Self::Elongation(range) => {
                let s = cloud.log_scales()[i];
                range.contains(&(max_nan(s) + max_nan(-s)).exp())
            }
            Self::Volume(range) => {
                range.contains(&(std::f32::consts::TAU / 1.5 * cloud.log_scales()[i].element_sum().exp()))
            }
            Self::Color { srgb, tolerance } => {
                lab_from_srgb(cloud.base_color(i)).distance(lab_from_srgb(*srgb)) <= *tolerance
            }
        }
    }

    /// All Gaussians of `cloud` that meet it.
    pub fn select(&self, cloud: &Cloud) -> Selection {
        Selection::from_fn_parallel(cloud.len(), |i| self.met(cloud, i))
    }
}

/// The largest element; NaN if any is.
fn max_nan(v: Vec3) -> f32 {
    if v.is_nan() { f32::NAN } else { v.max_element() }
}

/// How similar is [`similar`] enough.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Likeness {
    /// Largest distance of base colours in CIE Lab. More takes more.
    pub color_tolerance: f32,
    /// Largest ratio of sizes (geometric mean of the standard deviations), 1 or more; infinite where size does not matter.
    pub size_ratio: f32,
}

impl Default for Likeness {
    fn default() -> Self {
        Self { color_tolerance: 10.0, size_ratio: 4.0 }
    }
}

/// All Gaussians that are like at least one of the `seed`, in colour and size; the seed's own, where they have both, included.
///
/// # Panics
/// If the seed belongs to a cloud of another length.
pub fn similar(cloud: &Cloud, seed: &Selection, likeness: &Likeness) -> Selection {
    assert_eq!(seed.len(), cloud.len(), "a selection of another cloud");
    let ids = seed.ids();
    let lab = |i: usize| lab_from_srgb(cloud.base_color(i));
    // In logarithms a ratio is a distance.
    let size = |i: usize| cloud.log_scales()[i].element_sum() / 3.0;
    let reach = likeness.size_ratio.ln();
    let tree = KdTree::new(&ids.iter().map(|&i| lab(i as usize)).collect::<Vec<_>>());
    let sizes: Vec<f32> = ids.iter().map(|&i| size(i as usize)).collect();
    Selection::from_fn_parallel(cloud.len(), |i| {
        let own = size(i);
        tree.any_within(lab(i), likeness.color_tolerance, |k| (sizes[k as usize] - own).abs() <= reach)
    })
}

#[cfg(test)]
mod tests {
    use glam::Quat;

    use super::*;
    use crate::{CloudArrays, sh::C0};

    fn cloud() -> Cloud {
        let n = 400;
        let wave = |i: usize, k: f32| (i as f32 * k).sin();
        let mut a = CloudArrays::default();
        for i in 0..n {
            a.means.push(Vec3::new(wave(i, 1.1), wave(i, 2.3), wave(i, 0.7)) * 3.0);
            a.log_scales.push(Vec3::new(wave(i, 0.3), wave(i, 1.9), wave(i, 3.1)) * 2.0);
            a.rotations.push(Quat::IDENTITY);
            a.opacity_logits.push(wave(i, 0.9) * 5.0);
            a.sh.extend([wave(i, 0.13), wave(i, 0.17), wave(i, 0.29)].map(|c| 0.5 * c / C0));
        }
        a.means[3] = Vec3::NAN;
        a.log_scales[4].y = f32::NAN;
        a.opacity_logits[5] = f32::NAN;
        a.sh[18] = f32::NAN;
        Cloud::new(a).unwrap()
    }

    #[test]
    fn criteria_mean_what_they_say() {
        let c = cloud();
        let turn = Similarity { rotation: Quat::from_rotation_y(0.6), scale: 2.0, translation: Vec3::X };
        let s = |i: usize| c.scale(i).to_array();
        let largest = |i: usize| s(i).into_iter().reduce(f32::max).unwrap();
        let smallest = |i: usize| s(i).into_iter().reduce(f32::min).unwrap();
        let has_nan = |i: usize| s(i).iter().any(|s| s.is_nan());
        let near = |v: f32, low: f32, high: f32| v >= low && v <= high;
        type Slow<'a> = Box<dyn Fn(usize) -> bool + 'a>;
        let cases: Vec<(Criterion, Slow)> = vec![
            (
                Criterion::Box { min: Vec3::splat(-1.0), max: Vec3::splat(2.0) },
                Box::new(|i| c.means()[i].to_array().iter().all(|&x| near(x, -1.0, 2.0))),
            ),
            (
                Criterion::OrientedBox { scene_from_box: turn, half: Vec3::new(1.0, 0.5, 0.7) },
                Box::new(|i| {
                    let p = turn.rotation.conjugate() * (c.means()[i] - Vec3::X) / 2.0;
                    p.x.abs() <= 1.0 && p.y.abs() <= 0.5 && p.z.abs() <= 0.7
                }),
            ),
            (Criterion::Sphere { center: Vec3::Y, radius: 2.5 }, Box::new(|i| c.means()[i].distance(Vec3::Y) <= 2.5)),
            (Criterion::Opacity(0.25..=0.75), Box::new(|i| near(c.opacity(i), 0.25, 0.75))),
            (Criterion::Scale(0.5..=4.0), Box::new(|i| !has_nan(i) && near(largest(i), 0.5, 4.0))),
            (Criterion::Elongation(2.0..=20.0), Box::new(|i| !has_nan(i) && near(largest(i) / smallest(i), 2.0, 20.0))),
            (
                Criterion::Volume(0.1..=10.0),
                Box::new(|i| near(4.0 / 3.0 * std::f32::consts::PI * s(i).iter().product::<f32>(), 0.1, 10.0)),
            ),
            (
                Criterion::Color { srgb: Vec3::new(0.8, 0.4, 0.5), tolerance: 40.0 },
                Box::new(|i| lab_from_srgb(c.base_color(i)).distance(lab_from_srgb(Vec3::new(0.8, 0.4, 0.5))) <= 40.0),
            ),
        ];
        for (criterion, slow) in cases {
            let found = criterion.select(&c);
            assert_eq!(found, Selection::from_fn(c.len(), slow), "{criterion:?}");
            assert!(found.count() > 0 && found.count() < c.len(), "{criterion:?}");
        }
        assert!(!Criterion::Sphere { center: c.means()[0], radius: -1.0 }.met(&c, 0));
        assert_eq!(Criterion::Scale(0.0..=f32::INFINITY).select(&c).count(), 399);
        assert_eq!(Criterion::Opacity(0.0..=1.0).select(&Cloud::default()).len(), 0);
    }

    #[test]
    fn similar_ones_are_like_at_least_one_of_the_seed() {
        let c = cloud();
        let seed = Selection::from_ids(c.len(), [4, 6, 10, 11, 12, 200]);
        for likeness in [
            Likeness::default(),
            Likeness { color_tolerance: 25.0, size_ratio: 1.2 },
            Likeness { color_tolerance: 15.0, size_ratio: f32::INFINITY },
        ] {
            let lab = |i: usize| lab_from_srgb(c.base_color(i));
            let size = |i: usize| (c.scale(i).x * c.scale(i).y * c.scale(i).z).cbrt();
            let slow = Selection::from_fn(c.len(), |i| {
                seed.iter().any(|j| {
                    let ratio = size(i) / size(j);
                    let sizes = ratio.max(1.0 / ratio) <= likeness.size_ratio && !size(i).is_nan() && !size(j).is_nan();
                    lab(i).distance(lab(j)) <= likeness.color_tolerance && sizes
                })
            });
            assert_eq!(similar(&c, &seed, &likeness), slow, "{likeness:?}");
        }
        assert_eq!(similar(&c, &Selection::none(c.len()), &Likeness::default()).count(), 0);
    }
}
