//! Votes: what the masks say about every Gaussian, kept per view in integers.
//!
//! A mask m of a view gives every Gaussian `inside = sum_p g w m` and `total = sum_p g w`, with the blending weight w of
//! the frame and an optional weight g per pixel (0 = ignore). [`ViewVotes`] holds both for one mask, sparse;
//! [`VoteStore`] holds their sums over masks. All are integers in units of [`VOTE_UNIT`]: a mask can be added, replaced
//! or taken away exactly, and the sums are the same bits in whatever order that happened.

use std::collections::BTreeMap;
use std::sync::Arc;

use rayon::prelude::*;
use splat_core::{Mask2d, Selection, View};
use splat_raster::{Rasterizer, Scene, VOTE_UNIT, Votes};
use xxhash_rust::xxh3::Xxh3;

use crate::SegmentError;

/// A Gaussian counts as seen from this total on: 0.05 px of blending weight, in units of [`VOTE_UNIT`].
///
/// Below it a Gaussian only shimmers through what is in front of it, and its votes are rounding.
pub const SEEN_TOTAL: u64 = 3_277;

/// Names a mask by content: the view it belongs to, its pixels and its pixel weights.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MaskKey {
    /// Hash of the view.
    pub view: u128,
    /// Hash of the mask and of its pixel weights.
    pub mask: u128,
}

impl MaskKey {
    /// Key of a mask as seen in a view.
    pub fn new(view: &View, mask: &Mask2d, weight: Option<&Mask2d>) -> Self {
        let mut h = Xxh3::new();
        for m in [Some(mask), weight].into_iter().flatten() {
            h.update(&m.width().to_le_bytes());
            h.update(&m.height().to_le_bytes());
            h.update(m.values());
        }
        Self { view: view_hash(view), mask: h.digest128() }
    }
}

/// Hash of everything that decides what a view sees: equal views have equal hashes on every machine.
pub fn view_hash(view: &View) -> u128 {
    let mut h = Xxh3::new();
    h.update(&view.width.to_le_bytes());
    h.update(&view.height.to_le_bytes());
    h.update(&[view.projection as u8]);
    let i = &view.intrinsics;
    let pose = &view.pose;
    for f in [i.fx, i.fy, i.cx, i.cy, view.near]
        .into_iter()
        .chain(pose.world_from_view.to_cols_array())
        .chain(pose.position.to_array())
    {
        h.update(&f.to_bits().to_le_bytes());
    }
    h.digest128()
}

/// A column of counts in the smallest integer that holds all of them; equal columns have equal representations.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Counts {
    Narrow(Vec<u32>),
    Wide(Vec<u64>),
}

impl Counts {
    fn new(values: impl Iterator<Item = u64> + Clone) -> Self {
        if values.clone().all(|v| u32::try_from(v).is_ok()) {
            Self::Narrow(values.map(|v| v as u32).collect())
        } else {
            Self::Wide(values.collect())
        }
    }

    fn get(&self, k: usize) -> u64 {
        match self {
            Self::Narrow(v) => u64::from(v[k]),
            Self::Wide(v) => v[k],
        }
    }
}

/// Votes of one mask in one view, for the Gaussians the view gives any weight to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ViewVotes {
    ids: Vec<u32>,
    inside: Counts,
    total: Counts,
}

impl ViewVotes {
    /// Draws the view and lets its mask vote. One frame without colour.
    ///
    /// `weight`: how much each pixel counts, 0..=255; `None` counts all fully.
    ///
    /// # Errors
    /// [`SegmentError::Raster`] if the view is unusable or a mask has another size.
    pub fn draw(
        raster: &mut dyn Rasterizer,
        scene: &Scene,
        view: &View,
        mask: &Mask2d,
        weight: Option<&Mask2d>,
    ) -> Result<Self, SegmentError> {
        let Some(weight) = weight else {
            let votes = raster.votes(scene, view, &[mask])?;
            return Ok(Self::from_dense(&votes.inside[0], &votes.total));
        };
        // The trait votes for masks only. Weights are a mask as well, and so is their product with the mask.
        let product = product(mask, weight)?;
        let votes = raster.votes(scene, view, &[&product, weight])?;
        Ok(Self::from_dense(&votes.inside[0], &votes.inside[1]))
    }

