//! [`Segmentation`]: one object being segmented, from its annotations to its Gaussians.
//!
//! Holds the views, the user's annotations, the tracked masks and the votes of every mask. Adding, repainting or removing a mask
//! redoes only what depends on it: the votes of that mask; and, where pre-segmentation comes out differently, those of all
//! masks, because another scene is drawn then. Votes are integers, so the result equals a full run over the same masks bit for bit
//! ([`Segmentation::without_caches`]).
//!
//! A `Segmentation` is a value: masks and votes are shared between clones, so keep a clone to undo.

use std::collections::BTreeMap;
use std::sync::Arc;

use splat_core::{Mask2d, Selection, View};
use splat_raster::{Rasterizer, Scene};

use crate::aggregations::{Aggregated, Aggregation, MaskedView, VoteShare, VotedView};
use crate::presegment::{GuardReport, GuardSettings, Presegment, PresegmentSettings, Verdict, guard, presegment};
use crate::project::check_size;
use crate::trackers::{Reference, TrackJob, TrackedFrame, Tracker};
use crate::views::{Plan, PlanKind, ViewSets};
use crate::votes::{MaskKey, ViewVotes, VoteStore, VoteSums, view_hash};
use crate::{Run, SegmentError};

/// Whether something may stand in front of the object in an annotated view.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Occlusion {
    /// The mask is the whole silhouette as far as the picture shows it: outside it the object is not.
    #[default]
    Unoccluded,
    /// Outside the mask the object may go on behind something.
    Occluded,
}

/// A mask by the user.
#[derive(Clone, Debug, PartialEq)]
pub struct Annotation {
    /// What it was made for.
    pub view: View,
    /// Soft mask of the view's size.
    pub mask: Arc<Mask2d>,
    /// Whether it may rule out what is outside it.
    pub occlusion: Occlusion,
}

/// Names an annotation for as long as the segmentation lives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct AnnotationId(pub u64);

/// Whether annotations marked unoccluded rule out what is outside them before anything is tracked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Presegmentation {
    /// Everything takes part.
    Off,
    /// Only what may be inside takes part; given up when the guard objects.
    On(PresegmentSettings, GuardSettings),
}

/// Settings of a [`Segmentation`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SegmentSettings {
    /// Threshold on the share of inside votes, 0..=1; 0.5 by default.
    pub theta: f32,
    /// How many times an annotation's votes count against a tracked mask's 1; 1 by default, as in the paper.
    pub annotation_times: u32,
    /// On by default.
    pub presegmentation: Presegmentation,
    /// How the dense views lie to one another; a ring by default.
    pub plan: PlanKind,
}

impl Default for SegmentSettings {
    fn default() -> Self {
        Self {
            theta: 0.5,
            annotation_times: 1,
            presegmentation: Presegmentation::On(PresegmentSettings::default(), GuardSettings::default()),
            plan: PlanKind::Ring,
        }
    }
}

/// Who a mask belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Slot {
    Annotation(u64),
    Tracked(usize),
}

/// What was drawn for votes, and their sums.
#[derive(Clone, Debug)]
struct Voted {
    /// Gaussians that took part; `None` for all.
    shown: Option<Arc<Selection>>,
    slots: BTreeMap<Slot, (MaskKey, u32)>,
    store: VoteStore,
}

/// One object being segmented.
#[derive(Clone, Debug)]
pub struct Segmentation {
    scene: Arc<Scene>,
    settings: SegmentSettings,
    annotations: BTreeMap<u64, Annotation>,
    next_annotation: u64,
    views: Arc<Vec<View>>,
    tracked: Vec<Option<Arc<TrackedFrame>>>,
    /// Set when the guard gave pre-segmentation up for the present annotations.
    given_up: Option<GuardReport>,
    guarded: Option<GuardReport>,
    presegment: Option<Arc<Presegment>>,
    voted: Option<Arc<Voted>>,
    view_sets: Option<Arc<ViewSets>>,
}

