//! [`Shape`]: what is drawn over a view; [`Surroundings`]: what lies beside what is selected.

use std::path::PathBuf;
use std::sync::OnceLock;

use splat_core::glam::Vec2;
use splat_core::{Cloud, Mask2d, NO_NEIGHBOUR, Neighbours, Selection, View};

use crate::failure::Failure;
use crate::parse;

/// What is drawn over a view, in pixels.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Shape {
    /// Two opposite corners, both included.
    Rect(Vec2, Vec2),
    /// Corners in order; the inside by the even-odd rule.
    Polygon(Vec<Vec2>),
    /// A stroke through these points, and the radius of the brush.
    Brush(Vec<Vec2>, f32),
    /// A picture.
    Mask(PathBuf),
}

impl Shape {
    /// `X0,Y0,X1,Y1`.
    pub(crate) fn rect(text: &str) -> Result<Self, String> {
        let v = parse::numbers(text, &[4])?;
        let (a, b) = (Vec2::new(v[0], v[1]), Vec2::new(v[2], v[3]));
        Ok(Self::Rect(a.min(b), a.max(b)))
    }

    /// `X,Y;X,Y;...`, three corners at least.
    pub(crate) fn polygon(text: &str) -> Result<Self, String> {
        let corners = parse::points(text)?;
        if corners.len() < 3 {
            return Err(format!("a polygon has at least 3 corners, {} were given", corners.len()));
        }
        Ok(Self::Polygon(corners))
    }

    /// `X,Y;...:R`.
    pub(crate) fn brush(text: &str) -> Result<Self, String> {
        let (points, radius) = text.rsplit_once(':').ok_or("X,Y;X,Y;...:RADIUS was expected")?;
        Ok(Self::Brush(parse::points(points)?, parse::positive(radius)?))
    }

    /// The pixels of a view that the shape covers: those whose centre is inside.
    ///
    /// # Errors
    /// [`Failure::Failed`] if a picture cannot be read.
    pub(crate) fn mask(&self, view: &View) -> Result<Mask2d, Failure> {
        let center = |x: u32, y: u32| Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
        let (width, height) = (view.width, view.height);
        Ok(match self {
            Self::Mask(path) => splat_io::picture::read_mask(path)?,
            Self::Rect(from, to) => {
                let (from, to) = (from.floor(), to.floor());
                Mask2d::from_fn(width, height, |x, y| {
                    let p = Vec2::new(x as f32, y as f32);
                    p.cmpge(from).all() && p.cmple(to).all()
                })
            }
            Self::Polygon(corners) => Mask2d::from_fn(width, height, |x, y| inside(corners, center(x, y))),
            Self::Brush(points, radius) => {
                Mask2d::from_fn(width, height, |x, y| distance(points, center(x, y)) <= *radius)
            }
        })
    }
}

/// Whether a ray from `p` crosses the outline an odd number of times.
fn inside(corners: &[Vec2], p: Vec2) -> bool {
    let next = corners.iter().cycle().skip(1);
    let crosses =
        |(a, b): &(&Vec2, &Vec2)| (a.y > p.y) != (b.y > p.y) && p.x < a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x);
    corners.iter().zip(next).filter(crosses).count() % 2 == 1
}

/// Distance from `p` to a line through points.
fn distance(points: &[Vec2], p: Vec2) -> f32 {
    let to_segment = |a: Vec2, b: Vec2| {
        let along = b - a;
        let t = ((p - a).dot(along) / along.length_squared().max(1e-12)).clamp(0.0, 1.0);
        p.distance(a + t * along)
    };
    let first = points.first().map_or(f32::INFINITY, |&a| p.distance(a));
    points.windows(2).map(|w| to_segment(w[0], w[1])).fold(first, f32::min)
}

/// Neighbours looked at per Gaussian.
const NEIGHBOURS: usize = 8;

