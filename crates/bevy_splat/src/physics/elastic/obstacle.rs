//! [`ElasticObstacles`] and [`ElasticGround`]: what elastic parts touch beside each other.

use std::fmt;
use std::sync::Arc;

use bevy::math::DVec3;
use bevy::prelude::*;
use splat_physics::world::RigidState;

/// What elastic parts may touch in this fixed step, beside each other and the [`ElasticGround`]. Emptied in each step before
/// [`SplatPhysicsSystems::Prepare`](crate::physics::SplatPhysicsSystems::Prepare), and filled within it: by this crate from
/// avian3d's colliders, or by systems of your own from another engine.
#[derive(Resource, Clone, Debug, Default, Deref, DerefMut)]
pub struct ElasticObstacles(pub Vec<ElasticObstacle>);

/// What stands still for all elastic parts, without any engine: planes, fields of distance, shapes of your own.
///
/// Beside avian3d it adds to what its colliders are.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_splat::physics::elastic::ElasticGround;
/// # let mut app = App::new();
/// app.insert_resource(ElasticGround::plane(Dir3::Y, 0.0));
/// ```
#[derive(Resource, Clone, Debug, Default, Deref, DerefMut)]
pub struct ElasticGround(pub Vec<ElasticObstacle>);

impl ElasticGround {
    /// Everything below a plane: `normal` points away from it, and its points have `normal . p = offset`, in metres.
    pub fn plane(normal: Dir3, offset: f32) -> Self {
        Self(vec![ElasticObstacle::still(PlaneShape {
            normal: normal.as_dvec3().normalize(),
            offset: f64::from(offset),
        })])
    }
}

/// Something that elastic parts can touch.
#[derive(Clone, Debug)]
pub struct ElasticObstacle {
    /// Whose it is, for messages.
    pub entity: Option<Entity>,
    /// Its surface.
    pub shape: Arc<dyn ObstacleShape>,
    /// A box around it in world space, in metres: least and greatest corner. `None`: it may be everywhere.
    pub bounds: Option<(DVec3, DVec3)>,
    /// How rough and how bouncy it is.
    pub surface: ContactSurface,
    /// Who it touches.
    pub layers: ElasticLayers,
    /// How it moves.
    pub motion: ObstacleMotion,
}

impl ElasticObstacle {
    /// Something that stands still, is everywhere, and as rough as most things are.
    pub fn still(shape: impl ObstacleShape) -> Self {
        Self {
            entity: None,
            shape: Arc::new(shape),
            bounds: None,
            surface: ContactSurface::default(),
            layers: ElasticLayers::default(),
            motion: ObstacleMotion::Still,
        }
    }
}

/// How an obstacle moves, in world space and SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ObstacleMotion {
    /// Not at all.
    Still,
    /// As it was told, whatever it touches.
    Moving {
        /// What it turns about.
        center: DVec3,
        /// In m/s.
        linear: DVec3,
        /// In rad/s.
        angular: DVec3,
    },
    /// As pushed: what touches it is pushed back by as much.
    Free {
        /// With what this step's gravity adds.
        state: RigidState,
        /// Whether it rests, and stands still as long as nothing fast touches it.
        asleep: bool,
    },
}

/// A surface that can be asked for its nearest point.
pub trait ObstacleShape: Send + Sync + fmt::Debug + 'static {
    /// Distance from the surface to a point in metres, negative inside, and the unit normal away from it; `None` where it is
    /// farther than `reach`. All in world space.
    ///
    /// `inside`: a point of what touches, well within it. A surface that encloses nothing, such as a sheet of triangles,
    /// goes by it: what lies on the other side of the sheet than this point is inside the obstacle.
    fn nearest(&self, point: DVec3, inside: DVec3, reach: f64) -> Option<(f64, DVec3)>;
}

/// A half space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneShape {
    /// A unit vector, away from the solid side.
    pub normal: DVec3,
    /// `normal . p` of points on the plane, in metres.
    pub offset: f64,
}

impl ObstacleShape for PlaneShape {
    fn nearest(&self, point: DVec3, _inside: DVec3, reach: f64) -> Option<(f64, DVec3)> {
        let gap = self.normal.dot(point) - self.offset;
        (gap < reach).then_some((gap, self.normal))
    }
}

