//! Clouds made of others: parts of one, several joined, harmonics cut off or filled up.

use std::borrow::Cow;

use super::{Cloud, CloudArrays, CloudError, ExtraProperty, ExtraValues};
use crate::{Selection, sh};

impl ExtraValues {
    /// Adds the values of another property of the same type behind; nothing changes if it holds another.
    fn append(&mut self, other: &Self) {
        macro_rules! same {
            ($($kind:ident),*) => {
                match (self, other) {
                    $((Self::$kind(a), Self::$kind(b)) => a.extend_from_slice(b),)*
                    _ => {}
                }
            };
        }
        same!(I8, U8, I16, U16, I32, U32, F32, F64);
    }

    fn same_type(&self, other: &Self) -> bool {
        std::mem::discriminant(self) == std::mem::discriminant(other)
    }
}

impl Cloud {
    /// The selected Gaussians as a cloud of their own, in order, extras included.
    ///
    /// # Panics
    /// If the selection belongs to a cloud of another length.
    pub fn extract(&self, selection: &Selection) -> Cloud {
        assert_eq!(selection.len(), self.len(), "a selection of another cloud");
        self.pick(&selection.ids())
    }

    /// The cloud without the selected Gaussians.
    ///
    /// # Panics
    /// If the selection belongs to a cloud of another length.
    pub fn without(&self, selection: &Selection) -> Cloud {
        let mut rest = selection.clone();
        rest.invert();
        self.extract(&rest)
    }

    /// The cloud with spherical harmonics of another degree: higher bands are cut off, missing ones are zero.
    ///
    /// # Errors
    /// [`CloudError::Degree`] if `degree` is above [`sh::MAX_DEGREE`].
    pub fn with_sh_degree(&self, degree: u8) -> Result<Cloud, CloudError> {
        if degree > sh::MAX_DEGREE {
            return Err(CloudError::Degree(degree));
        }
        let a = &self.arrays;
        let mut source = a.source.clone();
        if degree != a.sh_degree {
            // What a writer kept of the file no longer describes the cloud.
            source.layout = None;
        }
        Ok(Cloud {
            arrays: CloudArrays {
                means: a.means.clone(),
                log_scales: a.log_scales.clone(),
                rotations: a.rotations.clone(),
                opacity_logits: a.opacity_logits.clone(),
                sh_degree: degree,
                sh: self.sh_in_degree(degree).into_owned(),
                extras: a.extras.clone(),
                source,
            },
        })
    }

    /// All Gaussians of the clouds, one cloud after the other: Gaussian i of the k-th has the id i plus the lengths of those before.
    ///
    /// Harmonics get the highest degree among the clouds that have Gaussians. Extra properties stay where all of those have them with
    /// the same type. The source is that of the first of them, without its file's layout.
    ///
    /// # Errors
    /// [`CloudError::TooMany`] if ids would not fit 32 bits.
    pub fn concat(clouds: &[&Cloud]) -> Result<Cloud, CloudError> {
        let clouds: Vec<&Cloud> = clouds.iter().copied().filter(|c| !c.is_empty()).collect();
        let Some((first, others)) = clouds.split_first() else {
            return Ok(Cloud::default());
        };
        let count: usize = clouds.iter().map(|c| c.len()).sum();
        if u32::try_from(count).is_err() {
            return Err(CloudError::TooMany(count));
        }
        let sh_degree = clouds.iter().map(|c| c.sh_degree()).max().unwrap_or(0);
        let everywhere = |extra: &&ExtraProperty| {
            let has = |c: &&Cloud| c.extras().iter().any(|e| e.name == extra.name && e.values.same_type(&extra.values));
            others.iter().all(has)
        };
        let mut arrays = CloudArrays { sh_degree, source: first.source().clone(), ..CloudArrays::default() };
        arrays.source.layout = None;
        arrays.extras = first.extras().iter().filter(everywhere).cloned().collect();
        arrays.sh.reserve_exact(count * 3 * sh::coefficient_count(sh_degree));
        for (k, cloud) in clouds.iter().enumerate() {
            let a = &cloud.arrays;
            arrays.means.extend_from_slice(&a.means);
            arrays.log_scales.extend_from_slice(&a.log_scales);
            arrays.rotations.extend_from_slice(&a.rotations);
            arrays.opacity_logits.extend_from_slice(&a.opacity_logits);
            arrays.sh.extend_from_slice(&cloud.sh_in_degree(sh_degree));
            for extra in arrays.extras.iter_mut().filter(|_| k > 0) {
                let same = |e: &&ExtraProperty| e.name == extra.name && e.values.same_type(&extra.values);
                if let Some(same) = a.extras.iter().find(same) {
                    extra.values.append(&same.values);
                }
            }
        }
        Cloud::new(arrays)
    }

