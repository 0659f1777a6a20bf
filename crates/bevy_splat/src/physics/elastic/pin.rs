//! [`Pin`]: holds a region of an elastic part.

use std::sync::Arc;

use bevy::math::{DQuat, DVec3};
use bevy::prelude::*;
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};
use serde::{Deserialize, Serialize};
use splat_physics::{ElasticModel, Spring};

use super::state::{ElasticState, Hand};
use crate::{SplatCloud, SplatSubset, Splats};

/// Points that hold a region at most: more hold it no better.
const MOST_POINTS: usize = 64;
/// How fast the whole part would swing on its pins if it were rigid, in Hz: stiff against all that bends.
const FREQUENCY: f64 = 1000.0;

/// Holds a region of an elastic part: where it is in the world, or to an entity that moves.
///
/// On the part's entity, or on a child of it, so that a part can have several:
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_splat::physics::{ElasticPart, elastic::{Pin, PinRegion}};
/// fn hang_up(mut commands: Commands, part: Single<Entity, With<ElasticPart>>) {
///     let top = PinRegion::Sphere { center: Vec3::new(0.0, -1.2, 0.3), radius: 0.1 };
///     commands.entity(*part).with_child(Pin { region: top, target: None });
/// }
/// # bevy::ecs::system::assert_is_system(hang_up);
/// ```
///
/// What is in the region when the pin takes hold stays held, as it then stood. The pin pulls the part alone: what it follows
/// does not feel it. A pin that changes takes hold anew; to remove it lets go.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
pub struct Pin {
    /// What is held. A region that holds no point of the part takes the nearest.
    pub region: PinRegion,
    /// What it follows; `None`: it stays in the world.
    #[entities]
    pub target: Option<Entity>,
}

/// A region of a part at rest, in the space of its cloud: that of positions relative to its `Transform`.
#[derive(Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default, Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum PinRegion {
    /// A ball.
    Sphere {
        /// Its middle.
        center: Vec3,
        /// In units of the cloud.
        radius: f32,
    },
    /// A box.
    Box {
        /// Its middle.
        center: Vec3,
        /// Half of its sides, in units of the cloud.
        half_size: Vec3,
        /// How it is turned.
        rotation: Quat,
    },
    /// Gaussians, by their ids in the cloud.
    Selection(SplatSubset),
}

impl Default for PinRegion {
    /// Nothing but what is nearest to the origin.
    fn default() -> Self {
        Self::Sphere { center: Vec3::ZERO, radius: 0.0 }
    }
}

/// What a pin holds.
#[derive(Component)]
pub(super) struct PinHold {
    model: Arc<ElasticModel>,
    /// At rest, in the body's frame.
    points: Vec<DVec3>,
    /// Where they are held: in the world, or in the frame of the target.
    anchors: Vec<DVec3>,
    target: Option<Entity>,
}

impl PinRegion {
    /// Points of a part in the region, at rest, in the body's frame: at least one, at most [`MOST_POINTS`].
    fn points(&self, state: &ElasticState, cloud: Option<&SplatCloud>) -> Vec<DVec3> {
        let model = state.body.model();
        let scale = state.metres_per_unit();
        let all = || model.contact_points().iter().copied().chain(model.samples().iter().map(|s| s.position));
        let (found, center): (Vec<DVec3>, DVec3) = match self {
            Self::Sphere { center, radius } => {
                let (center, radius) = (center.as_dvec3() * scale, f64::from(*radius) * scale);
                (all().filter(|p| p.distance(center) <= radius).collect(), center)
            }
            Self::Box { center, half_size, rotation } => {
                let (center, half) = (center.as_dvec3() * scale, half_size.as_dvec3().abs() * scale);
                let back = rotation.as_dquat().normalize().conjugate();
                let inside = |p: &DVec3| (back * (*p - center)).abs().cmple(half).all();
                (all().filter(inside).collect(), center)
            }
            Self::Selection(subset) => {
                let means = cloud.map_or(&[][..], |cloud| cloud.cloud.means());
                let mean = |&id: &u32| Some(means.get(id as usize)?.as_dvec3() * scale).filter(|p| p.is_finite());
                let found: Vec<DVec3> = subset.0.iter().filter_map(mean).collect();
                let center = found.iter().sum::<DVec3>() / found.len().max(1) as f64;
                (found, center)
            }
        };
        if found.is_empty() {
            return all().min_by(|a, b| a.distance(center).total_cmp(&b.distance(center))).into_iter().collect();
        }
        spread(&found, MOST_POINTS)
    }
}

