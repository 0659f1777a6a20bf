//! [`CaptureScale`]: how large a capture is.

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use crate::Splats;
use crate::parts::PartOf;

/// How large a capture is: captures come in units of their own, physics needs metres. On the capture's entity.
///
/// When it is inserted or changed, the capture's `Transform` gets this scale (what moves it, turns it, or scales it later is
/// left alone), and the parts that were taken out of it follow, so that nothing moves against anything else. Without
/// it a unit of Bevy's world is a metre, as everywhere, and every body's report says that nobody told.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_splat::prelude::*;
/// # fn system(mut commands: Commands, capture: Single<Entity, With<Splats>>) {
/// // The door, 1.43 units high in the capture, is 2 m high.
/// commands.entity(*capture).insert(CaptureScale::measured(1.43, 2.0));
/// # }
/// ```
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
pub struct CaptureScale {
    /// Metres per unit of the cloud, above 0; `None`: not known.
    pub metres_per_unit: Option<f32>,
    /// Who says so.
    pub source: ScaleSource,
}

/// Where a scale comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect, Serialize, Deserialize)]
pub enum ScaleSource {
    /// Something of known length.
    Measured,
    /// The capture's file, or what it was made with.
    FromMetadata,
    /// Nothing but what such things usually measure.
    #[default]
    Guessed,
}

impl CaptureScale {
    /// Something that is `units` long in the capture is `metres` long.
    pub fn measured(units: f32, metres: f32) -> Self {
        Self { metres_per_unit: Some(metres / units), source: ScaleSource::Measured }
    }
}

/// Gives captures the scale they were told, and has their parts follow.
pub(super) fn apply(
    scales: Query<(Entity, &CaptureScale), Changed<CaptureScale>>,
    above: Query<&ChildOf>,
    links: Query<(Entity, &PartOf), With<Splats>>,
    mut transforms: Query<&mut Transform>,
) {
    for (capture, scale) in &scales {
        let Some(metres) = scale.metres_per_unit else { continue };
        if !(metres.is_finite() && metres > 0.0) {
            warn!(
                "{capture} has a CaptureScale of {metres} metres per unit, which is no scale: it keeps the one it has"
            );
            continue;
        }
        // The scale of what the capture is a child of.
        let parents = above.iter_ancestors(capture).filter_map(|entity| transforms.get(entity).ok());
        let parents: f32 = parents.map(|transform| transform.scale.x).product();
        let own = metres / parents;
        if !(own.is_finite() && own > 0.0) {
            warn!("{capture} cannot have its CaptureScale: what it is a child of has a scale of {parents}");
            continue;
        }
        let Ok(mut transform) = transforms.get_mut(capture) else { continue };
        let before = *transform;
        if before.scale == Vec3::splat(own) {
            continue;
        }
        transform.scale = Vec3::splat(own);
        let ratio = own / before.scale.x;
        let sound = before.is_finite() && ratio.is_finite() && ratio > 0.0;
        if !sound || above.contains(capture) {
            // Where it was cannot be told apart from where its parts are now.
            continue;
        }
        let about = before.translation;
        for (part, _) in links.iter().filter(|(part, _)| belongs(*part, capture, &links)) {
            if above.contains(part) {
                continue;
            }
            let Ok(mut transform) = transforms.get_mut(part) else { continue };
            transform.translation = about + ratio * (transform.translation - about);
            transform.scale *= ratio;
        }
    }
}

/// Whether a part was taken out of a capture, or out of what was taken out of it.
fn belongs(part: Entity, capture: Entity, links: &Query<(Entity, &PartOf), With<Splats>>) -> bool {
    let next = |&entity: &Entity| links.get(entity).ok().map(|(_, link)| link.0);
    std::iter::successors(Some(part), next).skip(1).take(64).any(|entity| entity == capture)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;

    #[test]
    fn a_capture_gets_its_scale_once_and_its_parts_follow() {
        let mut app = testing::app();
        app.add_systems(Update, apply);
        let capture = testing::spawn(&mut app, 9);
        let at = Transform::from_xyz(1.0, 2.0, 3.0).with_rotation(Quat::from_rotation_x(0.3));
        app.world_mut().entity_mut(capture).insert(at);
        let moved = Transform::from_xyz(2.0, 4.0, 7.0).with_rotation(Quat::from_rotation_y(1.0));
        let part = testing::spawn(&mut app, 9);
        let inner = testing::spawn(&mut app, 9);
        app.world_mut().entity_mut(part).insert((PartOf(capture), moved));
        app.world_mut().entity_mut(inner).insert((PartOf(part), at));
        app.world_mut().entity_mut(capture).insert(CaptureScale::measured(4.0, 2.0));
        app.update();
        let of = |app: &App, entity| *app.world().get::<Transform>(entity).unwrap();
        assert_eq!(of(&app, capture), at.with_scale(Vec3::splat(0.5)));
        // Nothing moved, as seen from the capture.
        let seen = |a: Transform, b: Transform| a.compute_affine().inverse() * b.compute_affine();
        let (before, after) = (seen(at, moved), seen(of(&app, capture), of(&app, part)));
        assert!(before.abs_diff_eq(after, 1e-5), "{before:?} {after:?}");
        assert_eq!(of(&app, inner), at.with_scale(Vec3::splat(0.5)));

        // It is not given again.
        app.world_mut().entity_mut(capture).insert(at);
        app.update();
        assert_eq!(of(&app, capture), at);
    }

    #[test]
    fn a_scale_that_is_none_changes_nothing() {
        let mut app = testing::app();
        app.add_systems(Update, apply);
        let capture = testing::spawn(&mut app, 9);
        let before = *app.world().get::<Transform>(capture).unwrap();
        for wrong in [f32::NAN, 0.0, -1.0, f32::INFINITY] {
            let scale = CaptureScale { metres_per_unit: Some(wrong), source: ScaleSource::Measured };
            app.world_mut().entity_mut(capture).insert(scale);
            app.update();
            assert_eq!(*app.world().get::<Transform>(capture).unwrap(), before, "{wrong}");
        }
        app.world_mut().entity_mut(capture).insert(CaptureScale::default());
        app.update();
        assert_eq!(*app.world().get::<Transform>(capture).unwrap(), before);
    }
}
