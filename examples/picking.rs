//! Picking: the Gaussian under the pointer, with the place and the direction of the surface that it belongs to.
//!
//! Click on the capture: an arrow stands where you clicked, and the log tells what was hit.

use bevy::camera_controller::free_camera::FreeCamera;
use bevy::picking::pointer::{Location, PointerAction, PointerButton, PointerId, PointerInput};
use bevy::prelude::*;
use bevy_splat::prelude::*;

mod common;

fn main() -> AppExit {
    common::app().add_systems(Startup, setup).add_systems(Update, click_by_itself).run()
}

/// What an arrow is made of.
#[derive(Resource)]
struct Arrow(Handle<Mesh>, Handle<StandardMaterial>);

fn setup(
    mut commands: Commands,
    assets: Res<AssetServer>,
    args: Res<common::Args>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    // Observers see clicks on a capture as on any other entity.
    commands.spawn(Splats(assets.load(args.scene.clone()))).observe(clicked);
    commands.insert_resource(Arrow(meshes.add(Cone::new(0.05, 0.25)), materials.add(Color::srgb(0.95, 0.2, 0.15))));
    commands.spawn((DirectionalLight::default(), Transform::from_xyz(2.0, 4.0, 3.0).looking_at(Vec3::ZERO, Vec3::Y)));
    commands.spawn((
        Camera3d::default(),
        FreeCamera::default(),
        Transform::from_xyz(0.92, 0.65, 3.66).looking_at(Vec3::new(0.2, 0.0, 0.5), Vec3::Y),
    ));
}

fn clicked(click: On<Pointer<Click>>, mut commands: Commands, arrow: Res<Arrow>) {
    let (Some(at), Some(normal)) = (click.hit.position, click.hit.normal) else { return };
    if let Some(hit) = click.hit.extra_as::<SplatHit>() {
        info!("Gaussian {} at {at}, seen {:.0} %", hit.gaussian, 100.0 * hit.weight);
    }
    // The cone's tip points along +y: turned round, it stands on the surface.
    let turn = Quat::from_rotation_arc(Vec3::NEG_Y, normal);
    commands.spawn((
        Mesh3d(arrow.0.clone()),
        MeshMaterial3d(arrow.1.clone()),
        Transform::from_translation(at + 0.125 * normal).with_rotation(turn),
    ));
}

/// For `--shot`: a few clicks without a mouse.
fn click_by_itself(
    args: Res<common::Args>,
    mut ready: ResMut<common::Ready>,
    clouds: Res<Assets<SplatCloud>>,
    canvas: Option<Res<common::Canvas>>,
    mut frame: Local<u32>,
    mut input: MessageWriter<PointerInput>,
) {
    let (Some(canvas), true) = (canvas, args.shot.is_some()) else { return };
    ready.0 = *frame > 30;
    if clouds.is_empty() {
        return;
    }
    *frame += 1;
    let (click, step) = (*frame / 6, *frame % 6);
    let place = Vec2::new(0.25 + 0.12 * click as f32, 0.72 - 0.07 * click as f32) * args.size.as_vec2();
    let location = Location { target: canvas.target(), position: place };
    let action = match step {
        1 => PointerAction::Move { delta: Vec2::ONE },
        3 => PointerAction::Press(PointerButton::Primary),
        5 => PointerAction::Release(PointerButton::Primary),
        _ => return,
    };
    input.write(PointerInput::new(PointerId::Mouse, location, action));
}
