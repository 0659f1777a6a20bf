//! Correcting clicks: more of this, less of that, without losing what earlier clicks settled.

use glam::Vec2;
use splat_core::{SelectMode, Selection};
use splat_raster::Frame;

use super::evidence::EvidenceSettings;
use super::look::{Look, inside_distance};
use super::prepared::Prepared;
use super::tree::TREES;

/// Whether a click asks for more or for less.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ClickKind {
    /// The object shall have this.
    Positive,
    /// The object shall not have this.
    Negative,
}

/// One candidate for what a correcting click may mean.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// Patches that change.
    pub patches: Selection,
    /// How likely; higher is better.
    pub score: f32,
    /// What the score is made of, in order of [`CHANGE_WEIGHTS`].
    pub signs: [f32; CHANGE_SIGNS],
}

/// Number of signs the score of a change is made of.
pub const CHANGE_SIGNS: usize = 14;

/// Weight of each sign.
pub const CHANGE_WEIGHTS: [(&str, f32); CHANGE_SIGNS] = [
    ("central", 4.452),
    ("size", -0.546),
    ("edge_gain", 4.099),
    ("shape_gain", -2.837),
    ("length_gain", -1.290),
    ("reach", 2.631),
    ("excess", 1.616),
    ("bulk", 0.096),
    ("border_gain", -0.348),
    ("area", -0.290),
    ("persistence", -0.351),
    ("near", -1.338),
    ("hidden", 0.293),
    ("rest", 2.801),
];

/// A selection that grows and shrinks by clicks. Patches first, single Gaussians where a click concerns a sliver.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ClickState {
    /// Patches that belong to the object.
    pub patches: Selection,
    /// Single Gaussians decided apart from their patch, rising by id.
    pub single: Vec<(u32, bool)>,
    /// Patches that clicks settled.
    pub settled: Vec<(u32, ClickKind)>,
}

/// Within this distance of the silhouette, in pixels of the view, an error is a sliver: only single Gaussians change.
const SLIVER: f32 = 5.0;

/// A change that scores less is not made; the click then changes what is right under it.
const SURE: f32 = 1.40;
/// A change may be taken whole, or only as far from the click as these many radii of the error.
const REACHES: [f32; 3] = [f32::INFINITY, 8.0, 3.0];

/// Nobody clicks the middle of an error to mean one that is this many squared radii large.
const ERROR_AREA: f32 = 32.0;
/// Nor one of which the view shows so little: its mass over the pixels shown.
const HIDDEN: f32 = 25.0;
/// Nor a negative click to throw nearly everything away.
const LEAST_REST: f32 = 0.35;

impl ClickState {
    /// Starts from a set of patches that a click on `patch` chose.
    pub fn new(patches: Selection, patch: u32) -> Self {
        Self { patches, single: Vec::new(), settled: vec![(patch, ClickKind::Positive)] }
    }

    /// All Gaussians of the object.
    pub fn selection(&self, prepared: &Prepared) -> Selection {
        let mut s = prepared.gaussians(&self.patches);
        for &(i, inside) in &self.single {
            if inside {
                s.insert(i as usize);
            } else {
                s.remove(i as usize);
            }
        }
        s
    }

    /// Answers a correcting click at pixel `at` of the look's view. Nothing changes where nothing is seen there.
    pub fn correct(&mut self, prepared: &Prepared, look: &Look, at: Vec2, kind: ClickKind) {
        let Some(gaussian) = look.gaussian(at) else { return };
        let patch = prepared.graph.of[gaussian as usize];
        let current = self.selection(prepared);
        let radius = error_radius(&current, look, at, kind);
        let wanted = kind == ClickKind::Positive;
        if radius < SLIVER || self.patches.contains(patch as usize) == wanted {
            self.flip_near(prepared, look, at, radius, patch, wanted);
            return;
        }
        let changes = self.changes(prepared, look, at, patch, kind, radius);
        let best = changes.into_iter().max_by(|a, b| a.score.total_cmp(&b.score));
        if let Some(change) = best.filter(|c| c.score > SURE) {
            let mode = if wanted { SelectMode::Add } else { SelectMode::Subtract };
            self.patches.apply(mode, &change.patches);
            self.single.retain(|&(i, _)| !change.patches.contains(prepared.graph.of[i as usize] as usize));
        } else {
            self.flip_near(prepared, look, at, radius, patch, wanted);
        }
        self.settled.push((patch, kind));
    }

