//! How good a method is: prompts of a labelled capture in, scores against its labels out.
//!
//! A [`BenchScene`] is a capture with a label per Gaussian, the blending weight of every Gaussian over all its cameras,
//! held-back views with label maps, and prompts (clicks, boxes, masks). [`evaluate`] asks an [`EvalMethod`] with one
//! [`PromptMode`] for every prompt and scores the answers; with a number of clicks, a scripted user corrects them. Scores
//! are in `metrics`, the user's rule in `user`. Nothing here opens a file.

mod answer;
mod bench;
mod metrics;
mod score;
mod user;

pub use bench::{BenchScene, Correction, LabelMap, Prompt, PromptKind};
pub use metrics::{IGNORE, SelectionIou, VISIBLE_WEIGHT, boundary_iou, mask_iou, selection_iou};
pub use score::{ClickScore, EvalMethod, EvalSettings, ObjectScore, PromptMode, evaluate};
pub use user::{ScriptedClick, next_click};
