//! Tools that turn pointer input into selections.