    /// Keeps the Gaussians with any total. Both slices have one entry per Gaussian.
    pub fn from_dense(inside: &[u64], total: &[u64]) -> Self {
        let ids: Vec<u32> = (0..total.len()).filter(|&i| total[i] > 0).map(|i| i as u32).collect();
        Self {
            inside: Counts::new(ids.iter().map(|&i| inside[i as usize].min(total[i as usize]))),
            total: Counts::new(ids.iter().map(|&i| total[i as usize])),
            ids,
        }
    }

    /// Gaussians with any total in this view, rising.
    pub fn ids(&self) -> &[u32] {
        &self.ids
    }

    /// Number of Gaussians with any total.
    pub fn len(&self) -> usize {
        self.ids.len()
    }

    /// Whether no Gaussian has any total.
    pub fn is_empty(&self) -> bool {
        self.ids.is_empty()
    }

    /// (id, inside, total) by rising id, in units of [`VOTE_UNIT`].
    pub fn iter(&self) -> impl Iterator<Item = (u32, u64, u64)> + '_ {
        self.ids.iter().enumerate().map(|(k, &i)| (i, self.inside.get(k), self.total.get(k)))
    }

    /// Inside and total of one Gaussian, (0, 0) if this view does not see it.
    pub fn of(&self, id: u32) -> (u64, u64) {
        self.ids.binary_search(&id).map_or((0, 0), |k| (self.inside.get(k), self.total.get(k)))
    }
}

/// `a * b / 255` per pixel, rounded.
pub(crate) fn product(a: &Mask2d, b: &Mask2d) -> Result<Mask2d, SegmentError> {
    if (a.width(), a.height()) != (b.width(), b.height()) {
        let (left, right) = ((a.width(), a.height()), (b.width(), b.height()));
        return Err(splat_core::MaskError::SizeMismatch { left, right }.into());
    }
    let values = a.values().iter().zip(b.values()).map(|(&x, &y)| ((u32::from(x) * u32::from(y) + 127) / 255) as u8);
    Ok(Mask2d::new(a.width(), a.height(), values.collect())?)
}

/// Sums of votes per Gaussian. Cloning copies the sums; the votes of the masks are shared.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct VoteSums {
    inside: Vec<u64>,
    total: Vec<u64>,
}

impl VoteSums {
    /// No votes for `count` Gaussians.
    pub fn new(count: usize) -> Self {
        Self { inside: vec![0; count], total: vec![0; count] }
    }

    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.total.len()
    }

    /// Whether there are no Gaussians.
    pub fn is_empty(&self) -> bool {
        self.total.is_empty()
    }

    /// Adds the votes of a mask, `times` over.
    pub fn add(&mut self, votes: &ViewVotes, times: u32) {
        for (i, inside, total) in votes.iter() {
            self.inside[i as usize] += inside * u64::from(times);
            self.total[i as usize] += total * u64::from(times);
        }
    }

    /// Takes away what [`VoteSums::add`] added.
    ///
    /// # Panics
    /// If these votes were never added and a sum would fall under zero (in builds with overflow checks).
    pub fn take(&mut self, votes: &ViewVotes, times: u32) {
        for (i, inside, total) in votes.iter() {
            self.inside[i as usize] -= inside * u64::from(times);
            self.total[i as usize] -= total * u64::from(times);
        }
    }

    /// Sum of inside votes per Gaussian, in units of [`VOTE_UNIT`].
    pub fn inside(&self) -> &[u64] {
        &self.inside
    }

    /// Sum of weights per Gaussian, in units of [`VOTE_UNIT`].
    pub fn total(&self) -> &[u64] {
        &self.total
    }

    /// Whether any view gave Gaussian `i` enough weight to say something about it ([`SEEN_TOTAL`]).
    pub fn seen(&self, i: usize) -> bool {
        self.total[i] >= SEEN_TOTAL
    }

    /// Share of inside votes, 0..=1; `None` for a Gaussian that is not seen, which is *unknown* and not *out*.
    pub fn score(&self, i: usize) -> Option<f32> {
        self.seen(i).then(|| (self.inside[i] as f64 / self.total[i] as f64) as f32)
    }

    /// Seen Gaussians whose share of inside votes is above `theta`, 0..=1. Decided in integers: `theta` is taken in
    /// steps of 2^-16.
    pub fn above(&self, theta: f32) -> Selection {
        let theta = (f64::from(theta).clamp(0.0, 1.0) / VOTE_UNIT).round() as u128;
        let bits: Vec<bool> = (0..self.len())
            .into_par_iter()
            .map(|i| self.seen(i) && u128::from(self.inside[i]) << 16 > theta * u128::from(self.total[i]))
            .collect();
        Selection::from_fn(self.len(), |i| bits[i])
    }

    /// Gaussians that some view sees.
    pub fn seen_set(&self) -> Selection {
        Selection::from_fn(self.len(), |i| self.seen(i))
    }
}

