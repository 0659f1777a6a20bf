//! What the render world needs of the main one: a few `Arc`s for each entity, and what each camera sees of them.

use std::any::TypeId;
use std::sync::{Arc, Weak};

use bevy::asset::Assets;
use bevy::camera::primitives::Aabb;
use bevy::camera::visibility::{NoAutoAabb, VisibleEntities};
use bevy::camera::{Camera, Camera3d};
use bevy::ecs::change_detection::Tick;
use bevy::ecs::entity::EntityHashMap;
use bevy::ecs::prelude::*;
use bevy::log::warn_once;
use bevy::math::{Vec3, Vec3A};
use bevy::render::Extract;
use bevy::transform::components::GlobalTransform;
use splat_core::deform::Deformation;
use splat_core::{Cloud, Selection, Similarity};

use super::selected::same_arc;
use super::settings::{SplatBackend, SplatCamera};
use crate::components::SplatDeformation;
use crate::{SplatCloud, SplatFlags, SplatSelection, SplatSubset, SplatTint, Splats};

/// The splats of the main world, as of this frame.
#[derive(Resource, Default)]
pub(super) struct ExtractedSplats {
    /// By main entity; captures that are still loading are absent.
    pub(super) entities: EntityHashMap<ExtractedEntity>,
    /// By the camera's main entity.
    pub(super) cameras: EntityHashMap<ExtractedCameraSplats>,
    /// The back end wished for.
    pub(super) backend: SplatBackend,
}

/// One `Splats` entity.
pub(super) struct ExtractedEntity {
    pub(super) cloud: Arc<Cloud>,
    pub(super) transform: Similarity,
    pub(super) hidden: Option<Arc<Selection>>,
    pub(super) subset: Option<Arc<[u32]>>,
    pub(super) tint: Option<Arc<[[u8; 4]]>>,
    pub(super) deformation: Option<Arc<Deformation>>,
    pub(super) selected: Option<Arc<Selection>>,
    kept: Kept,
}

impl ExtractedEntity {
    /// Gaussians, hidden ones included.
    pub(super) fn len(&self) -> usize {
        self.subset.as_ref().map_or(self.cloud.len(), |ids| ids.len())
    }
}

/// What is copied only when it changes, and when it did.
#[derive(Clone, Default)]
struct Kept {
    hidden: Option<(Tick, Option<Arc<Selection>>)>,
    selected: Option<(Tick, Option<Arc<Selection>>)>,
}

/// What one camera sees.
pub(super) struct ExtractedCameraSplats {
    /// Entities in view, in order of their ids.
    pub(super) visible: Vec<Entity>,
    pub(super) settings: SplatCamera,
}

type SplatComponents<'a> = (
    Entity,
    &'a Splats,
    &'a GlobalTransform,
    Ref<'a, SplatFlags>,
    Option<Ref<'a, SplatSelection>>,
    Option<&'a SplatSubset>,
    Option<&'a SplatTint>,
    Option<&'a SplatDeformation>,
);

type CameraComponents<'a> = (Entity, &'a Camera, &'a VisibleEntities, Option<&'a SplatCamera>);

/// Takes over `Arc`s, transforms and what cameras see; copies bits only where a component changed.
pub(super) fn extract_splats(
    mut extracted: ResMut<ExtractedSplats>,
    clouds: Extract<Res<Assets<SplatCloud>>>,
    splats: Extract<Query<SplatComponents>>,
    cameras: Extract<Query<CameraComponents, With<Camera3d>>>,
    backend: Extract<Res<SplatBackend>>,
) {
    let extracted = &mut *extracted;
    extracted.backend = **backend;
    let mut old = std::mem::take(&mut extracted.entities);
    for (entity, handle, transform, flags, selection, subset, tint, deformation) in &splats {
        let Some(asset) = clouds.get(&handle.0) else { continue };
        let cloud = &asset.cloud;
        let Some(transform) = similarity(transform) else { continue };
        let mut kept = old.remove(&entity).map(|e| e.kept).unwrap_or_default();
        let hidden = keep(&mut kept.hidden, flags.last_changed(), &flags.hidden);
        let selected = match selection {
            Some(selection) => keep(&mut kept.selected, selection.last_changed(), &selection.0),
            None => None,
        };
        let fits = |bits: &Arc<Selection>| bits.len() == cloud.len();
        let entry = ExtractedEntity {
            cloud: cloud.clone(),
            transform,
            // After a hot reload the old file's bits may be left: they mean nothing for the new one.
            hidden: hidden.filter(fits),
            subset: subset.map(|s| s.0.clone()).filter(|ids| ids.last().is_none_or(|&id| (id as usize) < cloud.len())),
            tint: tint.map(|t| t.0.clone()).filter(|tint| tint.len() == cloud.len()),
            deformation: deformation.map(|d| d.0.clone()),
            selected: selected.filter(fits),
            kept,
        };
        extracted.entities.insert(entity, entry);
    }
    extracted.cameras.clear();
    for (entity, camera, visible, settings) in &cameras {
        if camera.is_active {
            let visible = visible.get(TypeId::of::<Splats>()).to_vec();
            extracted
                .cameras
                .insert(entity, ExtractedCameraSplats { visible, settings: settings.cloned().unwrap_or_default() });
        }
    }
}

