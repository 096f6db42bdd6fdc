//! Finite-element meshes of the quarter model and their import and export.

mod box_surface;
mod cylinder;
pub mod gmsh;
pub mod hexahedron27_nodes;
mod off_centre;
mod quarter_ball;
mod spheroid;
pub mod vtu;

pub use cylinder::Cylinder;
pub use hexahedron27_nodes::HEXAHEDRON27_REFERENCE_NODES;
pub use off_centre::OffCentre;
pub use quarter_ball::QuarterBall;
pub use spheroid::Spheroid;

/// Kind of element. All elements of a mesh have one kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ElementKind {
    /// Isoparametric 27-node hexahedron, with nodes in VTK's order (`VTK_TRIQUADRATIC_HEXAHEDRON`).
    Hexahedron27,
    /// 10-node tetrahedron, with nodes in VTK's order (`VTK_QUADRATIC_TETRA`).
    Tetrahedron10,
    /// 4-node tetrahedron.
    Tetrahedron4,
}

impl ElementKind {
    /// Nodes of one element.
    pub fn n_nodes(self) -> usize {
        match self {
            Self::Hexahedron27 => 27,
            Self::Tetrahedron10 => 10,
            Self::Tetrahedron4 => 4,
        }
    }
}

/// A mesh of the quarter model (y ≥ 0, z ≥ 0; physics §3.1) or, without symmetry about y = 0, of the half model z ≥ 0. Coordinates in m. The robot's
/// centre is at the origin for any position in the vitreous.
#[derive(Debug, Clone, PartialEq)]
pub struct Mesh {
    /// Node coordinates in m.
    pub node_coordinates_m: Vec<[f64; 3]>,
    /// Kind of every element.
    pub element_kind: ElementKind,
    /// Node indices, `element_kind.n_nodes()` per element, in VTK's order.
    pub connectivity: Vec<u32>,
    /// Nodes on the robot's surface, sorted.
    pub robot_nodes: Vec<u32>,
    /// Nodes on the fixed outer surface, sorted.
    pub outer_nodes: Vec<u32>,
    /// Nodes on the symmetry plane y = 0 (u_y = 0 there), sorted; none in a half model.
    pub symmetry_y_nodes: Vec<u32>,
    /// Nodes on the symmetry plane z = 0 (u_z = 0 there), sorted.
    pub symmetry_z_nodes: Vec<u32>,
}

impl Mesh {
    /// Share of the robot, and of the force on it, in the model. Each plane of symmetry halves it, to a quarter or a half.
    pub fn share(&self) -> f64 {
        [&self.symmetry_y_nodes, &self.symmetry_z_nodes]
            .iter()
            .map(|nodes| if nodes.is_empty() { 1.0 } else { 0.5 })
            .product()
    }

    /// Number of nodes.
    pub fn n_nodes(&self) -> usize {
        self.node_coordinates_m.len()
    }
    /// Number of elements.
    pub fn n_elements(&self) -> usize {
        self.connectivity.len() / self.element_kind.n_nodes()
    }
    /// Node indices of each element in turn.
    pub fn elements(&self) -> impl ExactSizeIterator<Item = &[u32]> {
        self.connectivity.chunks_exact(self.element_kind.n_nodes())
    }
}
