//! [`SplatTool`] and the table of those there are.

use bevy::prelude::*;

use super::ToolSettings;
use crate::select::Shape2d;

/// From the way of a pointer to a shape.
pub trait SplatTool: Send + Sync + 'static {
    /// What it is called, in [`ActiveTool`](super::ActiveTool) and in menus; one word.
    fn name(&self) -> &'static str;

    /// The shape that a gesture means, also while it is still going on.
    ///
    /// `points`: where the pointer was, from the press on, in physical pixels of the camera's viewport; may lie outside of it.
    /// `None`: nothing yet, such as after a press without a move. A gesture that ends so selects nothing.
    fn shape(&self, points: &[Vec2], settings: &ToolSettings) -> Option<Shape2d>;
}

/// The tools there are, in the order they were added.
#[derive(Resource, Default)]
pub struct SplatToolTable {
    tools: Vec<Box<dyn SplatTool>>,
}

impl SplatToolTable {
    /// A tool by its name.
    pub fn get(&self, name: &str) -> Option<&dyn SplatTool> {
        self.tools.iter().find(|tool| tool.name() == name).map(|tool| &**tool)
    }

    /// All names, for a menu.
    pub fn names(&self) -> Vec<&'static str> {
        self.tools.iter().map(|tool| tool.name()).collect()
    }

    fn add(&mut self, tool: Box<dyn SplatTool>) {
        match self.tools.iter_mut().find(|known| known.name() == tool.name()) {
            Some(known) => *known = tool,
            None => self.tools.push(tool),
        }
    }
}

/// Adds tools to an [`App`].
pub trait AddSplatTool {
    /// Adds a tool; one of the same name is replaced.
    fn add_tool<T: SplatTool + Default>(&mut self) -> &mut Self;
}

impl AddSplatTool for App {
    fn add_tool<T: SplatTool + Default>(&mut self) -> &mut Self {
        self.init_resource::<SplatToolTable>();
        self.world_mut().resource_mut::<SplatToolTable>().add(Box::new(T::default()));
        self
    }
}
