use std::path::Path;
use std::sync::Arc;

use bevy::camera::{CameraProjection, ComputedCameraValues, RenderTargetInfo};
use splat_raster::Scene;
use splat_raster::cpu::CpuRasterizer;
use splat_segment::Run;
use splat_segment::graph::look::Look;
use splat_segment::graph::prepared::Prepared;

use super::*;
use crate::asset::SplatCameras;
use crate::select::SplatSelectPlugin;
use crate::testing::update_until;
use crate::{SplatCloud, SplatFlags, SplatSelection, Splats, UPRIGHT};

/// The camera that looks at the bear on the rug, and a pixel of the bear.
const CAMERA: usize = 27;
const BEAR: Vec2 = Vec2::new(434.5, 408.5);

struct Room {
    app: App,
    entity: Entity,
    camera: Entity,
    views: Vec<View>,
    cloud: Arc<splat_core::Cloud>,
}

fn room() -> Room {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/room");
    let cloud = Arc::new(splat_io::read(folder.join("scene.spz")).unwrap().0);
    let named = splat_io::cameras::read(folder.join("cameras.json")).unwrap().views;
    let views: Vec<View> = named.into_iter().map(|v| v.view).collect();
    let mut app = App::new();
    let plugins = (MinimalPlugins, AssetPlugin::default(), TransformPlugin, crate::asset::SplatAssetPlugin);
    app.add_plugins(plugins).add_plugins((SplatSelectPlugin, SplatSegmentPlugin));
    let handle = app.world_mut().resource_mut::<Assets<SplatCloud>>().add(SplatCloud::new(cloud.clone()));
    let entity = app.world_mut().spawn((Splats(handle), SegmentViews(views.clone()))).id();
    let view = &views[CAMERA];
    let projection = SplatCameras::projection(view);
    let camera = Camera {
        computed: ComputedCameraValues {
            clip_from_view: projection.get_clip_from_view(),
            target_info: Some(RenderTargetInfo {
                physical_size: UVec2::new(view.width, view.height),
                scale_factor: 1.0,
            }),
            ..default()
        },
        ..default()
    };
    let camera = app.world_mut().spawn((camera, SplatCameras::transform(view, &UPRIGHT))).id();
    app.update();
    Room { app, entity, camera, views, cloud }
}

/// All messages of a kind that were written and not yet dropped.
fn take<M: Message>(app: &mut App) -> Vec<M> {
    app.world_mut().resource_mut::<Messages<M>>().drain().collect()
}

impl Room {
    fn request(&mut self, request: SegmentRequest) -> Result<SegmentDone, String> {
        self.app.world_mut().write_message(request);
        self.finish()
    }

    fn finish(&mut self) -> Result<SegmentDone, String> {
        let mut answer = None;
        update_until(&mut self.app, |app| {
            answer = (take::<SegmentDone>(app).pop().map(Ok))
                .or_else(|| take::<SegmentFailed>(app).pop().map(|failed| Err(failed.reason)));
            answer.is_some()
        });
        answer.unwrap()
    }

    fn selected(&self) -> Selection {
        self.app.world().get::<SplatSelection>(self.entity).map(|s| s.0.clone()).unwrap_or_default()
    }
}

/// The same without Bevy.
fn by_hand(room: &Room) -> Selection {
    let (scene, mut raster) = (Scene::of(room.cloud.clone()), CpuRasterizer::new());
    let prepared = Prepared::new(&scene, &room.views, &mut raster, &Run::new()).unwrap();
    let look = Look::draw(&prepared, &scene, &room.views[CAMERA], &mut raster).unwrap();
    let patch = prepared.graph.of[look.gaussian(BEAR).unwrap() as usize];
    let found = prepared.hypotheses(&look, patch, BEAR);
    prepared.gaussians(&found.ranked[found.proposals[0]].patches)
}