impl Segmentation {
    /// Nothing annotated yet. `scene` is what is drawn and whose ids are given back.
    pub fn new(scene: Arc<Scene>, settings: SegmentSettings) -> Self {
        Self {
            scene,
            settings,
            annotations: BTreeMap::new(),
            next_annotation: 0,
            views: Arc::default(),
            tracked: Vec::new(),
            given_up: None,
            guarded: None,
            presegment: None,
            voted: None,
            view_sets: None,
        }
    }

    /// What is segmented.
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// The settings.
    pub fn settings(&self) -> &SegmentSettings {
        &self.settings
    }

    /// Changes the threshold; costs nothing.
    pub fn set_theta(&mut self, theta: f32) {
        self.settings.theta = theta;
    }

    /// Changes the pre-segmentation; a verdict of the guard is forgotten.
    pub fn set_presegmentation(&mut self, presegmentation: Presegmentation) {
        self.settings.presegmentation = presegmentation;
        self.annotations_changed();
    }

    /// Adds a mask by the user.
    ///
    /// # Errors
    /// [`SegmentError::Raster`] if the view is unusable or the mask has another size.
    pub fn annotate(&mut self, view: View, mask: Mask2d, occlusion: Occlusion) -> Result<AnnotationId, SegmentError> {
        check_size(&view, &mask)?;
        let id = self.next_annotation;
        self.next_annotation += 1;
        self.annotations.insert(id, Annotation { view, mask: Arc::new(mask), occlusion });
        self.annotations_changed();
        Ok(AnnotationId(id))
    }

    /// Replaces the mask of an annotation.
    ///
    /// # Errors
    /// [`SegmentError::Missing`] if there is no such annotation, [`SegmentError::Raster`] if the mask has another size.
    pub fn repaint(&mut self, id: AnnotationId, mask: Mask2d) -> Result<(), SegmentError> {
        let annotation = self.annotation_mut(id)?;
        check_size(&annotation.view, &mask)?;
        annotation.mask = Arc::new(mask);
        self.annotations_changed();
        Ok(())
    }

    /// Changes whether an annotation may rule out what is outside it.
    ///
    /// # Errors
    /// [`SegmentError::Missing`] if there is no such annotation.
    pub fn set_occlusion(&mut self, id: AnnotationId, occlusion: Occlusion) -> Result<(), SegmentError> {
        self.annotation_mut(id)?.occlusion = occlusion;
        self.annotations_changed();
        Ok(())
    }

    /// Removes an annotation and gives it back.
    ///
    /// # Errors
    /// [`SegmentError::Missing`] if there is no such annotation.
    pub fn remove(&mut self, id: AnnotationId) -> Result<Annotation, SegmentError> {
        let missing = SegmentError::Missing { what: "annotation", found: id.0, count: self.annotations.len() };
        let annotation = self.annotations.remove(&id.0).ok_or(missing)?;
        self.annotations_changed();
        Ok(annotation)
    }

