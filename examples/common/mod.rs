//! What the examples share: a window, or with `--shot FILE` one picture and no window.
//!
//! ```text
//! cargo run --release --example view -- [SCENE] [--camera FILE#N] [--shot FILE] [--size 960x540]
//!     [--after FRAMES] [--click 0.43,0.9] [--fps]
//! ```

#![allow(dead_code, unreachable_pub, reason = "every example is a crate of its own and takes what it needs")]

use std::path::PathBuf;
use std::time::Duration;

use bevy::app::ScheduleRunnerPlugin;
use bevy::asset::UnapprovedPathMode;
use bevy::camera::{ImageRenderTarget, NormalizedRenderTarget, RenderTarget};
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy::render::render_resource::{TextureFormat, TextureUsages};
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured, save_to_disk};
use bevy::window::{ExitCondition, WindowResolution};
use bevy::winit::WinitPlugin;
use bevy_splat::prelude::*;
use splat_core::View;

/// The generated room of this repository, below `assets/`.
pub const ROOM: &str = "room/scene.spz";

/// What the command line says.
#[derive(Resource, Clone, Debug)]
pub struct Args {
    /// The capture, below `assets/` or any path.
    pub scene: String,
    /// Where the one picture goes; a window where none is named.
    pub shot: Option<PathBuf>,
    /// Pixels across and down.
    pub size: UVec2,
    /// A view of the capture's own space to stand at instead of the example's place.
    pub view: Option<View>,
    /// Whether to turn the camera and print frames per second.
    pub fps: bool,
    /// Where the example clicks by itself, as shares of the picture.
    pub click: Vec2,
    /// Frames between the loaded scene and the picture.
    pub after: u32,
}

impl Args {
    fn parse() -> Self {
        let mut args = Self {
            scene: ROOM.into(),
            shot: None,
            size: UVec2::new(960, 540),
            view: None,
            fps: false,
            click: Vec2::new(0.43, 0.9),
            after: 4,
        };
        let mut words = std::env::args().skip(1);
        while let Some(word) = words.next() {
            let mut value = || words.next().unwrap_or_else(|| misused(&format!("{word} needs a value")));
            match word.as_str() {
                "--shot" => args.shot = Some(value().into()),
                "--click" => {
                    let text = value();
                    let at = text.split_once(',').and_then(|(x, y)| Some((x.parse().ok()?, y.parse().ok()?)));
                    let (x, y) = at.unwrap_or_else(|| misused("--click needs shares of the picture, such as 0.43,0.9"));
                    args.click = Vec2::new(x, y);
                }
                "--fps" => args.fps = true,
                "--camera" => args.view = Some(camera(&value())),
                "--after" => {
                    args.after = value().parse().unwrap_or_else(|_| misused("--after needs a count of frames"))
                }
                "--size" => {
                    let text = value();
                    let size = text.split_once('x').and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
                    let (w, h) = size.unwrap_or_else(|| misused("--size needs pixels, such as 960x540"));
                    args.size = UVec2::new(w, h);
                }
                option if option.starts_with('-') => misused(&format!("there is no option {option}")),
                scene => args.scene = absolute(scene),
            }
        }
        args
    }
}

/// A view of a camera file, such as `cameras.json#9`.
fn camera(name: &str) -> View {
    let (file, number) = name.rsplit_once('#').unwrap_or((name, "0"));
    let views = splat_io::cameras::read(file).unwrap_or_else(|error| misused(&error.to_string())).views;
    let view = number.parse::<usize>().ok().and_then(|k| views.get(k));
    view.unwrap_or_else(|| misused(&format!("{file} has cameras 0 to {}", views.len().saturating_sub(1)))).view
}

fn misused(what: &str) -> ! {
    error_line(&format!("{what}; usage: [SCENE] [--camera FILE#N] [--shot FILE] [--size 960x540] [--fps]"));
    std::process::exit(2)
}

#[expect(clippy::print_stderr, reason = "the examples are programs")]
fn error_line(text: &str) {
    eprintln!("{text}");
}

/// Files beside the working folder are found there, everything else below `assets/`.
fn absolute(scene: &str) -> String {
    match std::path::absolute(scene) {
        Ok(path) if path.exists() => path.to_string_lossy().into_owned(),
        _ => scene.into(),
    }
}

/// Whether the picture may be taken: an example that waits for something sets it to false, then to true.
#[derive(Resource)]
pub struct Ready(pub bool);

