//! An app with the generated room, a camera in it, and pointers that scripts move.

use std::sync::{Arc, LazyLock};
use std::time::{Duration, Instant};

use bevy::camera::{CameraProjection, ComputedCameraValues, ImageRenderTarget, RenderTarget, RenderTargetInfo};
use bevy::picking::backend::PointerHits;
use bevy::picking::pointer::{Location, PointerAction, PointerButton, PointerId, PointerInput};
use bevy::picking::{InteractionPlugin, PickingPlugin};
use bevy::prelude::*;
use bevy_splat::picking::SplatPickIndices;
use bevy_splat::prelude::*;
use splat_core::{Similarity, View};
use splat_raster::{Instance, Scene};

/// Pixels of the camera's target.
pub(crate) const SIZE: UVec2 = UVec2::new(400, 300);
/// On the teddy bear, in these pixels.
pub(crate) const BEAR: Vec2 = Vec2::new(217.0, 204.0);
/// The training camera that looks at the bear.
const CAMERA: usize = 27;

/// The generated room, and what it was seen from.
pub(crate) struct Room {
    pub(crate) cloud: Arc<Cloud>,
    pub(crate) views: Vec<View>,
    /// Object of every Gaussian.
    pub(crate) labels: Vec<u8>,
}

pub(crate) static ROOM: LazyLock<Room> = LazyLock::new(|| {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/room");
    let (cloud, _) = splat_io::read(format!("{folder}/scene.spz")).unwrap();
    let cameras = splat_io::cameras::read(format!("{folder}/cameras.json")).unwrap();
    let labels = splat_io::npy::read_u8(format!("{folder}/labels.npy")).unwrap();
    Room { cloud: Arc::new(cloud), views: cameras.views.into_iter().map(|v| v.view).collect(), labels }
});

/// An app with the room in it.
pub(crate) struct Stage {
    pub(crate) app: App,
    pub(crate) capture: Entity,
    pub(crate) camera: Entity,
    pub(crate) target: RenderTarget,
}

