//! [`Scene`]: the instances that are drawn together.

use std::sync::Arc;

use splat_core::{Cloud, Selection, Similarity};

/// A cloud placed in a scene.
#[derive(Clone, Debug)]
pub struct Instance {
    /// The Gaussians.
    pub cloud: Arc<Cloud>,
    /// From the cloud's space to the scene's.
    pub transform: Similarity,
    /// Gaussians that are not drawn, if any; as long as the cloud.
    pub hidden: Option<Arc<Selection>>,
}

impl Instance {
    /// The cloud where it is, nothing hidden.
    pub fn new(cloud: Arc<Cloud>) -> Self {
        Self { cloud, transform: Similarity::IDENTITY, hidden: None }
    }
}

/// An ordered list of instances, drawn with one depth order over all of them.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// The instances; scene-wide ids count through them in order.
    pub instances: Vec<Instance>,
}

impl Scene {
    /// A scene of one cloud.
    pub fn of(cloud: Arc<Cloud>) -> Self {
        Self { instances: vec![Instance::new(cloud)] }
    }

    /// A scene of one cloud of which only `shown` is drawn.
    pub fn of_selected(cloud: Arc<Cloud>, shown: &Selection) -> Self {
        let mut hidden = shown.clone();
        hidden.invert();
        Self { instances: vec![Instance { hidden: Some(Arc::new(hidden)), ..Instance::new(cloud) }] }
    }

    /// Gaussians of all instances, hidden ones included.
    pub fn len(&self) -> usize {
        self.instances.iter().map(|i| i.cloud.len()).sum()
    }

    /// Whether there is nothing to draw.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Scene-wide id of the first Gaussian of an instance.
    pub fn offset(&self, instance: usize) -> usize {
        self.instances[..instance].iter().map(|i| i.cloud.len()).sum()
    }
}
