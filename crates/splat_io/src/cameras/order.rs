//! Natural order of names: `view_2` before `view_10`.

use std::cmp::Ordering;

use super::NamedView;

/// Compares names with runs of digits as numbers; names that differ only in leading zeros by their bytes.
pub fn natural_order(a: &str, b: &str) -> Ordering {
    let (mut left, mut right) = (a.as_bytes(), b.as_bytes());
    loop {
        let (Some(&l), Some(&r)) = (left.first(), right.first()) else {
            return left.len().cmp(&right.len()).then_with(|| a.cmp(b));
        };
        if l.is_ascii_digit() && r.is_ascii_digit() {
            let (x, y) = (digits(&mut left), digits(&mut right));
            // Of numbers without leading zeros the longer one is larger; this holds for any length.
            let order = x.len().cmp(&y.len()).then_with(|| x.cmp(y));
            if order != Ordering::Equal {
                return order;
            }
        } else {
            if l != r {
                return l.cmp(&r);
            }
            (left, right) = (&left[1..], &right[1..]);
        }
    }
}

/// Cuts the digits off the front and gives them without leading zeros.
fn digits<'a>(text: &mut &'a [u8]) -> &'a [u8] {
    let end = text.iter().position(|b| !b.is_ascii_digit()).unwrap_or(text.len());
    let (number, rest) = text.split_at(end);
    *text = rest;
    let zeros = number.iter().take_while(|&&b| b == b'0').count();
    &number[zeros..]
}

/// Sorts views by name in [`natural_order`], equal names by id: the order in which a video or a walk was taken.
pub fn sort_by_name(views: &mut [NamedView]) {
    views.sort_by(|a, b| natural_order(&a.name, &b.name).then(a.id.cmp(&b.id)));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_names_count_as_numbers() {
        let mut names = ["b", "a10", "a2", "a02", "a", "a2b", "a99999999999999999999999", "10", "9", "a2a10", "a2a9"];
        names.sort_by(|a, b| natural_order(a, b));
        assert_eq!(
            names,
            ["9", "10", "a", "a02", "a2", "a2a9", "a2a10", "a2b", "a10", "a99999999999999999999999", "b"]
        );
    }
}
