//! Elastic parts drawn as lines: cage, contact points, stress as colour. Needs the crate's feature `physics_debug`.
//!
//! Colliders and rigid bodies are avian3d's to draw: its `PhysicsDebugPlugin` does.

use bevy::color::palettes::css;
use bevy::prelude::*;
use splat_core::deform::Cage;

use super::elastic::ElasticState;
use crate::components::SplatDeformation;

/// Draws elastic parts as lines over the scene; what is drawn is in [`SplatPhysicsGizmos`]. Needs Bevy's `GizmoPlugin` (in
/// `DefaultPlugins`).
///
/// ```no_run
/// # use bevy::prelude::*;
/// # use bevy_splat::prelude::*;
/// use bevy_splat::physics::debug::SplatPhysicsDebugPlugin;
/// App::new().add_plugins((DefaultPlugins, BevySplatPlugins, SplatPhysicsDebugPlugin)).run();
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct SplatPhysicsDebugPlugin;

impl Plugin for SplatPhysicsDebugPlugin {
    fn build(&self, app: &mut App) {
        app.init_gizmo_group::<SplatPhysicsGizmos>().add_systems(PostUpdate, draw);
    }
}

/// What [`SplatPhysicsDebugPlugin`] draws: a gizmo group, whose `enabled`, line width and depth bias are in Bevy's
/// `GizmoConfigStore`.
#[derive(Clone, Debug, Reflect, GizmoConfigGroup)]
pub struct SplatPhysicsGizmos {
    /// Edges of the cells of the cage; `None`: not drawn.
    pub cage: Option<Color>,
    /// Contact points; `None`: not drawn. Those of parts that sleep are drawn with half of the strength.
    pub contact_points: Option<Color>,
    /// Whether samples are drawn, coloured by von Mises' stress: blue without any, red at [`stress_most`](Self::stress_most).
    pub stress: bool,
    /// The stress drawn in red, in Pa; `None`: the greatest of each part.
    pub stress_most: Option<f32>,
}

impl Default for SplatPhysicsGizmos {
    fn default() -> Self {
        Self {
            cage: Some(css::GRAY.with_alpha(0.35).into()),
            contact_points: Some(css::WHITE.into()),
            stress: true,
            stress_most: None,
        }
    }
}

fn draw(mut gizmos: Gizmos<SplatPhysicsGizmos>, parts: Query<(&ElasticState, &SplatDeformation, &GlobalTransform)>) {
    for (state, deformation, place) in &parts {
        let config = gizmos.config_ext.clone();
        let deformed = &*deformation.0;
        let world = |point: Vec3| place.transform_point(point);
        if let Some(color) = config.cage {
            for [a, b] in edges(state, deformed.cage()) {
                gizmos.line(world(deformed.positions()[a]), world(deformed.positions()[b]), color);
            }
        }
        let model = state.body().model();
        let unit = 1.0 / state.metres_per_unit() as f32;
        let size = 0.01 * model.cage().cage.cells.max_element() as f32 * model.cage().cage.cell;
        let mut cross = |at: Vec3, color: Color| {
            for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
                gizmos.line(at - axis * size, at + axis * size, color);
            }
        };
        let drawn = |rest: bevy::math::DVec3| world(deformed.at(rest.as_vec3() * unit).position);
        if let Some(color) = config.contact_points {
            let color = if state.is_asleep() { color.with_alpha(0.5 * color.alpha()) } else { color };
            model.contact_points().iter().for_each(|&point| cross(drawn(point), color));
        }
        if config.stress {
            let stresses = state.body().stresses();
            let greatest = stresses.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
            let most = config.stress_most.map_or(greatest, f64::from);
            for (sample, stress) in model.samples().iter().zip(stresses) {
                cross(drawn(sample.position), heat((stress / most) as f32));
            }
        }
    }
}

/// Blue at 0, by green, to red at 1.
fn heat(share: f32) -> Color {
    Color::hsl(240.0 * (1.0 - share.clamp(0.0, 1.0)), 1.0, 0.5)
}

/// The edges of all cells in which there is something of the part, each once.
fn edges(state: &ElasticState, cage: &Cage) -> Vec<[usize; 2]> {
    let part = state.body().model().cage();
    let mut edges = Vec::new();
    for (index, _) in part.active.iter().enumerate().filter(|(_, active)| **active) {
        let corners = cage.corners(part.cell_at(index));
        for from in 0..8_usize {
            for bit in [1, 2, 4] {
                if from & bit == 0 {
                    edges.push([corners[from], corners[from | bit]]);
                }
            }
        }
    }
    edges.sort_unstable();
    edges.dedup();
    edges
}

#[cfg(test)]
mod tests {
    use super::super::elastic::tests::{app, ball, coarse, foam, ready, spawn, state};
    use super::*;

    #[test]
    fn each_edge_of_a_cage_is_drawn_once_and_drawing_a_part_is_sound() {
        let mut app = app();
        app.init_asset::<Mesh>().add_plugins(bevy::gizmos::GizmoPlugin).add_plugins(SplatPhysicsDebugPlugin);
        let part = spawn(&mut app, ball(0.1, 1000), Transform::default(), coarse(), foam());
        ready(&mut app, part);
        app.update();
        app.update();
        let state = state(&app, part);
        let cage = *app.world().get::<SplatDeformation>(part).unwrap().0.cage();
        let edges = edges(state, &cage);
        assert!(edges.len() > 100 && edges.iter().all(|[a, b]| a < b && *b < cage.node_count()));
    }

    #[test]
    fn no_stress_is_blue_and_the_most_is_red() {
        assert_eq!(heat(0.0).to_srgba().to_u8_array_no_alpha(), [0, 0, 255]);
        assert_eq!(heat(7.0).to_srgba().to_u8_array_no_alpha(), [255, 0, 0]);
        assert_eq!(heat(f32::NAN.max(0.5)).to_srgba().to_u8_array_no_alpha(), [0, 255, 0]);
    }
}
