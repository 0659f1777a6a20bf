//! Everything a scene with captures names: `use bevy_splat::prelude::*`.

pub use crate::asset::{SplatAssetPlugin, SplatCameras, SplatCloudSaver, SplatCloudSettings};
pub use crate::components::SplatHighlightPlugin;
pub use crate::orient::{OrientBy, OrientError, OrientFailed, OrientRequest, Oriented, SplatOrientPlugin};
#[cfg(feature = "physics")]
pub use crate::orient::{ScaleBy, ScaleRequest, Scaled};
pub use crate::parts::{PartExtracted, PartRestored, PartsLookup, SplatPartsPlugin};
#[cfg(feature = "physics")]
pub use crate::physics::elastic::{
    ElasticContact, ElasticDrag, ElasticExploded, ElasticGrab, ElasticGround, ElasticPush, ElasticSlept, ElasticState,
    ElasticWoke, SkinningBasis,
};
#[cfg(feature = "physics")]
pub use crate::physics::{
    CaptureGround, CaptureScale, ElasticPart, GroundFill, GroundKind, PartBody, PartMaterial, PartMaterials,
    PartPhysicsError, PartPhysicsFailed, PartPhysicsReady, PartPhysicsReport, PartPhysicsStatus, PartPhysicsWarning,
    PhysicsMaterial, Pin, PinRegion, ScaleSource, SplatPhysicsPlugin, SplatPhysicsSystems, StaticCapture,
    StaticCaptureCache,
};
#[cfg(feature = "avian")]
pub use crate::physics::{RigidPart, RigidShape, SplatAvianPlugin};
pub use crate::picking::{SplatHit, SplatPartHandle, SplatPickingPlugin};
pub use crate::render::{
    SplatBackend, SplatBackground, SplatCamera, SplatDepth, SplatOrder, SplatOutline, SplatRenderPlugin,
    SplatRenderStats, view_from_camera, view_pixel,
};
pub use crate::segment::{
    SegmentCancel, SegmentDone, SegmentFailed, SegmentProgress, SegmentPrompt, SegmentRequest, SegmentStart,
    SegmentViews, SplatSegmentPlugin,
};
pub use crate::select::{
    Criterion, Likeness, MakePart, PartMade, SelectBy, SelectFailed, SelectRequest, SelectionChanged, Shape2d,
    SplatMakePartCommands, SplatSelectPlugin, SplatSelectSystems,
};
pub use crate::tools::{
    ActiveTool, AddSplatTool, CancelGesture, Gesture, SplatTool, SplatToolTable, SplatToolsPlugin, ToolMode,
    ToolProjection, ToolSettings, ToolTargets,
};
pub use crate::{
    BevySplatPlugins, DefaultSplatHighlight, PartOf, SplatCloud, SplatDeformation, SplatFlags, SplatHighlight,
    SplatPart, SplatPartCommands, SplatParts, SplatSelection, SplatSubset, SplatTint, Splats, UPRIGHT,
};
pub use splat_core::orient::{AxisSign, AxisTarget};
pub use splat_core::{self, Cloud, CloudArrays, Mask2d, PartId, Parts, SelectMode, Selection, glam};
pub use splat_segment::project::{DepthTolerance, Footprint};