/// At most `most` of the points, each as far as possible from those before.
fn spread(points: &[DVec3], most: usize) -> Vec<DVec3> {
    if points.len() <= most {
        return points.to_vec();
    }
    let mut left = vec![f64::INFINITY; points.len()];
    let mut at = 0;
    let mut out = Vec::with_capacity(most);
    while out.len() < most {
        out.push(points[at]);
        let mut far = (0.0, at);
        for (k, (p, left)) in points.iter().zip(&mut left).enumerate() {
            *left = left.min(p.distance_squared(points[at]));
            if *left > far.0 {
                far = (*left, k);
            }
        }
        if far.0 == 0.0 {
            break;
        }
        at = far.1;
    }
    out
}

/// Where an entity is, as a pin sees it.
type Targets<'w, 's> = TransformHelper<'w, 's>;

fn place_of(target: Entity, targets: &Targets) -> Option<(DQuat, DVec3)> {
    let (_, rotation, translation) = targets.compute_global_transform(target).ok()?.to_scale_rotation_translation();
    Some((rotation.as_dquat(), translation.as_dvec3()))
}

type Pins<'a> = (Entity, Ref<'a, Pin>, Option<&'a mut PinHold>, Option<&'a ChildOf>);

/// Takes hold of what pins ask for, and hands to parts what holds them.
pub(super) fn hold(
    mut commands: Commands,
    clouds: Res<Assets<SplatCloud>>,
    mut pins: Query<Pins>,
    targets: Targets,
    mut states: Query<(&mut ElasticState, &Splats)>,
) {
    // In the order of entities: sums of springs then have the same bits.
    let mut order: Vec<Entity> = pins.iter().map(|(entity, ..)| entity).collect();
    order.sort_unstable();
    for entity in order {
        let Ok((_, pin, hold, above)) = pins.get_mut(entity) else { continue };
        let owner = if states.contains(entity) { Some(entity) } else { above.map(ChildOf::parent) };
        let Some(owner) = owner else { continue };
        let Ok((mut state, splats)) = states.get_mut(owner) else { continue };
        let place = pin.target.map(|target| place_of(target, &targets));
        let kept = hold.as_ref().is_some_and(|hold| Arc::ptr_eq(&hold.model, state.body.model()) && !pin.is_changed());
        let Some(place) = place.map_or(Some((DQuat::IDENTITY, DVec3::ZERO)), |place| place) else {
            // What it follows is gone: it lets go.
            continue;
        };
        if kept && let Some(hold) = hold {
            push_hands(&mut state, &hold, place);
            continue;
        }
        let points = pin.region.points(&state, clouds.get(&splats.0));
        let anchor = |&rest: &DVec3| place.0.conjugate() * (state.body.point_position(rest) - place.1);
        let anchors = points.iter().map(anchor).collect();
        let new = PinHold { model: state.body.model().clone(), points, anchors, target: pin.target };
        push_hands(&mut state, &new, place);
        match hold {
            Some(mut hold) => *hold = new,
            None => {
                commands.entity(entity).try_insert(new);
            }
        }
    }
}

fn push_hands(state: &mut ElasticState, hold: &PinHold, (rotation, translation): (DQuat, DVec3)) {
    let mass = state.body.model().mass().mass;
    let stiffness = mass * (std::f64::consts::TAU * FREQUENCY).powi(2) / hold.points.len().max(1) as f64;
    let still = hold.target.is_none();
    state.hands.extend(hold.points.iter().zip(&hold.anchors).map(|(&point, &anchor)| {
        let target = if still { anchor } else { rotation * anchor + translation };
        Hand { spring: Spring { point, target, stiffness }, damping: 0.0 }
    }));
}

/// Forgets what a pin held.
pub(super) fn let_go(removed: On<Remove, Pin>, mut commands: Commands) {
    if let Ok(mut entity) = commands.get_entity(removed.event().entity) {
        entity.try_remove::<PinHold>();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_of_many_points_are_spread_over_all_of_them() {
        let line: Vec<DVec3> = (0..1000).map(|k| DVec3::X * f64::from(k)).collect();
        let few = spread(&line, 5);
        assert_eq!(few.len(), 5);
        assert!(few.contains(&DVec3::ZERO) && few.contains(&(DVec3::X * 999.0)), "{few:?}");
        assert_eq!(spread(&[DVec3::ONE; 100], 5), [DVec3::ONE]);
        assert_eq!(spread(&line[..3], 5), line[..3]);
    }
}