#[derive(Clone, Debug, PartialEq, Eq)]
struct Stored {
    votes: Arc<ViewVotes>,
    times: u32,
}

/// Votes of any number of masks and their sums. Every mask can be added, replaced and removed, exactly.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct VoteStore {
    masks: BTreeMap<MaskKey, Stored>,
    sums: VoteSums,
}

impl VoteStore {
    /// No masks yet, for a scene of `count` Gaussians.
    pub fn new(count: usize) -> Self {
        Self { masks: BTreeMap::new(), sums: VoteSums::new(count) }
    }

    /// Adds a mask that counts `times` over. Added again under the same key, it counts that many times more.
    pub fn add(&mut self, key: MaskKey, votes: Arc<ViewVotes>, times: u32) {
        self.sums.add(&votes, times);
        self.masks.entry(key).and_modify(|s| s.times += times).or_insert(Stored { votes, times });
    }

    /// Removes a mask with all the times it was added; gives its votes back, `None` if it was not there.
    pub fn remove(&mut self, key: &MaskKey) -> Option<Arc<ViewVotes>> {
        let stored = self.masks.remove(key)?;
        self.sums.take(&stored.votes, stored.times);
        Some(stored.votes)
    }

    /// Takes away `times` of the times a mask was added; at none left it is gone. Nothing happens if it was not there.
    pub fn take(&mut self, key: &MaskKey, times: u32) {
        let Some(stored) = self.masks.get_mut(key) else { return };
        let times = times.min(stored.times);
        self.sums.take(&stored.votes, times);
        stored.times -= times;
        if stored.times == 0 {
            self.masks.remove(key);
        }
    }

    /// Removes the mask `old`, if there, and adds another: what repainting does.
    pub fn replace(&mut self, old: &MaskKey, key: MaskKey, votes: Arc<ViewVotes>, times: u32) {
        self.remove(old);
        self.add(key, votes, times);
    }

    /// Votes of a mask, if it is here.
    pub fn get(&self, key: &MaskKey) -> Option<&Arc<ViewVotes>> {
        self.masks.get(key).map(|s| &s.votes)
    }

    /// All masks by rising key: key, votes and how often they count.
    pub fn iter(&self) -> impl Iterator<Item = (&MaskKey, &Arc<ViewVotes>, u32)> + '_ {
        self.masks.iter().map(|(k, s)| (k, &s.votes, s.times))
    }

    /// Number of masks.
    pub fn len(&self) -> usize {
        self.masks.len()
    }

    /// Whether there is no mask.
    pub fn is_empty(&self) -> bool {
        self.masks.is_empty()
    }

    /// Sums over all masks.
    pub fn sums(&self) -> &VoteSums {
        &self.sums
    }
}

/// Votes of label maps: every pixel of a view names one of several objects.
///
/// Label 0 is the background. All labels are voted for in one pass per view.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LabelVotes {
    inside: Vec<Vec<u64>>,
    total: Vec<u64>,
}

/// Stands for "this pixel says nothing" in a label map.
pub const IGNORED_LABEL: u16 = u16::MAX;

/// Result of [`LabelVotes::assign`].
#[derive(Clone, Debug, PartialEq)]
pub struct Labels {
    /// Label per Gaussian; 0 for the background and for what no view saw.
    pub label: Vec<u16>,
    /// `(best - second) / total` per Gaussian, 0..=1; 0 where unseen.
    pub confidence: Vec<f32>,
}

