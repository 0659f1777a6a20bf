//! [`Scene`]: the instances that are drawn together.

use std::sync::Arc;

use glam::{Mat3, Vec3};
use splat_core::deform::Deformation;
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
    /// The Gaussians that belong to the instance: their ids in the cloud, rising, none twice; all of them where there is
    /// no such list. What an instance costs follows the length of its list, not that of the cloud.
    pub subset: Option<Arc<[u32]>>,
    /// For each Gaussian of the cloud: sRGB red, green, blue, and with what strength (0 to 255) they are mixed over its
    /// colour.
    pub tint: Option<Arc<[[u8; 4]]>>,
    /// How the cloud is bent before it is placed, in its own space: means, covariances and viewing directions follow.
    pub deformation: Option<Arc<Deformation>>,
}

impl Instance {
    /// The cloud where it is and as it is, nothing hidden.
    pub fn new(cloud: Arc<Cloud>) -> Self {
        Self { cloud, transform: Similarity::IDENTITY, hidden: None, subset: None, tint: None, deformation: None }
    }

    /// Gaussians that belong to it, hidden ones included.
    pub fn len(&self) -> usize {
        self.subset.as_ref().map_or(self.cloud.len(), |ids| ids.len())
    }

    /// Whether none does.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Where the mean of Gaussian `gaussian` of the cloud is, in the scene's space: bent, then placed.
    pub fn mean(&self, gaussian: usize) -> Vec3 {
        let mean = self.cloud.means()[gaussian];
        self.transform.apply(self.deformation.as_ref().map_or(mean, |deformation| deformation.at(mean).position))
    }

    /// The covariance of Gaussian `gaussian` of the cloud, in the scene's space: bent, then placed.
    pub fn covariance(&self, gaussian: usize) -> Mat3 {
        let mut linear = Mat3::from_quat(self.transform.rotation) * self.transform.scale;
        if let Some(deformation) = &self.deformation {
            linear *= deformation.at(self.cloud.means()[gaussian]).gradient;
        }
        let m =
            linear * Mat3::from_quat(self.cloud.rotation(gaussian)) * Mat3::from_diagonal(self.cloud.scale(gaussian));
        m * m.transpose()
    }

    /// Id in the cloud of the Gaussian at `position` of the instance; `None` past its end.
    pub fn cloud_id(&self, position: usize) -> Option<u32> {
        match &self.subset {
            Some(ids) => ids.get(position).copied(),
            None => (position < self.cloud.len()).then_some(position as u32),
        }
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
        self.instances.iter().map(Instance::len).sum()
    }

    /// Whether there is nothing to draw.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Scene-wide id of the first Gaussian of an instance.
    pub fn offset(&self, instance: usize) -> usize {
        self.instances[..instance].iter().map(Instance::len).sum()
    }

    /// Which instance a scene-wide id belongs to, and which Gaussian of its cloud it is; `None` past the end.
    pub fn locate(&self, id: u32) -> Option<(usize, u32)> {
        let mut position = id as usize;
        for (k, instance) in self.instances.iter().enumerate() {
            if position < instance.len() {
                return instance.cloud_id(position).map(|gaussian| (k, gaussian));
            }
            position -= instance.len();
        }
        None
    }
}
