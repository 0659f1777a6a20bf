//! Selecting: a lasso, a rectangle and a brush, drawn by a player or asked for by the game, and how the selection shows.
//!
//! 1, 2 and 3 take rectangle, lasso and brush; Shift adds, Control takes away, Escape gives a figure up.

use bevy::prelude::*;
use bevy_splat::prelude::*;

mod common;

fn main() -> AppExit {
    common::app().add_systems(Startup, setup).add_systems(Update, (take_a_tool, select_by_itself)).run()
}

fn setup(mut commands: Commands, assets: Res<AssetServer>, args: Res<common::Args>) {
    commands.spawn((
        Splats(assets.load(args.scene.clone())),
        SplatHighlight { selection_color: Srgba::rgb(0.2, 0.9, 0.4), ..default() },
    ));
    commands.spawn((
        Camera3d::default(),
        // A line around what is selected.
        SplatCamera { outline: Some(SplatOutline::default()), ..default() },
        Transform::from_xyz(0.92, 0.65, 3.66).looking_at(Vec3::new(0.2, 0.0, 0.5), Vec3::Y),
    ));
}

fn take_a_tool(keys: Res<ButtonInput<KeyCode>>, mut tool: ResMut<ActiveTool>) {
    for (key, name) in [(KeyCode::Digit1, "rectangle"), (KeyCode::Digit2, "lasso"), (KeyCode::Digit3, "brush")] {
        if keys.just_pressed(key) {
            *tool = ActiveTool::named(name);
        }
    }
}

/// The same by messages: for `--shot`, and for your own scripts.
fn select_by_itself(
    args: Res<common::Args>,
    captures: Query<Entity, With<Splats>>,
    clouds: Res<Assets<SplatCloud>>,
    camera: Single<Entity, With<Camera3d>>,
    mut done: Local<bool>,
    mut requests: MessageWriter<SelectRequest>,
) {
    if args.shot.is_none() || clouds.is_empty() || *done {
        return;
    }
    *done = true;
    let size = args.size.as_vec2();
    for entity in &captures {
        let shape = Shape2d::Rect(size * Vec2::new(0.3, 0.35), size * Vec2::new(0.6, 0.75));
        // Only what is seen: at the depth of the picture, not what stands behind it.
        let by = SelectBy::Depth {
            camera: *camera,
            shape,
            footprint: Footprint::Center,
            tolerance: DepthTolerance::default(),
        };
        requests.write(SelectRequest { entity, mode: SelectMode::New, by });
    }
}
