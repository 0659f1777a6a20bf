//! The graph of superpoints ("patches"): what each is, and what lies between two that touch.

use glam::{DVec3, Vec3};
use splat_core::Cloud;

use super::edges::{Edge, LAB_UNIT};
use super::evidence::Evidence;
use super::features::Feature;

/// One superpoint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Patch {
    /// Gaussians in it.
    pub count: u32,
    /// Pixels of the preparation's pictures that show it, plus a little for every Gaussian, so that nothing counts 0.
    pub mass: f32,
    /// Centre, in scene units.
    pub center: Vec3,
    /// Mean colour, CIE Lab.
    pub lab: Vec3,
    /// Mean colour together with the patches around it, CIE Lab: alike for all patches of one pattern.
    pub pattern: Vec3,
    /// Mean normal; its length tells how well the normals agree.
    pub normal: Vec3,
}

/// What lies between two patches that touch, `a < b`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Border {
    /// Lower patch.
    pub a: u32,
    /// Higher patch.
    pub b: u32,
    /// Edges of the neighbour graph across it.
    pub count: u32,
    /// Mean dissimilarity of those edges.
    pub edge: f32,
    /// Colour difference of the patches, in units of 20 Lab.
    pub color: f32,
    /// Colour difference of their surroundings, in units of 20 Lab.
    pub pattern: f32,
    /// `1 - cos` of the angle between the patches' normals times their sureness; positive if concave, negative if convex.
    pub bend: f32,
    /// How sure it is that one surface runs on across the border, 0 to 1.
    pub smooth: f32,
}

/// Superpoints and their borders.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PatchGraph {
    /// Patch of every Gaussian.
    pub of: Vec<u32>,
    /// The patches.
    pub patches: Vec<Patch>,
    /// Borders by rising (a, b).
    pub borders: Vec<Border>,
}

/// Mass of a Gaussian that no picture shows, in pixels.
const UNSEEN_MASS: f32 = 0.01;
/// Rings of patches around one that make its pattern.
const PATTERN_RINGS: usize = 2;

impl PatchGraph {
    /// Sums Gaussians and edges up to patches.
    ///
    /// `of`: patch of every Gaussian; `count`: number of patches.
    pub fn new(
        cloud: &Cloud,
        features: &[Feature],
        evidence: &Evidence,
        edges: &[Edge],
        of: Vec<u32>,
        count: usize,
    ) -> Self {
        let patches = sum_patches(cloud, features, evidence, &of, count);
        let borders = sum_borders(edges, &of);
        let mut graph = Self { of, patches, borders };
        graph.spread_patterns();
        graph.compare();
        graph
    }

    fn spread_patterns(&mut self) {
        let mut pattern: Vec<(Vec3, f32)> = self.patches.iter().map(|p| (p.lab, p.mass)).collect();
        for _ in 0..PATTERN_RINGS {
            let mut sums: Vec<(Vec3, f32)> = pattern.iter().map(|&(lab, m)| (lab * m, m)).collect();
            for b in &self.borders {
                for (x, y) in [(b.a, b.b), (b.b, b.a)] {
                    let (lab, m) = pattern[y as usize];
                    let s = &mut sums[x as usize];
                    s.0 += lab * m;
                    s.1 += m;
                }
            }
            for (p, s) in pattern.iter_mut().zip(sums) {
                *p = (s.0 / s.1, s.1);
            }
        }
        for (patch, (lab, _)) in self.patches.iter_mut().zip(pattern) {
            patch.pattern = lab;
        }
    }

    fn compare(&mut self) {
        for border in &mut self.borders {
            let (a, b) = (&self.patches[border.a as usize], &self.patches[border.b as usize]);
            border.color = (a.lab - b.lab).length() / LAB_UNIT;
            border.pattern = (a.pattern - b.pattern).length() / LAB_UNIT;
            let sure = a.normal.length().min(b.normal.length()).min(1.0).powi(2);
            let (na, nb) = (a.normal.normalize_or_zero(), b.normal.normalize_or_zero());
            let cos = na.dot(nb);
            let convex = (na - nb).dot(a.center - b.center) > 0.0;
            border.bend = sure * (1.0 - cos) * if convex { -1.0 } else { 1.0 };
            // Over a convex corner a thing goes on: a box's faces are one box.
            border.smooth = sure * if convex { cos.max(0.3) } else { cos.max(0.0).powi(2) };
        }
    }
}

fn sum_patches(cloud: &Cloud, features: &[Feature], evidence: &Evidence, of: &[u32], count: usize) -> Vec<Patch> {
    #[derive(Clone, Copy, Default)]
    struct Sum {
        count: u32,
        mass: f64,
        center: DVec3,
        lab: DVec3,
        normal: DVec3,
    }
    let mut sums = vec![Sum::default(); count];
    for (i, &p) in of.iter().enumerate() {
        let s = &mut sums[p as usize];
        let m = f64::from(evidence.pixels[i] as f32 + UNSEEN_MASS);
        s.count += 1;
        s.mass += m;
        let mean = if cloud.means()[i].is_finite() { cloud.means()[i] } else { Vec3::ZERO };
        s.center += mean.as_dvec3() * m;
        s.lab += features[i].lab.as_dvec3() * m;
        s.normal += features[i].normal.as_dvec3() * (m * f64::from(features[i].confidence.max(0.1)));
    }
    sums.iter()
        .map(|s| Patch {
            count: s.count,
            mass: s.mass as f32,
            center: (s.center / s.mass).as_vec3(),
            lab: (s.lab / s.mass).as_vec3(),
            pattern: Vec3::ZERO,
            normal: (s.normal / s.mass).as_vec3(),
        })
        .collect()
}

fn sum_borders(edges: &[Edge], of: &[u32]) -> Vec<Border> {
    let mut across: Vec<(u64, f32)> = edges
        .iter()
        .filter_map(|e| {
            let (a, b) = (of[e.a as usize], of[e.b as usize]);
            (a != b).then(|| (u64::from(a.min(b)) << 32 | u64::from(a.max(b)), e.d))
        })
        .collect();
    // Stable, so that sums of floats have one order.
    across.sort_by_key(|e| e.0);
    across
        .chunk_by(|x, y| x.0 == y.0)
        .map(|run| Border {
            a: (run[0].0 >> 32) as u32,
            b: run[0].0 as u32,
            count: run.len() as u32,
            edge: (run.iter().map(|e| f64::from(e.1)).sum::<f64>() / run.len() as f64) as f32,
            ..Border::default()
        })
        .collect()
}