/// The same `Arc` as before unless the component changed; none where no bit is set.
fn keep(kept: &mut Option<(Tick, Option<Arc<Selection>>)>, changed: Tick, bits: &Selection) -> Option<Arc<Selection>> {
    match kept {
        Some((tick, bits)) if *tick == changed => bits.clone(),
        _ => {
            let bits = (bits.count() > 0).then(|| Arc::new(bits.clone()));
            *kept = Some((changed, bits.clone()));
            bits
        }
    }
}

/// The similarity that an entity's transform is, or the nearest to it; `None` where nothing can be seen of it.
pub(crate) fn similarity(transform: &GlobalTransform) -> Option<Similarity> {
    let affine = transform.affine();
    let determinant = affine.matrix3.determinant();
    if !affine.is_finite() || determinant.abs() < 1e-30 {
        return None;
    }
    if let Ok(exact) = Similarity::from_matrix(transform.to_matrix()) {
        return Some(exact);
    }
    if determinant < 0.0 {
        warn_once!("a Splats entity is mirrored by its Transform; Gaussians cannot be, so it is not drawn");
        return None;
    }
    warn_once!("a Splats entity is scaled unevenly or sheared by its Transform; it is drawn with an even scale");
    let (_, rotation, translation) = transform.to_scale_rotation_translation();
    Some(Similarity { rotation: rotation.normalize(), scale: determinant.cbrt(), translation })
}

/// The cloud that an entity's `Aabb` was made for.
#[derive(Component)]
pub(super) struct BoundsOf {
    cloud: Weak<Cloud>,
    subset: Option<Arc<[u32]>>,
    deformation: Option<Arc<Deformation>>,
    rest: Rest,
}

type BoundedSplats<'a> =
    (Entity, &'a Splats, Option<&'a SplatSubset>, Option<&'a SplatDeformation>, Option<&'a mut BoundsOf>);

/// Gives new, changed and reloaded captures their `Aabb`, so that cameras that look elsewhere do not draw them.
pub(super) fn calculate_bounds(
    mut commands: Commands,
    clouds: Res<Assets<SplatCloud>>,
    mut splats: Query<BoundedSplats, Without<NoAutoAabb>>,
) {
    for (entity, handle, subset, deformation, old) in &mut splats {
        let Some(asset) = clouds.get(&handle.0) else { continue };
        let subset = subset.map(|s| &s.0);
        let deformation = deformation.map(|d| d.0.clone());
        let same =
            |old: &BoundsOf| same_arc(&old.subset, &subset.cloned()) && old.cloud.as_ptr() == Arc::as_ptr(&asset.cloud);
        match old {
            Some(old) if same(&old) && same_arc(&old.deformation, &deformation) => {}
            // Only the pose is another: nothing is looked for in the cloud again.
            Some(mut old) if same(&old) => {
                commands.entity(entity).try_insert(old.rest.placed(deformation.as_deref()));
                old.deformation = deformation;
            }
            _ => {
                let rest = Rest::of(&asset.cloud, subset.map(|ids| &**ids));
                let aabb = rest.placed(deformation.as_deref());
                let (cloud, subset) = (Arc::downgrade(&asset.cloud), subset.cloned());
                commands.entity(entity).try_insert((aabb, BoundsOf { cloud, subset, deformation, rest }));
            }
        }
    }
}

/// Standard deviations at which the most opaque Gaussian falls under 1/255: `sqrt(2 ln 255)`.
const REACH: f32 = 3.33;

/// What the boxes of all poses are made of.
#[derive(Clone, Copy)]
struct Rest {
    /// The box around all drawable Gaussians, each with as much around it as can be seen; none where none is.
    seen: Option<(Vec3A, Vec3A)>,
    /// The box around their means.
    means: (Vec3A, Vec3A),
    /// How far the largest of them can be seen from its mean.
    reach: f32,
}