/// An app with Bevy's plugins and ours, in a window or, for `--shot`, without one.
pub fn app() -> App {
    let args = Args::parse();
    let assets = AssetPlugin { unapproved_path_mode: UnapprovedPathMode::Allow, ..default() };
    let mut app = App::new();
    if args.shot.is_some() {
        let no_window = WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() };
        app.add_plugins((
            // Nothing is missing from the picture because its shader is still being compiled.
            DefaultPlugins
                .set(RenderPlugin { synchronous_pipeline_compilation: true, ..default() })
                .set(no_window)
                .set(assets)
                .disable::<WinitPlugin>(),
            ScheduleRunnerPlugin::run_loop(Duration::ZERO),
        ));
        app.add_systems(First, aim).add_systems(Last, shoot);
    } else {
        let window =
            Window { title: "splat".into(), resolution: WindowResolution::new(args.size.x, args.size.y), ..default() };
        app.add_plugins(DefaultPlugins.set(WindowPlugin { primary_window: Some(window), ..default() }).set(assets));
        app.add_plugins(bevy::camera_controller::free_camera::FreeCameraPlugin);
        if args.fps {
            app.add_systems(Update, (turn, tell_frames));
        }
    }
    app.add_systems(PostStartup, stand);
    app.add_plugins(BevySplatPlugins).insert_resource(args).insert_resource(Ready(true));
    app
}

/// Stands where the command line says.
fn stand(args: Res<Args>, mut cameras: Query<(&mut Transform, &mut Projection), With<Camera3d>>) {
    let Some(view) = &args.view else { return };
    for (mut transform, mut projection) in &mut cameras {
        *transform = SplatCameras::transform(view, &UPRIGHT);
        *projection = SplatCameras::projection(view).into();
    }
}

/// Looks to and fro, so that every frame is another one.
fn turn(time: Res<Time>, mut cameras: Query<&mut Transform, With<Camera3d>>) {
    for mut transform in &mut cameras {
        transform.rotate_y(0.1 * time.delta_secs() * (0.5 * time.elapsed_secs()).cos());
    }
}

fn tell_frames(time: Res<Time<Real>>, mut from: Local<(f64, u32)>) {
    let (began, frames) = &mut *from;
    *frames += 1;
    let past = time.elapsed_secs_f64() - *began;
    if past > 5.0 {
        info!("{:.1} frames per second", f64::from(*frames) / past);
        *from = (time.elapsed_secs_f64(), 0);
    }
}

/// The picture that cameras draw into where there is no window.
#[derive(Resource)]
pub struct Canvas(pub Handle<Image>);

impl Canvas {
    /// As pointers name it.
    pub fn target(&self) -> NormalizedRenderTarget {
        NormalizedRenderTarget::Image(ImageRenderTarget::from(self.0.clone()))
    }
}

/// Turns new cameras to the picture.
fn aim(
    mut commands: Commands,
    args: Res<Args>,
    canvas: Option<Res<Canvas>>,
    mut images: ResMut<Assets<Image>>,
    mut cameras: Query<&mut RenderTarget, Added<Camera>>,
) {
    let handle = match canvas {
        Some(canvas) => canvas.0.clone(),
        None => {
            let mut image = Image::new_target_texture(args.size.x, args.size.y, TextureFormat::Rgba8UnormSrgb, None);
            image.texture_descriptor.usage |= TextureUsages::COPY_SRC;
            let handle = images.add(image);
            commands.insert_resource(Canvas(handle.clone()));
            handle
        }
    };
    for mut target in &mut cameras {
        if matches!(*target, RenderTarget::Window(_)) {
            *target = RenderTarget::Image(ImageRenderTarget::from(handle.clone()));
        }
    }
}

/// Takes the picture once every capture is there, and ends the app when it is written.
fn shoot(
    mut commands: Commands,
    (args, ready, canvas): (Res<Args>, Res<Ready>, Option<Res<Canvas>>),
    (server, clouds): (Res<AssetServer>, Res<Assets<SplatCloud>>),
    splats: Query<&Splats>,
    mut frames: Local<u32>,
    mut exit: MessageWriter<AppExit>,
) {
    for Splats(handle) in &splats {
        if let bevy::asset::LoadState::Failed(error) = server.load_state(handle) {
            error_line(&error.to_string());
            exit.write(AppExit::error());
        }
    }
    let loaded = splats.iter().all(|Splats(handle)| clouds.contains(handle));
    let (Some(canvas), Some(shot)) = (canvas, &args.shot) else { return };
    if !loaded || !ready.0 {
        return;
    }
    *frames += 1;
    if *frames == args.after {
        let mut save = save_to_disk(shot.clone());
        commands.spawn(Screenshot::image(canvas.0.clone())).observe(
            move |captured: On<ScreenshotCaptured>, mut exit: MessageWriter<AppExit>| {
                save(captured);
                exit.write(AppExit::Success);
            },
        );
    }
}
