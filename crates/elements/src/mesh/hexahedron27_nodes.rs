//! Reference nodes of the 27-node hexahedron in VTK's order.

/// Reference coordinates (ξ, η, ζ), each −1, 0 or 1, of the nodes of a 27-node hexahedron in the order of VTK's cell type 29
/// (`VTK_TRIQUADRATIC_HEXAHEDRON`): 8 corners, 12 edge middles (bottom ring, top ring, uprights), 6 face centres (−ξ, +ξ, −η, +η, −ζ, +ζ), centre.
///
/// VTK's own parametric coordinates are (1 + ξ)/2 etc.; `tests/python/open_vtu.py` compares the table with them.
pub const HEXAHEDRON27_REFERENCE_NODES: [[f64; 3]; 27] = [
    // Corners: bottom (ζ = −1) counterclockwise, then top.
    [-1.0, -1.0, -1.0],
    [1.0, -1.0, -1.0],
    [1.0, 1.0, -1.0],
    [-1.0, 1.0, -1.0],
    [-1.0, -1.0, 1.0],
    [1.0, -1.0, 1.0],
    [1.0, 1.0, 1.0],
    [-1.0, 1.0, 1.0],
    // Middles of the bottom edges 0–1, 1–2, 2–3, 3–0.
    [0.0, -1.0, -1.0],
    [1.0, 0.0, -1.0],
    [0.0, 1.0, -1.0],
    [-1.0, 0.0, -1.0],
    // Middles of the top edges 4–5, 5–6, 6–7, 7–4.
    [0.0, -1.0, 1.0],
    [1.0, 0.0, 1.0],
    [0.0, 1.0, 1.0],
    [-1.0, 0.0, 1.0],
    // Middles of the uprights 0–4, 1–5, 2–6, 3–7.
    [-1.0, -1.0, 0.0],
    [1.0, -1.0, 0.0],
    [1.0, 1.0, 0.0],
    [-1.0, 1.0, 0.0],
    // Face centres.
    [-1.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [0.0, -1.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, -1.0],
    [0.0, 0.0, 1.0],
    // Centre.
    [0.0, 0.0, 0.0],
];

#[cfg(test)]
mod tests {
    use super::HEXAHEDRON27_REFERENCE_NODES as NODES;

    /// Middle of the nodes `of`.
    fn mean(of: &[usize]) -> [f64; 3] {
        std::array::from_fn(|axis| of.iter().map(|&n| NODES[n][axis]).sum::<f64>() / of.len() as f64)
    }

    /// VTK's documented edges and faces: every later node is the middle of the corners listed by VTK.
    #[test]
    fn later_nodes_are_the_middles_of_the_corners_that_vtk_names() {
        let edges = [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]];
        for (node, corners) in (8..20).zip(&edges) {
            assert_eq!(NODES[node], mean(corners), "edge node {node}");
        }
        let faces = [[0, 3, 4, 7], [1, 2, 5, 6], [0, 1, 4, 5], [2, 3, 6, 7], [0, 1, 2, 3], [4, 5, 6, 7]];
        for (node, corners) in (20..26).zip(&faces) {
            assert_eq!(NODES[node], mean(corners), "face node {node}");
        }
        assert_eq!(NODES[26], mean(&[0, 1, 2, 3, 4, 5, 6, 7]));
    }

    #[test]
    fn the_nodes_are_the_whole_grid() {
        let mut keys: Vec<_> = NODES.iter().map(|n| n.map(|c| c as i8)).collect();
        keys.sort_unstable();
        keys.dedup();
        assert_eq!(keys.len(), 27);
    }
}