    fn sh_in_degree(&self, degree: u8) -> Cow<'_, [f32]> {
        let (from, to) = (self.sh_stride(), 3 * sh::coefficient_count(degree));
        if from == to {
            return Cow::Borrowed(self.sh());
        }
        let mut out = vec![0.0; self.len() * to];
        let both = from.min(to);
        for (new, old) in out.chunks_exact_mut(to).zip(self.sh().chunks_exact(from)) {
            new[..both].copy_from_slice(&old[..both]);
        }
        Cow::Owned(out)
    }
}

#[cfg(test)]
mod tests {
    use glam::{Quat, Vec3};

    use super::*;

    fn cloud(n: usize, degree: u8, extras: &[(&str, ExtraValues)]) -> Cloud {
        let stride = 3 * sh::coefficient_count(degree);
        let extra =
            |(name, values): &(&str, ExtraValues)| ExtraProperty { name: (*name).to_owned(), values: values.clone() };
        Cloud::new(CloudArrays {
            means: (0..n).map(|i| Vec3::splat(i as f32 + f32::from(degree))).collect(),
            log_scales: vec![Vec3::X; n],
            rotations: vec![Quat::IDENTITY; n],
            opacity_logits: (0..n).map(|i| i as f32).collect(),
            sh_degree: degree,
            sh: (0..n * stride).map(|k| k as f32 + 1.0).collect(),
            extras: extras.iter().map(extra).collect(),
            ..CloudArrays::default()
        })
        .unwrap()
    }

    #[test]
    fn what_is_extracted_and_the_rest_are_the_whole() {
        let c = cloud(9, 1, &[("label", ExtraValues::U8((0..9).collect()))]);
        let s = Selection::from_ids(9, [0, 3, 8]);
        let (part, rest) = (c.extract(&s), c.without(&s));
        assert_eq!((part.len(), rest.len()), (3, 6));
        for (k, i) in s.iter().enumerate() {
            assert_eq!((part.means()[k], part.sh_of(k)), (c.means()[i], c.sh_of(i)));
        }
        assert_eq!(part.extras()[0].values, ExtraValues::U8(vec![0, 3, 8]));
        assert_eq!(rest.extras()[0].values, ExtraValues::U8(vec![1, 2, 4, 5, 6, 7]));
        assert!(c.extract(&Selection::none(9)).is_empty());
        assert_eq!(c.extract(&Selection::all(9)), c);
    }

    #[test]
    fn joined_clouds_come_one_after_the_other() {
        let f = |n| ExtraValues::F32(vec![0.5; n]);
        let a = cloud(3, 0, &[("filter", f(3)), ("label", ExtraValues::U8(vec![1; 3])), ("only_a", f(3))]);
        let b = cloud(2, 2, &[("label", ExtraValues::I32(vec![2; 2])), ("filter", f(2))]);
        let none = cloud(0, 4, &[]);
        let joined = Cloud::concat(&[&none, &a, &b, &none, &a]).unwrap();
        assert_eq!((joined.len(), joined.sh_degree()), (8, 2));
        let names: Vec<&str> = joined.extras().iter().map(|e| e.name.as_str()).collect();
        assert_eq!(names, ["filter"], "labels differ in type");
        assert_eq!(joined.extras()[0].values, f(8));
        assert_eq!(joined.means()[3..5], *b.means());
        assert_eq!(joined.sh_of(4), b.sh_of(1));
        assert_eq!(joined.sh_of(7)[..3], *a.sh_of(2));
        assert!(joined.sh_of(7)[3..].iter().all(|&c| c == 0.0));
        assert_eq!(Cloud::concat(&[]).unwrap(), Cloud::default());
        assert_eq!(Cloud::concat(&[&a]).unwrap(), a);
    }

    #[test]
    fn degrees_are_cut_off_and_filled_up() {
        let c = cloud(4, 2, &[]);
        let low = c.with_sh_degree(1).unwrap();
        let high = c.with_sh_degree(4).unwrap();
        for i in 0..4 {
            assert_eq!(low.sh_of(i), &c.sh_of(i)[..12]);
            assert_eq!(high.sh_of(i)[..27], *c.sh_of(i));
            assert!(high.sh_of(i)[27..].iter().all(|&v| v == 0.0));
        }
        assert_eq!(c.with_sh_degree(2).unwrap(), c);
        assert_eq!(high.with_sh_degree(2).unwrap(), c);
        assert_eq!(c.with_sh_degree(5), Err(CloudError::Degree(5)));
    }
}