impl LabelVotes {
    /// No votes for `count` Gaussians and the labels 0 to `labels - 1`.
    pub fn new(count: usize, labels: u16) -> Self {
        Self { inside: vec![vec![0; count]; usize::from(labels)], total: vec![0; count] }
    }

    /// Lets one view's label map vote: one label per pixel, row-major; labels beyond the known ones and
    /// [`IGNORED_LABEL`] say nothing.
    ///
    /// # Errors
    /// [`SegmentError::Length`] if the map does not have the view's size, [`SegmentError::Raster`] if the view is unusable.
    pub fn add(
        &mut self,
        raster: &mut dyn Rasterizer,
        scene: &Scene,
        view: &View,
        map: &[u16],
    ) -> Result<(), SegmentError> {
        let votes = self.draw(raster, scene, view, map)?;
        for (sum, votes) in self.inside.iter_mut().zip(&votes.inside) {
            sum.iter_mut().zip(votes).for_each(|(s, v)| *s += v);
            self.total.iter_mut().zip(votes).for_each(|(s, v)| *s += v);
        }
        Ok(())
    }

    /// Takes away what [`LabelVotes::add`] added with the same view and map.
    ///
    /// # Errors
    /// As [`LabelVotes::add`].
    pub fn take(
        &mut self,
        raster: &mut dyn Rasterizer,
        scene: &Scene,
        view: &View,
        map: &[u16],
    ) -> Result<(), SegmentError> {
        let votes = self.draw(raster, scene, view, map)?;
        for (sum, votes) in self.inside.iter_mut().zip(&votes.inside) {
            sum.iter_mut().zip(votes).for_each(|(s, v)| *s -= v);
            self.total.iter_mut().zip(votes).for_each(|(s, v)| *s -= v);
        }
        Ok(())
    }

    fn draw(
        &self,
        raster: &mut dyn Rasterizer,
        scene: &Scene,
        view: &View,
        map: &[u16],
    ) -> Result<Votes, SegmentError> {
        let expected = view.width as usize * view.height as usize;
        if map.len() != expected {
            return Err(SegmentError::Length { what: "label map", found: map.len(), expected });
        }
        let masks: Vec<Mask2d> = (0..self.inside.len())
            .map(|l| {
                let values = map.iter().map(|&m| if usize::from(m) == l { 255 } else { 0 }).collect();
                Mask2d::new(view.width, view.height, values)
            })
            .collect::<Result<_, _>>()?;
        Ok(raster.votes(scene, view, &masks.iter().collect::<Vec<_>>())?)
    }

    /// Sum of votes for a label per Gaussian.
    pub fn inside(&self, label: u16) -> &[u64] {
        &self.inside[usize::from(label)]
    }

    /// Every Gaussian gets the label with the most votes (the lower of equals).
    ///
    /// `locked`: current labels, and the labels of which no Gaussian may be taken away or added; `None` locks nothing.
    ///
    /// # Errors
    /// [`SegmentError::Length`] if the current labels are not one per Gaussian.
    pub fn assign(&self, locked: Option<(&[u16], &[u16])>) -> Result<Labels, SegmentError> {
        let n = self.total.len();
        if let Some((current, _)) = locked.filter(|(current, _)| current.len() != n) {
            return Err(SegmentError::Length { what: "current labels", found: current.len(), expected: n });
        }
        let is_locked = |label: u16| locked.is_some_and(|(_, names)| names.contains(&label));
        let (mut label, mut confidence) = (vec![0; n], vec![0.0; n]);
        for i in 0..n {
            if let Some((current, _)) = locked.filter(|(current, _)| is_locked(current[i])) {
                (label[i], confidence[i]) = (current[i], 1.0);
                continue;
            }
            if self.total[i] < SEEN_TOTAL {
                continue;
            }
            let (mut best, mut most, mut second) = (0, 0, 0);
            for (l, votes) in self.inside.iter().enumerate() {
                let v = votes[i];
                if v > most && !is_locked(l as u16) {
                    (best, second, most) = (l as u16, most, v);
                } else if v > second {
                    second = v;
                }
            }
            label[i] = best;
            confidence[i] = (most.saturating_sub(second) as f64 / self.total[i] as f64) as f32;
        }
        Ok(Labels { label, confidence })
    }
}