    /// Gaussians of the clicked patch that are strongest at a pixel within `radius` of the click.
    fn flip_near(&mut self, prepared: &Prepared, look: &Look, at: Vec2, radius: f32, patch: u32, wanted: bool) {
        let r = radius.clamp(1.0, 64.0);
        let mut ids: Vec<u32> = Vec::new();
        let (w, h) = (look.view.width as i64, look.view.height as i64);
        let (cx, cy, reach) = (at.x as i64, at.y as i64, r.ceil() as i64);
        for y in (cy - reach).max(0)..=(cy + reach).min(h - 1) {
            for x in (cx - reach).max(0)..=(cx + reach).min(w - 1) {
                let near = ((x - cx) * (x - cx) + (y - cy) * (y - cy)) as f32 <= r * r;
                let id = look.solid[(y * w + x) as usize];
                if near && id != Frame::NO_ID && prepared.graph.of[id as usize] == patch {
                    ids.push(id);
                }
            }
        }
        ids.sort_unstable();
        ids.dedup();
        self.single.retain(|(i, _)| ids.binary_search(i).is_err());
        self.single.extend(ids.into_iter().map(|i| (i, wanted)));
        self.single.sort_unstable();
    }

    /// What a click on `patch` may mean, in no particular order: the clicked patch alone, or it together with what the trees
    /// join it to, up to nodes that hold a patch which another click settled the other way.
    pub fn changes(
        &self,
        prepared: &Prepared,
        look: &Look,
        at: Vec2,
        patch: u32,
        kind: ClickKind,
        radius: f32,
    ) -> Vec<Change> {
        let wanted = kind == ClickKind::Positive;
        let before = Quality::of(prepared, &self.patches);
        let pixel = look.pixel(at);
        let masses = |s: &Selection| s.iter().map(|p| prepared.graph.patches[p].mass).sum::<f32>();
        let own_mass = masses(&self.patches).max(1e-3);
        let mut seen: Vec<Selection> = Vec::new();
        let mut out = Vec::new();
        // The error's radius in scene units, at the depth of the click.
        let center = prepared.graph.patches[patch as usize].center;
        let depth = look.view.to_view(center).z.max(look.view.near);
        let unit = look.view.unproject(Vec2::new(1.0, 0.0), depth) - look.view.unproject(Vec2::ZERO, depth);
        let radius_3d = radius * unit.length();
        // Masses count pixels of the preparation's pictures.
        let look_scale = EvidenceSettings::default().pixels as f32 / (look.view.width as f32 * look.view.height as f32);
        for tree in &prepared.trees {
            for node in tree.ancestors(patch) {
                let inside = tree.patches(node);
                if self.settled.iter().any(|&(p, k)| k != kind && inside.contains(&p)) {
                    break;
                }
                for reach in REACHES {
                    let near = |p: u32| {
                        p == patch || prepared.graph.patches[p as usize].center.distance(center) <= reach * radius_3d
                    };
                    let change = Selection::from_ids(
                        prepared.patch_count(),
                        inside.iter().copied().filter(|&p| self.patches.contains(p as usize) != wanted && near(p)),
                    );
                    if seen.contains(&change) {
                        continue;
                    }
                    let mut after = self.patches.clone();
                    after.apply(if wanted { SelectMode::Add } else { SelectMode::Subtract }, &change);
                    if after.count() == 0 {
                        continue;
                    }
                    let quality = Quality::of(prepared, &after);
                    let shown: Vec<bool> =
                        look.patch.iter().map(|&p| p != Look::NOTHING && change.contains(p as usize)).collect();
                    let step = look.step as f32;
                    let area = shown.iter().filter(|&&x| x).count() as f32 * step * step;
                    if area > ERROR_AREA * radius * radius {
                        continue;
                    }
                    let distance = inside_distance(&shown, look.width, look.height);
                    let most = distance.iter().copied().fold(0.0, f32::max);
                    let (here, most) = (distance[pixel].min(1e5), most.min(1e5));
                    let mass = masses(&change);
                    let unseen = mass / (area * look_scale + 1.0);
                    if change.count() > 1 && unseen > HIDDEN {
                        continue;
                    }
                    let rest = if wanted { 1.0 } else { (1.0 - mass / own_mass).max(0.0) };
                    if rest < LEAST_REST {
                        continue;
                    }
                    let node = &tree.nodes[node as usize];
                    let parent = &tree.nodes[node.parent as usize];
                    let signs = [
                        here / most.max(1.0),
                        (mass / own_mass).max(1e-6).ln(),
                        quality.edge - before.edge,
                        quality.shape - before.shape,
                        quality.length - before.length,
                        ((here * step + 1.0) / (radius + 1.0)).min(2.0),
                        ((most * step + 1.0) / (radius + 1.0)).ln().max(0.0),
                        (mass / own_mass - 1.0).max(0.0),
                        quality.weakness - before.weakness,
                        ((area + 1.0) / (3.15 * radius * radius + 1.0)).ln(),
                        ((parent.height + 1e-3) / (node.height + 1e-3)).ln().min(3.0),
                        if reach.is_finite() { 1.0 } else { 0.0 },
                        (unseen + 0.1).ln(),
                        (rest + 0.05).ln(),
                    ];
                    let score = signs.iter().zip(&CHANGE_WEIGHTS).map(|(s, (_, w))| s * w).sum();
                    seen.push(change.clone());
                    out.push(Change { patches: change, score, signs });
                }
            }
        }
        out
    }
}