impl Rest {
    fn of(cloud: &Cloud, subset: Option<&[u32]>) -> Self {
        let none = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
        let ((mut low, mut high), mut means, mut largest) = (none, none, 0.0f32);
        let mut add = |i: usize| {
            if cloud.drawable(i) {
                // Beyond this a float's square overflows, and with it Bevy's own culling.
                let reach = (REACH * cloud.log_scales()[i].max_element().exp()).min(1e15);
                let mean = Vec3A::from(cloud.means()[i]).clamp(Vec3A::splat(-1e15), Vec3A::splat(1e15));
                low = low.min(mean - reach);
                high = high.max(mean + reach);
                means = (means.0.min(mean), means.1.max(mean));
                largest = largest.max(reach);
            }
        };
        match subset {
            Some(ids) => ids.iter().map(|&id| id as usize).filter(|&id| id < cloud.len()).for_each(add),
            None => (0..cloud.len()).for_each(&mut add),
        }
        Self { seen: low.cmple(high).all().then_some((low, high)), means, reach: largest }
    }

    /// The box in the pose of a deformation.
    fn placed(&self, deformation: Option<&Deformation>) -> Aabb {
        let Some((mut low, mut high)) = self.seen else { return Aabb::from_min_max(Vec3::ZERO, Vec3::ZERO) };
        if let Some(deformation) = deformation {
            // Bounds take three standard deviations.
            let (least, most) = deformation.bounds((self.means.0.into(), self.means.1.into()), self.reach / 3.0);
            let limit = Vec3::splat(1e15);
            (low, high) = (least.clamp(-limit, limit).into(), most.clamp(-limit, limit).into());
        }
        let (center, half) = (0.5 * (low + high), 0.5 * (high - low));
        // One Gaussian far away moves the centre so far out that rounding would lose all the others.
        Aabb { center, half_extents: half + 1e-5 * (center.abs() + half) }
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::Quat;
    use bevy::transform::components::Transform;
    use splat_core::CloudArrays;

    use super::*;

    #[test]
    fn transforms_that_are_no_similarity_give_the_nearest_or_nothing() {
        let of = |transform: Transform| similarity(&transform.into());
        let turned = Transform::from_xyz(1.0, 2.0, 3.0).with_rotation(Quat::from_rotation_x(0.4));
        let exact = of(turned.with_scale(Vec3::splat(2.0))).unwrap();
        assert!((exact.scale - 2.0).abs() < 1e-5 && exact.translation == turned.translation);
        let even = of(turned.with_scale(Vec3::new(1.0, 2.0, 4.0))).unwrap();
        assert!((even.scale - 2.0).abs() < 1e-5 && even.rotation.angle_between(turned.rotation) < 1e-3);
        assert_eq!(of(turned.with_scale(Vec3::new(-1.0, 1.0, 1.0))), None);
        assert_eq!(of(turned.with_scale(Vec3::ZERO)), None);
        assert_eq!(of(turned.with_translation(Vec3::NAN)), None);
    }

    #[test]
    fn the_box_holds_what_can_be_seen_and_nothing_that_cannot() {
        let cloud = |means: Vec<Vec3>| {
            let n = means.len();
            Cloud::new(CloudArrays {
                means,
                log_scales: vec![Vec3::ZERO; n],
                rotations: vec![Quat::IDENTITY; n],
                opacity_logits: vec![2.0; n],
                sh: vec![0.0; 3 * n],
                ..CloudArrays::default()
            })
            .unwrap()
        };
        let bounds = |cloud: &Cloud, subset: Option<&[u32]>| Rest::of(cloud, subset).placed(None);
        let three = cloud(vec![Vec3::ZERO, Vec3::X, Vec3::splat(f32::NAN), Vec3::new(0.0, 9.0, 0.0)]);
        let all = bounds(&three, None);
        let near = |a: Vec3A, b: Vec3A| a.distance(b) < 1e-3;
        assert!(near(all.min(), Vec3A::splat(-REACH)) && near(all.max(), Vec3A::new(1.0, 9.0, 0.0) + REACH));
        let some = bounds(&three, Some(&[0, 1]));
        assert!(near(some.max(), Vec3A::X + REACH));
        assert_eq!(bounds(&cloud(vec![]), None).half_extents, Vec3A::ZERO);
        let far = bounds(&cloud(vec![Vec3::splat(1e38), Vec3::ZERO]), None);
        assert!(far.half_extents.is_finite() && far.min().max_element() < -1e9, "{far:?}");
    }

    #[test]
    fn bits_are_copied_only_when_their_component_changed() {
        let bits = Selection::from_words(64, vec![5]);
        let mut kept = None;
        let first = keep(&mut kept, Tick::new(3), &bits).unwrap();
        assert!(Arc::ptr_eq(&first, &keep(&mut kept, Tick::new(3), &bits).unwrap()));
        assert!(!Arc::ptr_eq(&first, &keep(&mut kept, Tick::new(4), &bits).unwrap()));
        assert_eq!(keep(&mut kept, Tick::new(5), &Selection::default()), None);
    }
}
