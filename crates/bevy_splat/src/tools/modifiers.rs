//! What the keyboard has to say about tools. An app without one sets [`ToolMode`] itself.

use bevy::prelude::*;
use splat_core::SelectMode;

use super::{CancelGesture, ToolMode};

const SHIFT: [KeyCode; 2] = [KeyCode::ShiftLeft, KeyCode::ShiftRight];
const CTRL: [KeyCode; 2] = [KeyCode::ControlLeft, KeyCode::ControlRight];

/// Shift adds, Ctrl subtracts, both intersect; without either the mode is as it was set.
pub(super) fn set_mode(
    keys: Option<Res<ButtonInput<KeyCode>>>,
    mut mode: ResMut<ToolMode>,
    mut before: Local<Option<SelectMode>>,
) {
    let Some(keys) = keys else { return };
    let held = match (keys.any_pressed(SHIFT), keys.any_pressed(CTRL)) {
        (true, false) => Some(SelectMode::Add),
        (false, true) => Some(SelectMode::Subtract),
        (true, true) => Some(SelectMode::Intersect),
        (false, false) => None,
    };
    let wanted = match held {
        Some(held) => {
            before.get_or_insert(mode.0);
            held
        }
        None => before.take().unwrap_or(mode.0),
    };
    mode.set_if_neq(ToolMode(wanted));
}

/// Escape ends a gesture without a selection.
pub(super) fn cancel(keys: Option<Res<ButtonInput<KeyCode>>>, mut cancels: MessageWriter<CancelGesture>) {
    if keys.is_some_and(|keys| keys.just_pressed(KeyCode::Escape)) {
        cancels.write(CancelGesture);
    }
}
