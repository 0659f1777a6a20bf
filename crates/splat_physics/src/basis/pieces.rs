//! [`pieces`]: which cells of a cage hang together.

use super::PartCage;

/// Nodes of a cage by piece.
pub(super) struct Pieces {
    pub(super) count: usize,
    /// By node; `u32::MAX` for nodes of no active cell. Pieces are numbered by their first node.
    pub(super) of_node: Vec<u32>,
}

/// Pieces of active cells; cells that share a node belong together.
pub(super) fn pieces(cage: &PartCage) -> Pieces {
    let mut parent: Vec<u32> = (0..cage.cage.node_count() as u32).collect();
    let mut used = vec![false; parent.len()];
    for cell in (0..cage.active.len()).filter(|&cell| cage.active[cell]) {
        let corners = cage.cage.corners(cage.cell_at(cell));
        let first = root(&mut parent, corners[0] as u32);
        for corner in corners {
            used[corner] = true;
            let other = root(&mut parent, corner as u32);
            let first = root(&mut parent, first);
            // The lesser one, so that the root is the piece's first node.
            parent[first.max(other) as usize] = first.min(other);
        }
    }
    let mut of_node = vec![u32::MAX; parent.len()];
    let mut count = 0;
    for node in 0..parent.len() {
        if used[node] {
            let root = root(&mut parent, node as u32) as usize;
            if root == node {
                of_node[node] = count;
                count += 1;
            } else {
                of_node[node] = of_node[root];
            }
        }
    }
    Pieces { count: count as usize, of_node }
}

fn root(parent: &mut [u32], mut node: u32) -> u32 {
    while parent[node as usize] != node {
        parent[node as usize] = parent[parent[node as usize] as usize];
        node = parent[node as usize];
    }
    node
}
