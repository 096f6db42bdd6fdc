//! Finite-element meshes of the quarter or half model, with import and export.

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

/// Type of element. All elements of a mesh have one type.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ElementKind {
    /// Isoparametric 27-node hexahedron, with nodes in the order of VTK
    /// (`VTK_TRIQUADRATIC_HEXAHEDRON`).
    Hexahedron27,
    /// 10-node tetrahedron, with nodes in the order of VTK (`VTK_QUADRATIC_TETRA`).
    Tetrahedron10,
    /// 4-node tetrahedron with straight edges.
    Tetrahedron4,
}

impl ElementKind {
    /// Number of nodes of one element.
    pub fn n_nodes(self) -> usize {
        match self {
            Self::Hexahedron27 => 27,
            Self::Tetrahedron10 => 10,
            Self::Tetrahedron4 => 4,
        }
    }
}

/// A mesh of the quarter model (y ≥ 0, z ≥ 0; physics §3.1) or of the half model (z ≥ 0), which has
/// no symmetry about y = 0. Coordinates are in m. Their origin is the robot's centre, also if the
/// robot is not at the vitreous's centre.
#[derive(Debug, Clone, PartialEq)]
pub struct Mesh {
    /// Node coordinates in m.
    pub node_coordinates_m: Vec<[f64; 3]>,
    /// Type of all elements.
    pub element_kind: ElementKind,
    /// Node indices, `element_kind.n_nodes()` per element, in the order in which VTK numbers the
    /// nodes of an element.
    pub connectivity: Vec<u32>,
    /// Nodes on the robot's surface, sorted.
    pub robot_nodes: Vec<u32>,
    /// Nodes on the fixed outer surface, sorted.
    pub outer_nodes: Vec<u32>,
    /// Nodes on the symmetry plane y = 0, where u_y = 0, sorted. Empty in a half model.
    pub symmetry_y_nodes: Vec<u32>,
    /// Nodes on the symmetry plane z = 0, where u_z = 0, sorted.
    pub symmetry_z_nodes: Vec<u32>,
}

impl Mesh {
    /// Fraction of the whole robot, and of the force on it, that the mesh contains: a quarter with
    /// two symmetry planes, a half with one.
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
    /// Iterates over the elements. Each item holds the node indices of one element.
    pub fn elements(&self) -> impl ExactSizeIterator<Item = &[u32]> {
        self.connectivity.chunks_exact(self.element_kind.n_nodes())
    }
}