impl Stage {
    pub(crate) fn new() -> Self {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, AssetPlugin::default(), TransformPlugin, PickingPlugin, InteractionPlugin));
        app.add_plugins(BevySplatPlugins.build().disable::<SplatRenderPlugin>());
        app.init_resource::<ButtonInput<KeyCode>>();
        // Pointer events go from children to parents only where the world knows windows.
        app.world_mut().register_component::<Window>();
        app.finish();
        app.cleanup();
        let target = RenderTarget::Image(ImageRenderTarget::from(Handle::<Image>::default()));
        app.world_mut().spawn(PointerId::Mouse);
        let mut stage = Self { app, capture: Entity::PLACEHOLDER, camera: Entity::PLACEHOLDER, target };
        stage.capture = stage.splats(UPRIGHT);
        let view = &ROOM.views[CAMERA];
        stage.camera = stage.eye(SplatCameras::transform(view, &UPRIGHT), ());
        stage.app.update();
        stage
    }

    /// Another entity that shows the room.
    pub(crate) fn splats(&mut self, place: Transform) -> Entity {
        let cloud = SplatCloud::new(ROOM.cloud.clone());
        let handle = self.app.world_mut().resource_mut::<Assets<SplatCloud>>().add(cloud);
        // There is nothing in this app that works out what is visible.
        self.app.world_mut().spawn((Splats(handle), place, InheritedVisibility::VISIBLE)).id()
    }

    /// A camera whose target has [`SIZE`] pixels.
    pub(crate) fn eye(&mut self, place: Transform, more: impl Bundle) -> Entity {
        let projection = SplatCameras::projection(&ROOM.views[CAMERA]);
        let info = RenderTargetInfo { physical_size: SIZE, scale_factor: 1.0 };
        let camera = Camera {
            computed: ComputedCameraValues {
                clip_from_view: projection.get_clip_from_view(),
                target_info: Some(info),
                ..default()
            },
            ..default()
        };
        let bundle = (Camera3d::default(), camera, Projection::from(projection), self.target.clone(), place);
        self.app.world_mut().spawn(bundle).insert(more).id()
    }

    /// What the camera sees.
    pub(crate) fn view(&self) -> View {
        let entity = self.app.world().entity(self.camera);
        view_from_camera(entity.get().unwrap(), entity.get().unwrap()).unwrap()
    }

    /// The capture alone, as the rasteriser sees it.
    pub(crate) fn scene(&self) -> Scene {
        Scene { instances: vec![instance(UPRIGHT)] }
    }

    /// Sends pointer input and runs a frame.
    pub(crate) fn pointer(&mut self, pointer: PointerId, at: Vec2, action: PointerAction) {
        let target = self.target.normalize(None).unwrap();
        let location = Location { target, position: at };
        self.app.world_mut().write_message(PointerInput::new(pointer, location, action));
        self.app.update();
    }

    /// Moves the mouse.
    pub(crate) fn point(&mut self, at: Vec2) {
        self.pointer(PointerId::Mouse, at, PointerAction::Move { delta: Vec2::ONE });
    }

    /// Moves the mouse there and clicks.
    pub(crate) fn click(&mut self, at: Vec2) {
        self.point(at);
        self.pointer(PointerId::Mouse, at, PointerAction::Press(PointerButton::Primary));
        self.pointer(PointerId::Mouse, at, PointerAction::Release(PointerButton::Primary));
    }

    /// Presses at the first point, moves over the others, releases at the last.
    pub(crate) fn drag(&mut self, pointer: PointerId, points: &[Vec2]) {
        self.pointer(pointer, points[0], PointerAction::Press(PointerButton::Primary));
        for &at in &points[1..] {
            self.pointer(pointer, at, PointerAction::Move { delta: Vec2::ONE });
        }
        self.pointer(pointer, points[points.len() - 1], PointerAction::Release(PointerButton::Primary));
    }

    /// The hit that the last frame sent, if any.
    pub(crate) fn hit(&self) -> Option<(Entity, SplatHit, bevy::picking::backend::HitData)> {
        let sent = self.all::<PointerHits>();
        let (entity, data) = sent.last()?.picks.first()?.clone();
        Some((entity, *data.extra_as::<SplatHit>()?, data))
    }

    /// Forgets messages of earlier frames.
    pub(crate) fn forget<M: Message>(&mut self) {
        self.app.world_mut().resource_mut::<Messages<M>>().clear();
    }

    /// Messages of the last two frames.
    pub(crate) fn all<M: Message + Clone>(&self) -> Vec<M> {
        let messages = self.app.world().resource::<Messages<M>>();
        messages.get_cursor().read(messages).cloned().collect()
    }

    /// Runs frames until `done`; fails after two minutes, which only what hangs takes.
    pub(crate) fn until(&mut self, mut done: impl FnMut(&mut Self) -> bool) {
        let start = Instant::now();
        while !done(self) {
            assert!(start.elapsed() < Duration::from_secs(120), "it never came");
            self.app.update();
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Runs frames until every cloud has its index.
    pub(crate) fn until_indexed(&mut self) {
        self.until(|stage| {
            let indices = stage.app.world().resource::<SplatPickIndices>();
            indices.count() > 0 && indices.count() == indices.ready_count()
        });
    }

    /// What is selected of the capture.
    pub(crate) fn selection(&self) -> Selection {
        let selection = self.app.world().get::<SplatSelection>(self.capture);
        selection.map_or(Selection::none(ROOM.cloud.len()), |selection| selection.0.clone())
    }

    /// Asks for a selection of the capture and runs a frame.
    pub(crate) fn select(&mut self, mode: SelectMode, by: SelectBy) {
        let entity = self.capture;
        self.app.world_mut().write_message(SelectRequest { entity, mode, by });
        self.app.update();
    }
}

/// The room at a place.
pub(crate) fn instance(place: Transform) -> Instance {
    let transform = Similarity { rotation: place.rotation, scale: place.scale.x, translation: place.translation };
    Instance { transform, ..Instance::new(ROOM.cloud.clone()) }
}
