//! Raising a part out of what it stands in: what is left of a capture under an object keeps some of its Gaussians.

/// Steps between standing still and the highest that a part may be raised.
const STEPS: u32 = 8;

/// How a part stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Raise {
    /// How far to raise it, in metres.
    pub(super) height: f64,
    /// How deep it is then still inside of something, in metres.
    pub(super) depth: f64,
}

/// The least height, at most `most`, at which a part is no deeper than `clear` inside of anything; where there is none, the
/// height at which it is least deep. `depth`: how deep it is when raised by so much, 0 or less where it touches nothing.
pub(super) fn raise(most: f64, clear: f64, mut depth: impl FnMut(f64) -> f64) -> Raise {
    let mut best = Raise { height: 0.0, depth: depth(0.0) };
    for step in 1..=STEPS {
        if best.depth <= clear {
            break;
        }
        let height = most * f64::from(step) / f64::from(STEPS);
        let depth = depth(height);
        // To be raised for nothing would be seen.
        if depth < best.depth - 0.5 * (height - best.height) {
            best = Raise { height, depth };
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_is_raised_out_of_the_floor_and_no_further() {
        let floor = |sunk: f64| move |height: f64| sunk - height;
        assert_eq!(raise(0.02, 0.001, floor(-0.1)).height, 0.0);
        let raised = raise(0.02, 0.001, floor(0.008));
        assert!((raised.height - 0.0075).abs() < 1e-12 && raised.depth <= 0.001, "{raised:?}");
        let deep = raise(0.02, 0.001, floor(0.5));
        assert_eq!(deep.height, 0.02);
        assert!((deep.depth - 0.48).abs() < 1e-12);
    }

    #[test]
    fn a_part_inside_a_wall_stays_where_it_is() {
        assert_eq!(raise(0.02, 0.001, |_| 0.1), Raise { height: 0.0, depth: 0.1 });
    }
}
