//! [`Places`]: points of a capture, as users name them.

use splat_core::Cloud;
use splat_core::glam::Vec3;

use crate::failure::Failure;
use crate::parse;
use crate::terminal::gaussians;

/// `X,Y,Z;X,Y,Z` or `ID,ID`: points by their coordinates, or the centres of Gaussians.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Places {
    /// In scene units.
    Coordinates(Vec<Vec3>),
    /// Ids of Gaussians.
    Ids(Vec<u32>),
}

/// Two places.
pub(crate) fn two(text: &str) -> Result<Places, String> {
    places(text, 2)
}

/// Three places.
pub(crate) fn three(text: &str) -> Result<Places, String> {
    places(text, 3)
}

fn places(text: &str, count: usize) -> Result<Places, String> {
    let wrong = |found: usize| {
        let example = ["X,Y,Z"; 3][..count].join(";");
        let ids = ["ID"; 3][..count].join(",");
        format!("{count} points were expected, {found} were given: {example}, or {ids} for Gaussians")
    };
    if text.contains(';') {
        let points: Vec<Vec3> = text.split(';').map(parse::vec3).collect::<Result<_, _>>()?;
        return if points.len() == count { Ok(Places::Coordinates(points)) } else { Err(wrong(points.len())) };
    }
    let id = |word: &str| word.trim().parse().map_err(|_| format!("`{word}` is no id of a Gaussian (0, 1, 2 ..)"));
    let ids: Vec<u32> = text.split(',').map(id).collect::<Result<_, String>>()?;
    if ids.len() == count { Ok(Places::Ids(ids)) } else { Err(wrong(ids.len())) }
}

impl Places {
    /// Where they are, in scene units.
    ///
    /// # Errors
    /// [`Failure::Usage`] for ids that the capture does not have, [`Failure::Failed`] for those of damaged Gaussians.
    pub(crate) fn in_cloud(&self, cloud: &Cloud) -> Result<Vec<Vec3>, Failure> {
        let center = |&id: &u32| match cloud.means().get(id as usize) {
            None if cloud.is_empty() => Err(Failure::failed("the capture is empty: it has no Gaussian to name")),
            None => Err(Failure::usage(format!(
                "there is no Gaussian {id}; the capture has {}, ids 0 to {}",
                gaussians(cloud.len()),
                cloud.len() - 1
            ))),
            Some(mean) if !mean.is_finite() => {
                Err(Failure::failed(format!("Gaussian {id} has no finite centre; name another")))
            }
            Some(mean) => Ok(*mean),
        };
        match self {
            Self::Coordinates(points) => Ok(points.clone()),
            Self::Ids(ids) => ids.iter().map(center).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_coordinates_or_ids() {
        assert_eq!(two("1,2,3; 4,5,-6"), Ok(Places::Coordinates(vec![Vec3::new(1., 2., 3.), Vec3::new(4., 5., -6.)])));
        assert_eq!(three("7, 8,9"), Ok(Places::Ids(vec![7, 8, 9])));
        for bad in ["", "1", "1,2,3", "1,2,3;4,5", "1,2,3;4,5,6;7,8,9", "-1,2", "a,b", "nan,0,0;1,1,1"] {
            assert!(two(bad).is_err(), "{bad}");
        }
    }
}
