//! Reference nodes of the 27-node hexahedron in the order of VTK.

/// Reference coordinates (ξ, η, ζ), each −1, 0 or 1, of the nodes of a 27-node hexahedron. The
/// order is that of VTK's cell type 29 (`VTK_TRIQUADRATIC_HEXAHEDRON`): 8 corners, 12 edge middles,
/// 6 face centres (−ξ, +ξ, −η, +η, −ζ, +ζ), centre. The edges are those at ζ = −1, those at ζ = 1,
/// and those along ζ.
///
/// VTK's parametric coordinates are (1 + ξ)/2 and likewise for η and ζ. `tests/python/open_vtu.py`
/// compares the table with them.
pub const HEXAHEDRON27_REFERENCE_NODES: [[f64; 3]; 27] = [
    // 8 corners: those at ζ = −1 counterclockwise, then those at ζ = 1.
    [-1.0, -1.0, -1.0],
    [1.0, -1.0, -1.0],
    [1.0, 1.0, -1.0],
    [-1.0, 1.0, -1.0],
    [-1.0, -1.0, 1.0],
    [1.0, -1.0, 1.0],
    [1.0, 1.0, 1.0],
    [-1.0, 1.0, 1.0],
    // Middles of the edges 0–1, 1–2, 2–3, 3–0 at ζ = −1.
    [0.0, -1.0, -1.0],
    [1.0, 0.0, -1.0],
    [0.0, 1.0, -1.0],
    [-1.0, 0.0, -1.0],
    // Middles of the edges 4–5, 5–6, 6–7, 7–4 at ζ = 1.
    [0.0, -1.0, 1.0],
    [1.0, 0.0, 1.0],
    [0.0, 1.0, 1.0],
    [-1.0, 0.0, 1.0],
    // Middles of the edges 0–4, 1–5, 2–6, 3–7 along ζ.
    [-1.0, -1.0, 0.0],
    [1.0, -1.0, 0.0],
    [1.0, 1.0, 0.0],
    [-1.0, 1.0, 0.0],
    // Face centres: −ξ, +ξ, −η, +η, −ζ, +ζ.
    [-1.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [0.0, -1.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, -1.0],
    [0.0, 0.0, 1.0],
    // Centre of the hexahedron.
    [0.0, 0.0, 0.0],
];

#[cfg(test)]
mod tests {
    use super::HEXAHEDRON27_REFERENCE_NODES as NODES;

    /// Mean position of the nodes with the indices `of`.
    fn mean(of: &[usize]) -> [f64; 3] {
        std::array::from_fn(|axis| of.iter().map(|&n| NODES[n][axis]).sum::<f64>() / of.len() as f64)
    }

    /// Checks the table against VTK's documented edges and faces. Every node after the corners must
    /// be the middle of the corners that VTK lists for it.
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
