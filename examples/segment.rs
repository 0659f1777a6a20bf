//! From a click to an object of its own: the click segments the whole object in the background, the object becomes a part,
//! the part an entity, and the entity moves like any other.

use bevy::camera_controller::free_camera::FreeCamera;
use bevy::prelude::*;
use bevy_splat::prelude::*;

mod common;

fn main() -> AppExit {
    common::app()
        .add_systems(Startup, setup)
        .add_systems(Update, (click_by_itself, make_a_part, take_it_out, rise))
        .run()
}

/// An object that was taken out.
#[derive(Component)]
struct Taken;

fn setup(mut commands: Commands, assets: Res<AssetServer>, args: Res<common::Args>) {
    commands.spawn(Splats(assets.load(args.scene.clone()))).observe(clicked);
    commands.spawn((
        Camera3d::default(),
        FreeCamera::default(),
        Transform::from_xyz(0.92, 0.65, 3.66).looking_at(Vec3::new(0.2, 0.0, 0.5), Vec3::Y),
    ));
}

fn clicked(click: On<Pointer<Click>>, cameras: Query<&Camera>, mut requests: MessageWriter<SegmentRequest>) {
    let Ok(camera) = cameras.get(click.hit.camera) else { return };
    let Some(pixel) = view_pixel(camera, click.pointer_location.position) else { return };
    requests.write(SegmentRequest::click(click.entity, click.hit.camera, pixel));
}

/// The object is selected once it is found.
fn make_a_part(
    mut done: MessageReader<SegmentDone>,
    mut failed: MessageReader<SegmentFailed>,
    mut parts: MessageWriter<MakePart>,
    mut ready: ResMut<common::Ready>,
) {
    for SegmentDone { entity, selection, .. } in done.read() {
        info!("an object of {} Gaussians", selection.count());
        parts.write(MakePart { entity: *entity, name: "object".into() });
    }
    for SegmentFailed { reason, .. } in failed.read() {
        warn!("{reason}");
        ready.0 = true;
    }
}

fn take_it_out(mut made: MessageReader<PartMade>, mut commands: Commands) {
    for made in made.read() {
        match &made.part {
            Ok(part) => {
                let object = commands.extract_part(made.entity, *part);
                commands.entity(object).insert((Taken, SplatHighlight::OFF));
            }
            Err(error) => warn!("{error}"),
        }
    }
}

fn rise(
    time: Res<Time>,
    args: Res<common::Args>,
    mut ready: ResMut<common::Ready>,
    mut objects: Query<&mut Transform, With<Taken>>,
) {
    for mut transform in &mut objects {
        if args.shot.is_some() {
            transform.translation.y = 0.35;
            ready.0 = true;
        } else {
            transform.translation.y = (transform.translation.y + 0.3 * time.delta_secs()).min(0.5);
        }
    }
}

/// For `--shot`: one click without a mouse.
fn click_by_itself(
    args: Res<common::Args>,
    captures: Query<Entity, With<Splats>>,
    clouds: Res<Assets<SplatCloud>>,
    camera: Single<Entity, With<Camera3d>>,
    mut ready: ResMut<common::Ready>,
    mut done: Local<bool>,
    mut requests: MessageWriter<SegmentRequest>,
) {
    if args.shot.is_none() || *done {
        return;
    }
    ready.0 = false;
    if clouds.is_empty() {
        return;
    }
    *done = true;
    for entity in &captures {
        let pixel = args.size.as_vec2() * args.click;
        requests.write(SegmentRequest::click(entity, *camera, pixel));
    }
}
