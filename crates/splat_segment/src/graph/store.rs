//! [`Prepared`] as bytes, to be kept between runs of a program.
//!
//! Bytes may come from anywhere: lengths are checked before anything is allocated, indices before anything uses them. What
//! does not fit gives `None`, and the capture is prepared anew.

use glam::Vec3;
use xxhash_rust::xxh3::xxh3_64;

use super::patches::{Border, Patch, PatchGraph};
use super::prepared::Prepared;
use super::tree::{MergeTree, Node, TREES};

const MAGIC: &[u8; 8] = b"splatprp";
/// Raised when the layout changes.
const VERSION: u32 = 1;
/// Magic, version, four counts, hash of the body.
const HEAD: usize = 8 + 4 + 4 * 4 + 8;
/// 32-bit words of one patch, border and node.
const PATCH: usize = 14;
const BORDER: usize = 8;
const NODE: usize = 13;

impl Prepared {
    /// All of it, little-endian: head, patch of every Gaussian, patches, borders, then the nodes of every tree (their number
    /// before them). Parents and orders follow from the children and are not kept.
    pub fn to_bytes(&self) -> Vec<u8> {
        let g = &self.graph;
        let mut body = Out(Vec::with_capacity(4 * self.words()));
        g.of.iter().for_each(|&p| body.int(p));
        for p in &g.patches {
            body.int(p.count);
            body.float(p.mass);
            [p.center, p.lab, p.pattern, p.normal].into_iter().for_each(|v| body.vector(v));
        }
        for b in &g.borders {
            [b.a, b.b, b.count].into_iter().for_each(|v| body.int(v));
            [b.edge, b.color, b.pattern, b.bend, b.smooth].into_iter().for_each(|v| body.float(v));
        }
        for tree in &self.trees {
            body.int(tree.nodes.len() as u32);
            for n in &tree.nodes {
                n.children.into_iter().for_each(|c| body.int(c));
                body.float(n.height);
                body.int(n.count);
                body.float(n.mass);
                body.int(n.border);
                body.float(n.border_sum);
                body.vector(n.min);
                body.vector(n.max);
            }
        }
        let mut out = Out(Vec::with_capacity(HEAD + body.0.len()));
        out.0.extend_from_slice(MAGIC);
        out.int(VERSION);
        let counts = [g.of.len(), g.patches.len(), g.borders.len(), self.trees.len()];
        counts.into_iter().for_each(|n| out.int(n as u32));
        out.0.extend_from_slice(&xxh3_64(&body.0).to_le_bytes());
        out.0.append(&mut body.0);
        out.0
    }

    /// What [`Prepared::to_bytes`] wrote; `None` for anything else, however it came about.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let body = bytes.get(HEAD..)?;
        if &bytes[..8] != MAGIC || xxh3_64(body) != u64::from_le_bytes(bytes[HEAD - 8..HEAD].try_into().ok()?) {
            return None;
        }
        let mut head = Words(&bytes[8..HEAD - 8]);
        if head.int()? != VERSION {
            return None;
        }
        let [gaussians, patches, borders, trees] = [head.len()?, head.len()?, head.len()?, head.len()?];
        if trees != TREES.len() {
            return None;
        }
        let mut words = Words(body);
        let of = (0..words.enough(gaussians, 1)?).map(|_| words.int()).collect::<Option<Vec<u32>>>()?;
        if of.iter().any(|&p| p as usize >= patches) {
            return None;
        }
        let patch = |w: &mut Words<'_>| {
            Some(Patch {
                count: w.int()?,
                mass: w.float()?,
                center: w.vector()?,
                lab: w.vector()?,
                pattern: w.vector()?,
                normal: w.vector()?,
            })
        };
        let patches = (0..words.enough(patches, PATCH)?).map(|_| patch(&mut words)).collect::<Option<Vec<_>>>()?;
        let border = |w: &mut Words<'_>| {
            Some(Border {
                a: w.int()?,
                b: w.int()?,
                count: w.int()?,
                edge: w.float()?,
                color: w.float()?,
                pattern: w.float()?,
                bend: w.float()?,
                smooth: w.float()?,
            })
        };
        let borders = (0..words.enough(borders, BORDER)?).map(|_| border(&mut words)).collect::<Option<Vec<_>>>()?;
        let in_order = |b: &Border| b.a < b.b && (b.b as usize) < patches.len();
        if !borders.iter().all(in_order) || !borders.is_sorted_by(|x, y| (x.a, x.b) < (y.a, y.b)) {
            return None;
        }
        let leaves = patches.len();
        let trees = (0..trees).map(|_| tree(&mut words, leaves)).collect::<Option<Vec<_>>>()?;
        words.0.is_empty().then_some(Self { graph: PatchGraph { of, patches, borders }, trees })
    }

    fn words(&self) -> usize {
        let nodes: usize = self.trees.iter().map(|t| 1 + NODE * t.nodes.len()).sum();
        self.graph.of.len() + PATCH * self.graph.patches.len() + BORDER * self.graph.borders.len() + nodes
    }
}