#[test]
fn one_click_takes_the_object_that_the_program_takes_and_further_clicks_correct_it() {
    let mut room = room();
    let (entity, camera) = (room.entity, room.camera);
    let done = room.request(SegmentRequest::click(entity, camera, BEAR)).unwrap();
    let same = by_hand(&room);
    assert!(done.selection.jaccard(&same) > 0.99, "{} of {}", done.selection.count(), same.count());
    assert_eq!(room.selected(), done.selection);
    assert!(!done.proposals.is_empty() && done.steps.len() > 2);
    let reported = take::<SegmentProgress>(&mut room.app);
    assert!(reported.iter().all(|p| p.entity == entity && (0.0..=1.0).contains(&p.fraction)));

    // A positive click beside the object adds what is there; the first answer is kept below it.
    let rug = Vec2::new(300.0, 520.0);
    let more = room.request(SegmentRequest::correct(entity, camera, SegmentPrompt::Click(rug))).unwrap();
    assert!(more.selection.count() > done.selection.count());
    assert_eq!(room.selected(), more.selection);
    assert!(more.proposals.is_empty());

    // Locked Gaussians stay out, and a mode combines with what was there.
    let mut locked = Selection::none(room.cloud.len());
    done.selection.iter().step_by(2).for_each(|i| locked.insert(i));
    room.app.world_mut().entity_mut(entity).insert((
        SplatFlags { locked: locked.clone(), ..default() },
        SplatSelection(Selection::from_ids(room.cloud.len(), [0])),
    ));
    let mode = SelectMode::Add;
    let half = room.request(SegmentRequest { mode, ..SegmentRequest::click(entity, camera, BEAR) }).unwrap();
    assert!(half.selection.count() > 0 && half.selection.iter().all(|i| !locked.contains(i)));
    assert_eq!(room.selected().count(), half.selection.count() + usize::from(!half.selection.contains(0)));
}

#[test]
fn what_cannot_be_answered_is_told_and_changes_nothing() {
    let mut room = room();
    let (entity, camera) = (room.entity, room.camera);
    let click = SegmentRequest::click(entity, camera, BEAR);
    let says = |room: &mut Room, request: SegmentRequest| room.request(request).unwrap_err();
    let none = SegmentRequest { prompts: Vec::new(), ..click.clone() };
    assert_eq!(says(&mut room, none), "the request has no prompts; point at something");
    let negative = SegmentRequest { prompts: vec![SegmentPrompt::Negative(BEAR)], ..click.clone() };
    assert_eq!(says(&mut room, negative), "a negative click takes away from an object; point at one first");
    let outside = SegmentRequest::click(entity, camera, Vec2::new(-4.0, 1.0));
    assert_eq!(says(&mut room, outside), "the prompt at -4, 1 lies outside the camera's 800x600 pixels");
    let nowhere = SegmentRequest { camera: entity, ..click.clone() };
    assert_eq!(says(&mut room, nowhere), "the request's camera is gone, has no size yet, or draws no splats");
    let nobody = SegmentRequest { entity: camera, ..click.clone() };
    assert!(says(&mut room, nobody).starts_with("the entity shows no capture"));
    assert!(room.selected().is_empty());

    // Cancelled while it runs, and while it waits.
    for request in [click.clone(), click.clone()] {
        room.app.world_mut().write_message(request);
    }
    room.app.update();
    assert_eq!(room.app.world().resource::<SegmentQueue>().len(), 2);
    room.app.world_mut().write_message(SegmentCancel { entity });
    room.app.update();
    let failed = take::<SegmentFailed>(&mut room.app);
    assert_eq!(failed.len(), 2);
    assert!(failed.iter().all(|f| f.reason == "stopped on request; nothing was changed"));
    assert!(room.app.world().resource::<SegmentQueue>().is_empty() && room.selected().is_empty());

    // Despawned while it runs.
    room.app.world_mut().write_message(click);
    room.app.update();
    room.app.world_mut().despawn(entity);
    assert_eq!(room.finish().unwrap_err(), "the capture was despawned or changed meanwhile; nothing was changed");
}
