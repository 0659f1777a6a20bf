//! How good a selection is, against labels: the scores and the prompts of the benchmark layout.
//!
//! A benchmark scene is a capture with a label per Gaussian, the blending weight of every Gaussian over all training
//! cameras, held-back views with label maps, and prompts (clicks, boxes, masks). Nothing here opens a file.

mod metrics;
mod protocol;

pub use metrics::{boundary_iou, intersection_over_union, mask_iou, selection_iou, SelectionIou};
pub use protocol::{
    BenchScene, ClickScore, Correction, EvalMethod, EvalSettings, LabelMap, ObjectScore, Prompt, PromptKind, PromptMode, evaluate,
    mean_score,
};