/// Which Gaussians lie beside each other; found on first use.
#[derive(Debug, Default)]
pub(crate) struct Surroundings {
    neighbours: OnceLock<Neighbours>,
}

impl Surroundings {
    fn neighbours(&self, cloud: &Cloud) -> &Neighbours {
        self.neighbours.get_or_init(|| Neighbours::build(cloud.means(), NEIGHBOURS))
    }

    /// The selection and its nearest neighbours, `times` times.
    pub(crate) fn grown(&self, cloud: &Cloud, selection: &Selection, times: u32) -> Selection {
        let neighbours = self.neighbours(cloud);
        let mut grown = selection.clone();
        for _ in 0..times {
            let before = grown.clone();
            for i in before.iter() {
                for &j in neighbours.of(i).0.iter().filter(|&&j| j != NO_NEIGHBOUR) {
                    grown.insert(j as usize);
                }
            }
            if grown == before {
                break;
            }
        }
        grown
    }

    /// The largest piece of the selection that hangs together by nearest neighbours; of equals that with the lowest id.
    pub(crate) fn largest(&self, cloud: &Cloud, selection: &Selection) -> Selection {
        let neighbours = self.neighbours(cloud);
        let mut parent: Vec<u32> = (0..cloud.len() as u32).collect();
        fn root(parent: &mut [u32], mut i: u32) -> u32 {
            while parent[i as usize] != i {
                parent[i as usize] = parent[parent[i as usize] as usize];
                i = parent[i as usize];
            }
            i
        }
        for i in selection.iter() {
            for &j in neighbours.of(i).0 {
                if j != NO_NEIGHBOUR && selection.contains(j as usize) {
                    let (a, b) = (root(&mut parent, i as u32), root(&mut parent, j));
                    parent[a.max(b) as usize] = a.min(b);
                }
            }
        }
        let mut counts = vec![0u32; cloud.len()];
        for i in selection.iter() {
            counts[root(&mut parent, i as u32) as usize] += 1;
        }
        let Some(best) = (0..counts.len()).rev().max_by_key(|&k| counts[k]) else { return selection.clone() };
        Selection::from_fn(cloud.len(), |i| selection.contains(i) && root(&mut parent, i as u32) as usize == best)
    }
}

#[cfg(test)]
mod tests {
    use splat_core::glam::Vec3;
    use splat_core::{Pose, View};

    use super::*;

    fn view() -> View {
        View::perspective(Pose::look_at(Vec3::ZERO, Vec3::Z, Vec3::NEG_Y), 1.0, 20, 10)
    }

    #[test]
    fn shapes_cover_the_pixels_they_name() {
        let pixels = |shape: Shape| shape.mask(&view()).unwrap().count();
        assert_eq!(pixels(Shape::rect("2,3,5,4").unwrap()), 4 * 2);
        assert_eq!(pixels(Shape::rect("5,4,2,3").unwrap()), 4 * 2);
        assert_eq!(pixels(Shape::rect("-9,-9,99,99").unwrap()), 200);
        assert_eq!(pixels(Shape::rect("50,50,60,60").unwrap()), 0);
        assert_eq!(pixels(Shape::polygon("2,3;6,3;6,5;2,5").unwrap()), 4 * 2);
        assert_eq!(pixels(Shape::brush("5,5:0.9").unwrap()), 4);
        assert_eq!(pixels(Shape::brush("2.5,5;8.5,5:0.6").unwrap()), 14);
        for bad in [Shape::polygon("1,1;2,2"), Shape::brush("1,1"), Shape::brush("1,1:0"), Shape::rect("1,2,3")] {
            assert!(bad.is_err());
        }
    }

    #[test]
    fn a_hole_of_a_polygon_that_crosses_itself_is_outside() {
        let twice = "0,0;10,0;10,10;0,10;0,0;10,0;10,10;0,10";
        assert_eq!(Shape::polygon(twice).unwrap().mask(&view()).unwrap().count(), 0);
    }
}
