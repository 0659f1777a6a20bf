//! The scripted user: where the next click goes.

use splat_core::Mask2d;

use crate::distance::distance_to;
use crate::graph::clicks::ClickKind;

/// A click of the scripted user.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScriptedClick {
    /// Position of its view in the list given.
    pub view: usize,
    /// The pixel.
    pub pixel: [u32; 2],
    /// Positive where the object was missed, negative where something else was taken.
    pub kind: ClickKind,
    /// Pixels of the error region that it points at.
    pub area: usize,
}

/// The deepest pixel of the largest error region over several views; `None` where all is right.
///
/// `views`: the wanted and the current mask of each view, of one size. A region is made of pixels that are wrong in the same
/// way and share sides. Depth is the distance to the nearest pixel outside the region, the picture's outside
/// included. Of equals the first counts: by view, missed before taken, then row by row.
pub fn next_click(views: &[(&Mask2d, &Mask2d)]) -> Option<ScriptedClick> {
    let mut largest: Option<(usize, ClickKind, Vec<usize>)> = None;
    for (v, (wanted, current)) in views.iter().enumerate() {
        for kind in [ClickKind::Positive, ClickKind::Negative] {
            let missed = kind == ClickKind::Positive;
            let pairs = wanted.values().iter().zip(current.values());
            let wrong = pairs.map(|(&w, &c)| {
                let (w, c) = (w >= Mask2d::HALF, c >= Mask2d::HALF);
                if missed { w && !c } else { c && !w }
            });
            let Some(region) = largest_region(wrong.collect(), wanted.width() as usize) else { continue };
            if largest.as_ref().is_none_or(|(.., best)| region.len() > best.len()) {
                largest = Some((v, kind, region));
            }
        }
    }
    let (view, kind, region) = largest?;
    let size = views[view].0;
    let pixel = deepest(&region, size.width(), size.height());
    Some(ScriptedClick { view, pixel, kind, area: region.len() })
}

/// Pixels, rising, of the largest region connected by sides; the first of equals.
fn largest_region(mut open: Vec<bool>, width: usize) -> Option<Vec<usize>> {
    let mut best: Option<Vec<usize>> = None;
    for start in 0..open.len() {
        if !std::mem::take(&mut open[start]) {
            continue;
        }
        let mut region = vec![start];
        let mut next = 0;
        while let Some(&k) = region.get(next) {
            next += 1;
            let x = k % width;
            let sides = [
                (x > 0).then(|| k - 1),
                (x + 1 < width).then(|| k + 1),
                k.checked_sub(width),
                (k + width < open.len()).then(|| k + width),
            ];
            region.extend(sides.into_iter().flatten().filter(|&n| std::mem::take(&mut open[n])));
        }
        if best.as_ref().is_none_or(|b| region.len() > b.len()) {
            best = Some(region);
        }
    }
    if let Some(region) = &mut best {
        region.sort_unstable();
    }
    best
}

/// The pixel of a region that is farthest from what is not in it; the first of equals.
fn deepest(region: &[usize], width: u32, height: u32) -> [u32; 2] {
    // A frame of one pixel stands for the picture's outside.
    let (w, h) = (width + 2, height + 2);
    let at = |k: usize| (k / width as usize + 1) * w as usize + k % width as usize + 1;
    let mut outside = Mask2d::from_fn(w, h, |_, _| true);
    for &k in region {
        outside.values_mut()[at(k)] = 0;
    }
    let distance = distance_to(&outside);
    let mut best = (0.0, 0);
    for &k in region {
        if distance[at(k)] > best.0 {
            best = (distance[at(k)], k);
        }
    }
    [(best.1 % width as usize) as u32, (best.1 / width as usize) as u32]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(rows: &[&str]) -> Mask2d {
        let rows: Vec<&[u8]> = rows.iter().map(|r| r.as_bytes()).collect();
        Mask2d::from_fn(rows[0].len() as u32, rows.len() as u32, |x, y| rows[y as usize][x as usize] == b'#')
    }

    #[test]
    fn nothing_is_clicked_where_all_is_right() {
        let mask = picture(&["##.", "..."]);
        assert_eq!(next_click(&[(&mask, &mask), (&mask, &mask)]), None);
        assert_eq!(next_click(&[]), None);
    }

    #[test]
    fn the_largest_region_of_all_views_is_clicked_in_its_middle() {
        let small = (picture(&["###...", "......", "......"]), picture(&["......", "......", "......"]));
        // Missed on the left and taken on the right touch, but are two regions of 9 and 12.
        let large = (picture(&["###....", "###....", "###...."]), picture(&["...####", "...####", "...####"]));
        let click = next_click(&[(&small.0, &small.1), (&large.0, &large.1)]).unwrap();
        assert_eq!(click, ScriptedClick { view: 1, pixel: [4, 1], kind: ClickKind::Negative, area: 12 });
        let click = next_click(&[(&small.0, &small.1)]).unwrap();
        assert_eq!((click.pixel, click.kind, click.area), ([0, 0], ClickKind::Positive, 3));
    }

    #[test]
    fn corners_do_not_connect() {
        let wanted = picture(&["##..", "##..", "..##", "..#."]);
        assert_eq!(next_click(&[(&wanted, &Mask2d::empty(4, 4))]).unwrap().area, 4);
    }

    #[test]
    fn depth_is_that_of_all_pairs_of_pixels() {
        let mut seed = 3u32;
        for _ in 0..30 {
            let wanted = Mask2d::from_fn(12, 9, |_, _| {
                seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                !(seed >> 16).is_multiple_of(7)
            });
            let click = next_click(&[(&wanted, &Mask2d::empty(12, 9))]).unwrap();
            let region = largest_region(wanted.values().iter().map(|&v| v > 0).collect(), 12).unwrap();
            let depth = |x: i64, y: i64| {
                let inside = |u: i64, v: i64| {
                    (0..12).contains(&u) && (0..9).contains(&v) && region.contains(&((v * 12 + u) as usize))
                };
                let all = (-1..=9).flat_map(|v| (-1..=12).map(move |u| (u, v)));
                all.filter(|&(u, v)| !inside(u, v)).map(|(u, v)| (u - x).pow(2) + (v - y).pow(2)).min().unwrap()
            };
            let deepest = region.iter().map(|&k| depth(k as i64 % 12, k as i64 / 12)).max().unwrap();
            let [x, y] = click.pixel.map(i64::from);
            assert!(region.contains(&((y * 12 + x) as usize)));
            assert_eq!(depth(x, y), deepest);
        }
    }
}
