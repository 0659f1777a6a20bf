//! How large a unit of a capture is: [`Source::metres_per_unit`].

use crate::Source;

/// The first word of the comment that tells it.
const WORD: &str = "metres_per_unit";

impl Source {
    /// Metres per scene unit, where a comment says so (`metres_per_unit 0.42`; the last one counts); finite and above 0.
    pub fn metres_per_unit(&self) -> Option<f64> {
        self.comments.iter().rev().find_map(|comment| value(comment)).filter(|m| m.is_finite() && *m > 0.0)
    }

    /// Says how large a unit is, in place of what was said before; `None`: nobody knows.
    pub fn set_metres_per_unit(&mut self, metres: Option<f64>) {
        self.comments.retain(|comment| value(comment).is_none());
        self.comments.extend(metres.map(|m| format!("{WORD} {m}")));
    }
}

fn value(comment: &str) -> Option<f64> {
    let rest = comment.trim().strip_prefix(WORD)?;
    rest.trim_start_matches([':', '=', ' ', '\t']).trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Cloud, CloudArrays, Similarity};

    #[test]
    fn the_last_comment_that_is_a_scale_counts_and_is_replaced() {
        let comments = ["made by hand", "metres_per_unit 2", "metres_per_unit: 0.5", "metres_per_unit soon"];
        let mut source = Source { comments: comments.map(str::to_owned).to_vec(), ..Source::default() };
        assert_eq!(source.metres_per_unit(), Some(0.5));
        source.set_metres_per_unit(Some(0.1 + 0.2));
        assert_eq!(source.metres_per_unit(), Some(0.1 + 0.2));
        assert_eq!(source.comments.len(), 3);
        source.set_metres_per_unit(None);
        assert_eq!((source.metres_per_unit(), source.comments.len()), (None, 2));
        for none in ["metres_per_unit -1", "metres_per_unit nan", "metres_per_unit 0", "metres_per_unit inf"] {
            let source = Source { comments: vec![none.to_owned()], ..Source::default() };
            assert_eq!(source.metres_per_unit(), None, "{none}");
        }
    }

    #[test]
    fn a_scaled_cloud_keeps_its_size_in_metres() {
        let mut arrays = CloudArrays::default();
        arrays.source.set_metres_per_unit(Some(3.0));
        let cloud = Cloud::new(arrays).unwrap();
        let larger = cloud.transformed(&Similarity { scale: 4.0, ..Similarity::IDENTITY });
        assert_eq!(larger.source().metres_per_unit(), Some(0.75));
    }
}