    /// All annotations in the order they were made.
    pub fn annotations(&self) -> impl Iterator<Item = (AnnotationId, &Annotation)> + '_ {
        self.annotations.iter().map(|(&id, a)| (AnnotationId(id), a))
    }

    fn annotation_mut(&mut self, id: AnnotationId) -> Result<&mut Annotation, SegmentError> {
        let count = self.annotations.len();
        self.annotations.get_mut(&id.0).ok_or(SegmentError::Missing { what: "annotation", found: id.0, count })
    }

    fn annotations_changed(&mut self) {
        self.given_up = None;
        self.guarded = None;
        self.presegment = None;
    }

    /// Sets the dense views, in order; tracked masks of other views are dropped.
    pub fn set_views(&mut self, views: Vec<View>) {
        let old: BTreeMap<u128, Arc<TrackedFrame>> =
            (self.views.iter().zip(&self.tracked)).filter_map(|(v, t)| t.clone().map(|t| (view_hash(v), t))).collect();
        self.tracked = views.iter().map(|v| old.get(&view_hash(v)).cloned()).collect();
        self.views = Arc::new(views);
        self.view_sets = None;
    }

    /// The dense views.
    pub fn views(&self) -> &[View] {
        &self.views
    }

    /// Tracked masks, one per dense view, `None` where there is none yet.
    pub fn tracked(&self) -> &[Option<Arc<TrackedFrame>>] {
        &self.tracked
    }

    /// Sets or removes the tracked mask of a dense view.
    ///
    /// # Errors
    /// [`SegmentError::Missing`] if there is no such view, [`SegmentError::Raster`] if the mask has another size.
    pub fn set_tracked(&mut self, view: usize, frame: Option<TrackedFrame>) -> Result<(), SegmentError> {
        let count = self.views.len();
        let v = self.views.get(view).ok_or(SegmentError::Missing { what: "view", found: view as u64, count })?;
        if let Some(f) = &frame {
            check_size(v, &f.mask)?;
            f.weight.iter().try_for_each(|w| check_size(v, w))?;
        }
        self.tracked[view] = frame.map(Arc::new);
        Ok(())
    }

    /// Tracks the annotations through all dense views. With pre-segmentation, on the segment alone; if the guard objects, once
    /// more on everything.
    ///
    /// # Errors
    /// [`SegmentError::NothingToDo`] without annotations, [`SegmentError::Cancelled`], [`SegmentError::Raster`]; nothing has
    /// changed then.
    pub fn track(
        &mut self,
        tracker: &dyn Tracker,
        raster: &mut dyn Rasterizer,
        run: &Run,
    ) -> Result<Option<GuardReport>, SegmentError> {
        if self.annotations.is_empty() {
            return Err(SegmentError::NothingToDo { what: "annotation" });
        }
        let mut next = self.clone();
        next.track_once(tracker, raster, run)?;
        if let Some(report) = next.guard(raster, run)? {
            if report.verdict != Verdict::Keep {
                next.given_up = Some(report);
                next.presegment = None;
                next.track_once(tracker, raster, run)?;
            }
            next.guarded = Some(report);
        }
        *self = next;
        Ok(self.guarded)
    }

    fn track_once(
        &mut self,
        tracker: &dyn Tracker,
        raster: &mut dyn Rasterizer,
        run: &Run,
    ) -> Result<(), SegmentError> {
        const SIDE_PX: u32 = 320;
        self.presegment()?;
        let shown = self.shown_scene();
        if self.view_sets.is_none() {
            self.view_sets = Some(Arc::new(ViewSets::draw(raster, &self.scene, self.views.iter(), SIDE_PX, run)?));
        }
        let Some(sets) = self.view_sets.clone() else { return Ok(()) };
        let annotated = ViewSets::draw(
            raster,
            &self.scene,
            self.annotations.values().map(|a| &a.view).collect::<Vec<_>>().into_iter(),
            SIDE_PX,
            run,
        )?;
        let plan = Plan::new(self.settings.plan, &sets, &annotated.sets);
        let ordered: Vec<View> = plan.order.iter().map(|&k| self.views[k]).collect();
        let references: Vec<Reference<'_>> = (self.annotations.values().zip(&plan.before))
            .map(|(a, &before)| Reference { view: &a.view, mask: &a.mask, before })
            .collect();
        let job = TrackJob { scene: &shown, views: &ordered, references: &references };
        let frames = tracker.track(&job, raster, run)?;
        if frames.len() != ordered.len() {
            return Err(SegmentError::Length { what: "tracked masks", found: frames.len(), expected: ordered.len() });
        }
        for (&k, frame) in plan.order.iter().zip(frames) {
            self.set_tracked(k, Some(frame))?;
        }
        Ok(())
    }

    /// Compares the tracked masks with what pre-segmentation excluded; `None` if nothing was excluded.
    fn guard(&mut self, raster: &mut dyn Rasterizer, run: &Run) -> Result<Option<GuardReport>, SegmentError> {
        let Presegmentation::On(_, settings) = self.settings.presegmentation else { return Ok(None) };
        let Some(p) = self.presegment()? else { return Ok(None) };
        if p.kept.count() == p.kept.len() {
            return Ok(None);
        }
        let masks = self.masked();
        let masks: Vec<MaskedView<'_>> = masks
            .iter()
            .filter(|(slot, _)| match slot {
                Slot::Annotation(id) => self.annotations[id].occlusion == Occlusion::Occluded,
                Slot::Tracked(_) => true,
            })
            .map(|(_, m)| *m)
            .collect();
        guard(raster, &self.scene, &p, &masks, self.settings.theta, &settings, run).map(Some)
    }

    /// What the unoccluded annotations rule out; `None` if pre-segmentation is off, was given up or has nothing to go by.
    ///
    /// # Errors
    /// [`SegmentError::Raster`] if a view is unusable.
    pub fn presegment(&mut self) -> Result<Option<Arc<Presegment>>, SegmentError> {
        let Presegmentation::On(settings, _) = self.settings.presegmentation else { return Ok(None) };
        if self.given_up.is_some() {
            return Ok(None);
        }
        if self.presegment.is_none() {
            let references: Vec<(&View, &Mask2d)> = (self.annotations.values())
                .filter(|a| a.occlusion == Occlusion::Unoccluded)
                .map(|a| (&a.view, &*a.mask))
                .collect();
            if references.is_empty() {
                return Ok(None);
            }
            self.presegment = Some(Arc::new(presegment(&self.scene, &references, &settings)?));
        }
        Ok(self.presegment.clone())
    }

    /// The scene that is tracked and voted in: what pre-segmentation keeps, as far as it has been worked out.
    fn shown_scene(&self) -> Arc<Scene> {
        match &self.presegment {
            Some(p) => Arc::new(crate::views::alone(&self.scene, &p.kept)),
            None => self.scene.clone(),
        }
    }

    /// All masks that count, with whom they belong to. A dense view that is annotated as well does not count its tracked mask.
    fn masked(&self) -> Vec<(Slot, MaskedView<'_>)> {
        let mut out: Vec<(Slot, MaskedView<'_>)> = Vec::new();
        let mut annotated = Vec::new();
        for (&id, a) in &self.annotations {
            annotated.push(view_hash(&a.view));
            let times = self.settings.annotation_times;
            out.push((Slot::Annotation(id), MaskedView { view: &a.view, mask: &a.mask, weight: None, times }));
        }
        for (k, (view, t)) in self.views.iter().zip(&self.tracked).enumerate() {
            if let Some(t) = t.as_ref().filter(|_| !annotated.contains(&view_hash(view))) {
                let weight = t.weight.as_ref();
                out.push((Slot::Tracked(k), MaskedView { view, mask: &t.mask, weight, times: 1 }));
            }
        }
        out
    }

    /// All masks that count, annotations first.
    pub fn masks(&self) -> Vec<MaskedView<'_>> {
        self.masked().into_iter().map(|(_, m)| m).collect()
    }

    /// Draws the votes that are missing. What has not changed is not drawn again.
    ///
    /// # Errors
    /// [`SegmentError::Cancelled`], [`SegmentError::Raster`]; nothing has changed then.
    pub fn update(&mut self, raster: &mut dyn Rasterizer, run: &Run) -> Result<&VoteSums, SegmentError> {
        let presegment = self.presegment()?;
        let shown = presegment.map(|p| Arc::new(p.kept.clone()));
        let scene = self.shown_scene();
        let wanted: BTreeMap<Slot, (MaskKey, MaskedView<'_>)> =
            self.masked().into_iter().map(|(slot, m)| (slot, (MaskKey::new(m.view, m.mask, m.weight), m))).collect();
        let kept = self.voted.as_ref().filter(|v| v.shown == shown);

        let is_there = |slot: &Slot, key: &MaskKey, m: &MaskedView<'_>| {
            kept.is_some_and(|v| v.slots.get(slot) == Some(&(*key, m.times)))
        };
        let missing: Vec<(Slot, MaskKey, MaskedView<'_>)> =
            wanted.iter().filter(|(s, (k, m))| !is_there(s, k, m)).map(|(s, (k, m))| (*s, *k, *m)).collect();
        // All is drawn before anything changes: an error or a wish to stop leaves things as they were.
        let mut drawn: Vec<(Slot, MaskKey, u32, Arc<ViewVotes>)> = Vec::with_capacity(missing.len());
        for (done, (slot, key, m)) in missing.iter().enumerate() {
            run.step("votes", done, missing.len())?;
            let known = kept.and_then(|v| v.store.get(key)).cloned();
            let votes = match known.or_else(|| drawn.iter().find(|d| d.1 == *key).map(|d| d.3.clone())) {
                Some(votes) => votes,
                None => Arc::new(m.votes(raster, &scene)?),
            };
            drawn.push((*slot, *key, m.times, votes));
        }
        let gone: Vec<Slot> = kept.map_or_else(Vec::new, |v| {
            v.slots.keys().filter(|s| wanted.get(s).is_none_or(|(k, m)| !is_there(s, k, m))).copied().collect()
        });

        let count = self.scene.len();
        let fresh = kept.is_none();
        let voted = self.voted.get_or_insert_with(|| {
            Arc::new(Voted { shown: None, slots: BTreeMap::new(), store: VoteStore::new(count) })
        });
        if fresh {
            *voted = Arc::new(Voted { shown, slots: BTreeMap::new(), store: VoteStore::new(count) });
        }
        if !drawn.is_empty() || !gone.is_empty() {
            let v = Arc::make_mut(voted);
            for slot in gone {
                if let Some((key, times)) = v.slots.remove(&slot) {
                    v.store.take(&key, times);
                }
            }
            for (slot, key, times, votes) in drawn {
                v.slots.insert(slot, (key, times));
                v.store.add(key, votes, times);
            }
        }
        Ok(voted.store.sums())
    }

    /// The object: seen Gaussians whose share of inside votes is above theta.
    ///
    /// # Errors
    /// As [`Segmentation::update`].
    pub fn result(&mut self, raster: &mut dyn Rasterizer, run: &Run) -> Result<Aggregated, SegmentError> {
        let theta = self.settings.theta;
        Ok(VoteShare { theta }.decide_sums(self.update(raster, run)?))
    }

    /// The object by another rule; those that look at votes alone draw nothing that is drawn already.
    ///
    /// # Errors
    /// As [`Segmentation::update`], and the rule's own.
    pub fn result_by(
        &mut self,
        rule: &dyn Aggregation,
        raster: &mut dyn Rasterizer,
        run: &Run,
    ) -> Result<Aggregated, SegmentError> {
        self.update(raster, run)?;
        if let Some(v) = &self.voted {
            let views: Vec<VotedView<'_>> = (self.masked().iter())
                .filter_map(|(slot, m)| {
                    let (key, times) = v.slots.get(slot)?;
                    let pixels = u64::from(m.view.width) * u64::from(m.view.height);
                    Some(VotedView { votes: v.store.get(key)?, times: *times, pixels })
                })
                .collect();
            if let Some(answer) = rule.decide(self.scene.len(), &views) {
                return Ok(answer);
            }
        }
        rule.run(&self.shown_scene(), &self.masks(), raster, run)
    }

    /// Votes of every mask that counts, annotations first; empty before [`Segmentation::update`].
    pub fn votes(&self) -> Vec<(MaskedView<'_>, &ViewVotes)> {
        let Some(v) = &self.voted else { return Vec::new() };
        (self.masked().into_iter()).filter_map(|(slot, m)| Some((m, &**v.store.get(&v.slots.get(&slot)?.0)?))).collect()
    }

    /// What the guard found when the present annotations were tracked; `None` if it had nothing to look at.
    pub fn guard_report(&self) -> Option<&GuardReport> {
        self.guarded.as_ref()
    }

    /// The same annotations and tracked masks, with everything that was worked out from them forgotten: what a full run
    /// starts from.
    pub fn without_caches(&self) -> Self {
        Self { presegment: None, voted: None, view_sets: None, ..self.clone() }
    }
}
