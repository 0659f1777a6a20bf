//! Searches against the plain comparison of all pairs.

use super::*;

fn points(seed: u64, count: usize) -> Vec<Vec3> {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1u64 << 24) as f32
    };
    (0..count).map(|_| Vec3::new(next(), next(), next().powi(3))).collect()
}

/// The definition: all others by distance, then by id.
fn slowly(points: &[Vec3], p: Vec3, k: usize, but: Option<usize>) -> Vec<(u32, f32)> {
    let mut all: Vec<(f32, u32)> = (0..points.len())
        .filter(|&j| Some(j) != but && points[j].is_finite() && p.is_finite())
        .map(|j| (p.distance_squared(points[j]), j as u32))
        .filter(|(d, _)| d.is_finite())
        .collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    all.truncate(k);
    all.into_iter().map(|(d, j)| (j, d.sqrt())).collect()
}

fn check(points: &[Vec3], k: usize) {
    let fast = Neighbours::build(points, k);
    assert_eq!((fast.len(), fast.k()), (points.len(), k));
    for (i, &p) in points.iter().enumerate() {
        let mut slow = slowly(points, p, k, Some(i));
        slow.resize(k, (NO_NEIGHBOUR, f32::INFINITY));
        let (ids, distances) = fast.of(i);
        let found: Vec<(u32, f32)> = ids.iter().copied().zip(distances.iter().copied()).collect();
        assert_eq!(found, slow, "point {i} of {}", points.len());
    }
    assert_eq!(fast.ids().len(), points.len() * k);
    assert_eq!(fast.distances().len(), points.len() * k);
}

#[test]
fn neighbours_are_those_of_a_full_search() {
    for (seed, count, k) in
        [(1, 2000, 12), (2, 5, 8), (3, 1, 3), (4, 0, 3), (5, 300, 1), (6, 40, 64), (7, 9, 0), (8, 17, 16)]
    {
        check(&points(seed, count), k);
    }
}

#[test]
fn outliers_and_means_that_are_none_do_not_disturb_others() {
    let mut p = points(21, 900);
    p[7] = p[9];
    p[20] = Vec3::splat(1e9);
    p[21] = Vec3::NAN;
    p[22] = Vec3::new(0.0, f32::INFINITY, 0.0);
    p[23] = Vec3::splat(-3e38);
    p[24] = Vec3::splat(3e38);
    p[25] = Vec3::splat(1e-40);
    p[26] = Vec3::splat(-0.0);
    check(&p, 12);
    check(&[Vec3::NAN; 40], 3);
}

#[test]
fn ties_go_to_the_lower_id() {
    // A lattice: every inner point has six neighbours at one distance and twelve at the next.
    let lattice: Vec<Vec3> =
        (0..1000).map(|i: i32| Vec3::new((i % 10) as f32, (i / 10 % 10) as f32, (i / 100) as f32)).collect();
    for k in [1, 4, 12, 20] {
        check(&lattice, k);
    }
    let heaps: Vec<Vec3> = (0..600).map(|i| Vec3::splat((i % 7) as f32)).collect();
    check(&heaps, 12);
    check(&[Vec3::ONE; 500], 12);
}

#[test]
fn many_equal_points_do_not_stall() {
    let mut p = vec![Vec3::ONE; 200_000];
    p[0] = Vec3::ZERO;
    let n = Neighbours::build(&p, 4);
    assert_eq!(n.of(77), (&[1, 2, 3, 4][..], &[0.0; 4][..]));
    assert_eq!(n.of(2).0, [1, 3, 4, 5]);
    assert_eq!(n.of(0).0, [1, 2, 3, 4]);
}

#[test]
fn the_nearest_of_any_place_are_those_of_a_full_search() {
    let mut p = points(31, 700);
    p[5] = Vec3::NAN;
    p[6] = p[8];
    let tree = KdTree::new(&p);
    assert_eq!(tree.len(), 699);
    for q in points(32, 60).into_iter().chain([p[6], Vec3::splat(1e6), Vec3::splat(-4.0), Vec3::NAN]) {
        for k in [0, 1, 7, 699, 2000] {
            assert_eq!(tree.nearest(q, k), slowly(&p, q, k, None), "{q}");
        }
    }
    assert!(KdTree::new(&[]).is_empty());
    assert!(KdTree::new(&[Vec3::NAN]).nearest(Vec3::ZERO, 3).is_empty());
}

#[test]
fn a_ball_holds_what_a_full_search_finds() {
    let p = points(9, 1500);
    let tree = KdTree::new(&p);
    let balls = [
        (Vec3::splat(0.5), 0.2),
        (Vec3::ZERO, 0.0),
        (p[11], 0.0),
        (Vec3::ONE, 9.0),
        (Vec3::ONE, f32::INFINITY),
        (Vec3::ONE, 3e38),
        (Vec3::NAN, 1.0),
        (Vec3::ONE, f32::NAN),
        (Vec3::ONE, -1.0),
    ];
    for (q, r) in balls {
        let slow: Vec<u32> = (0..1500).filter(|&i| r >= 0.0 && p[i as usize].distance_squared(q) <= r * r).collect();
        assert_eq!(tree.within(q, r), slow, "{q} {r}");
    }
}

#[test]
fn one_thread_finds_what_many_find() {
    let p = points(11, 40_000);
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(one.install(|| Neighbours::build(&p, 6)), Neighbours::build(&p, 6));
}

#[test]
fn a_ball_has_a_good_point_where_a_full_search_finds_one() {
    let p = points(41, 500);
    let tree = KdTree::new(&p);
    for q in points(42, 300) {
        for (r, every) in [(0.05, 1), (0.2, 50), (2.0, 400), (0.1, 600)] {
            let good = |id: u32| id % every == every - 1;
            let slow = (0..500).any(|i| p[i as usize].distance_squared(q) <= r * r && good(i));
            assert_eq!(tree.any_within(q, r, good), slow);
        }
    }
    assert!(!tree.any_within(Vec3::NAN, 1.0, |_| true));
}