/// A tree, every node of which has two children before it, or none if it is a leaf, and one parent at most.
fn tree(words: &mut Words<'_>, leaves: usize) -> Option<MergeTree> {
    let count = words.len()?;
    let count = words.enough(count, NODE)?;
    if count < leaves || count > (2 * leaves).saturating_sub(1).max(leaves) {
        return None;
    }
    let mut nodes: Vec<Node> = Vec::with_capacity(count);
    for k in 0..count {
        let node = Node {
            parent: k as u32,
            children: [words.int()?, words.int()?],
            height: words.float()?,
            count: words.int()?,
            mass: words.float()?,
            border: words.int()?,
            border_sum: words.float()?,
            min: words.vector()?,
            max: words.vector()?,
        };
        if k < leaves {
            if node.children != [u32::MAX; 2] {
                return None;
            }
        } else {
            for child in node.children {
                let child_node = nodes.get_mut(child as usize)?;
                if child_node.parent != child {
                    return None;
                }
                child_node.parent = k as u32;
            }
        }
        nodes.push(node);
    }
    let mut tree = MergeTree { nodes, leaves, order: Vec::with_capacity(leaves), run: Vec::new() };
    tree.lay_out();
    Some(tree)
}

struct Out(Vec<u8>);

impl Out {
    fn int(&mut self, v: u32) {
        self.0.extend_from_slice(&v.to_le_bytes());
    }

    fn float(&mut self, v: f32) {
        self.int(v.to_bits());
    }

    fn vector(&mut self, v: Vec3) {
        v.to_array().into_iter().for_each(|x| self.float(x));
    }
}

/// What is left to read.
struct Words<'a>(&'a [u8]);

impl Words<'_> {
    fn int(&mut self) -> Option<u32> {
        let (word, rest) = self.0.split_first_chunk::<4>()?;
        self.0 = rest;
        Some(u32::from_le_bytes(*word))
    }

    fn len(&mut self) -> Option<usize> {
        self.int().map(|n| n as usize)
    }

    fn float(&mut self) -> Option<f32> {
        self.int().map(f32::from_bits)
    }

    fn vector(&mut self) -> Option<Vec3> {
        Some(Vec3::new(self.float()?, self.float()?, self.float()?))
    }

    /// `count`, if that many things of `words` words each are there.
    fn enough(&self, count: usize, words: usize) -> Option<usize> {
        (count.checked_mul(4 * words)? <= self.0.len()).then_some(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Five Gaussians in four patches in a row, taken apart into every tree.
    fn small() -> Prepared {
        let patch = |k: usize| Patch {
            count: 1 + k as u32 / 3,
            mass: 1.0 + k as f32,
            center: Vec3::X * k as f32,
            lab: Vec3::new(50.0, k as f32, -3.0),
            pattern: Vec3::splat(0.5),
            normal: Vec3::Y,
        };
        let border =
            |a: u32| Border { a, b: a + 1, count: 3, edge: 0.2, color: a as f32, pattern: 1.0, bend: 0.1, smooth: 0.9 };
        let graph = PatchGraph {
            of: vec![3, 0, 1, 2, 3],
            patches: (0..4).map(patch).collect(),
            borders: (0..3).map(border).collect(),
        };
        let trees = TREES.iter().map(|settings| MergeTree::new(&graph, settings)).collect();
        Prepared { graph, trees }
    }

    /// Bytes whose hash is made right again after they were changed.
    fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
        let hash = xxh3_64(&bytes[HEAD..]);
        bytes[HEAD - 8..HEAD].copy_from_slice(&hash.to_le_bytes());
        bytes
    }

    #[test]
    fn what_was_kept_comes_back_to_the_bit() {
        for prepared in [small(), Prepared { trees: vec![MergeTree::default(); TREES.len()], ..Prepared::default() }] {
            let bytes = prepared.to_bytes();
            assert_eq!(Prepared::from_bytes(&bytes).as_ref(), Some(&prepared));
        }
    }

    #[test]
    fn cut_or_changed_bytes_are_refused() {
        let bytes = small().to_bytes();
        for len in 0..bytes.len() {
            assert!(Prepared::from_bytes(&bytes[..len]).is_none(), "{len}");
        }
        for k in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[k] ^= 0x55;
            assert!(Prepared::from_bytes(&changed).is_none(), "{k}");
        }
        assert!(Prepared::from_bytes(&[bytes, vec![0; 4]].concat()).is_none());
    }

    #[test]
    fn bytes_with_a_right_hash_and_wrong_numbers_never_panic() {
        let bytes = small().to_bytes();
        for k in (8..bytes.len()).step_by(4).filter(|&k| !(HEAD - 8..HEAD).contains(&k)) {
            for word in [0u32, 1, 3, 4, 7, 0x7fff_ffff, u32::MAX - 1, u32::MAX] {
                let mut changed = bytes.clone();
                changed[k..k + 4].copy_from_slice(&word.to_le_bytes());
                if let Some(prepared) = Prepared::from_bytes(&sealed(changed)) {
                    let patches = prepared.patch_count();
                    assert!(prepared.graph.of.iter().all(|&p| (p as usize) < patches));
                    for tree in &prepared.trees {
                        assert!((0..patches as u32).all(|leaf| tree.ancestors(leaf).len() <= tree.nodes.len()));
                        assert_eq!(tree.order.len(), tree.leaves);
                    }
                }
            }
        }
    }
}