/// How rough and how bouncy a surface is, and how that is combined with another's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactSurface {
    /// Coulomb's coefficients, dynamic and static.
    pub friction: [f64; 2],
    /// 0..=1.
    pub restitution: f64,
    /// How friction is combined.
    pub friction_rule: CombineRule,
    /// How restitution is combined.
    pub restitution_rule: CombineRule,
}

impl Default for ContactSurface {
    /// As avian3d's bodies are by default: 0.5, and no bounce.
    fn default() -> Self {
        Self {
            friction: [0.5; 2],
            restitution: 0.0,
            friction_rule: CombineRule::Average,
            restitution_rule: CombineRule::Average,
        }
    }
}

impl ContactSurface {
    /// Friction, dynamic and static, and restitution of two surfaces that touch. Of two rules the later in [`CombineRule`] holds.
    pub fn with(&self, other: &Self) -> ([f64; 2], f64) {
        let rule = self.friction_rule.max(other.friction_rule);
        let friction = [0, 1].map(|k| rule.of(self.friction[k], other.friction[k]));
        let rule = self.restitution_rule.max(other.restitution_rule);
        (friction, rule.of(self.restitution, other.restitution))
    }
}

/// How the coefficients of two surfaces become that of the pair; as avian3d's `CoefficientCombine`, in rising priority.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum CombineRule {
    /// Their mean.
    #[default]
    Average,
    /// The square root of their product.
    GeometricMean,
    /// The lesser.
    Min,
    /// Their product.
    Multiply,
    /// The greater.
    Max,
}

impl CombineRule {
    fn of(self, a: f64, b: f64) -> f64 {
        match self {
            Self::Average => 0.5 * (a + b),
            Self::GeometricMean => (a * b).sqrt(),
            Self::Min => a.min(b),
            Self::Multiply => a * b,
            Self::Max => a.max(b),
        }
    }
}

/// Which layers something is in, and which it touches; as avian3d's `CollisionLayers`, which a part may have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ElasticLayers {
    /// A bit for each layer that it is in.
    pub memberships: u32,
    /// A bit for each layer that it touches.
    pub filters: u32,
}

impl Default for ElasticLayers {
    /// In the first layer, touching all.
    fn default() -> Self {
        Self { memberships: 1, filters: u32::MAX }
    }
}

impl ElasticLayers {
    /// Whether each touches a layer of the other.
    pub fn touches(self, other: Self) -> bool {
        self.memberships & other.filters != 0 && other.memberships & self.filters != 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surfaces_combine_by_the_rule_of_higher_priority() {
        let ice = ContactSurface { friction: [0.0, 0.1], friction_rule: CombineRule::Min, ..default() };
        let rubber = ContactSurface { friction: [0.8, 1.0], restitution: 0.8, ..default() };
        assert_eq!(rubber.with(&ice), ([0.0, 0.1], 0.4));
        assert_eq!(ice.with(&rubber), rubber.with(&ice));
        assert_eq!(rubber.with(&rubber).0, [0.8, 1.0]);
        assert_eq!(CombineRule::GeometricMean.of(0.5, 2.0), 1.0);
        assert_eq!(CombineRule::Multiply.of(0.5, 2.0), 1.0);
        assert_eq!(CombineRule::Max.of(0.5, 2.0), 2.0);
    }

    #[test]
    fn layers_touch_only_if_both_want_it() {
        let (a, b) = (ElasticLayers { memberships: 1, filters: 2 }, ElasticLayers { memberships: 2, filters: 1 });
        assert!(a.touches(b) && b.touches(a));
        assert!(!a.touches(a));
        assert!(ElasticLayers::default().touches(ElasticLayers::default()));
    }

    #[test]
    fn a_plane_is_solid_below() {
        let plane = PlaneShape { normal: DVec3::Y, offset: 2.0 };
        assert_eq!(plane.nearest(DVec3::new(7.0, 1.5, 0.0), DVec3::ZERO, 0.1), Some((-0.5, DVec3::Y)));
        assert_eq!(plane.nearest(DVec3::new(7.0, 2.5, 0.0), DVec3::ZERO, 0.1), None);
    }
}