/// Distance from the clicked pixel to the nearest pixel of the other state in the current silhouette, in pixels.
pub fn error_radius(current: &Selection, look: &Look, at: Vec2, kind: ClickKind) -> f32 {
    let wanted = kind == ClickKind::Positive;
    let (w, h) = (look.view.width as usize, look.view.height as usize);
    let wrong: Vec<bool> =
        look.solid.iter().map(|&id| (id != Frame::NO_ID && current.contains(id as usize)) != wanted).collect();
    let distance = inside_distance(&wrong, w, h);
    distance[(at.y as usize).min(h - 1) * w + (at.x as usize).min(w - 1)].min((w + h) as f32)
}

/// How good the border of a set of patches is, in logarithms.
#[derive(Clone, Copy, Debug)]
struct Quality {
    edge: f32,
    shape: f32,
    length: f32,
    weakness: f32,
}

impl Quality {
    fn of(prepared: &Prepared, set: &Selection) -> Self {
        let (mut count, mut edge, mut shape, mut weak) = (0.0f64, 0.0f64, 0.0f64, 0.0f64);
        for b in &prepared.graph.borders {
            if set.contains(b.a as usize) != set.contains(b.b as usize) {
                let n = f64::from(b.count);
                count += n;
                weak += n * f64::from((-TREES[1].strength(b) / 0.5).exp());
                edge += n * f64::from(TREES[1].strength(b));
                shape += n * f64::from(TREES[0].strength(b));
            }
        }
        let gaussians: f64 = set.iter().map(|p| f64::from(prepared.graph.patches[p].count)).sum();
        let share = count.max(1.0);
        Self {
            edge: ((edge / share + 0.01) as f32).ln(),
            shape: ((shape / share + 0.01) as f32).ln(),
            length: (((count + 1.0) / gaussians.max(1.0).sqrt()) as f32).ln(),
            weakness: ((weak + 1.0) as f32).ln(),
        }
    }
}
