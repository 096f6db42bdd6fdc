//! Import of tetrahedral meshes from Gmsh (MSH 4.1, text or little-endian binary).
//!
//! The source paper uses Gmsh. A mesh must cover the quarter model y ≥ 0, z ≥ 0 (physics §3.1) and
//! name four surfaces as physical groups: `robot`, `outer`, `symmetry_y` (y = 0) and `symmetry_z`
//! (z = 0). Its elements are 10-node tetrahedra. 4-node tetrahedra are accepted with a warning.
//! `tests/data/gmsh/quarter_sphere.py` makes such a mesh.

mod model;
mod orientation;
mod scanner;
mod sections;

use std::path::Path;

use crate::mesh::Mesh;
use base::error::{Error, InputPlace, Result};
use base::files::{self, Content};

/// An imported mesh, with warnings about it.
#[derive(Debug, Clone, PartialEq)]
pub struct GmshMesh {
    /// The mesh, with coordinates in m.
    pub mesh: Mesh,
    /// Warnings about properties of the mesh that are accepted.
    pub warnings: Vec<GmshWarning>,
}

/// A property of an imported mesh that is accepted with a warning.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum GmshWarning {
    /// The elements are 4-node tetrahedra, which are too stiff in nearly incompressible gels
    /// (physics §3.4).
    LinearTetrahedra {
        /// Number of elements in the mesh.
        n_elements: usize,
    },
    /// Some nodes belong to no volume element (centres of arcs, unused points). They were dropped.
    UnusedNodes {
        /// Number of dropped nodes.
        n_nodes: usize,
    },
    /// Some elements were inverted. Their nodes have been renumbered.
    InvertedElements {
        /// Number of renumbered elements.
        n_elements: usize,
    },
    /// The robot's extent along x is not centred at the origin.
    RobotOffCentre {
        /// Middle of the robot's extent along x, in m.
        centre_x_m: f64,
    },
}

impl GmshWarning {
    /// Message for the user about the property of the mesh.
    pub fn message(&self) -> String {
        match self {
            Self::LinearTetrahedra { n_elements } => format!(
                "the mesh has {n_elements} tetrahedra of 4 nodes, which lock (are too stiff). The error at a Poisson ratio of 0.48 is 18 % with \
                 5,000 unknowns, 8 % with 20,000 and 3 % with 90,000; at 0.499 it exceeds 100 % with 20,000"
            ),
            Self::UnusedNodes { n_nodes } => format!("{n_nodes} nodes belong to no volume element and were dropped"),
            Self::InvertedElements { n_elements } => {
                format!("{n_elements} elements were inside out and have been renumbered")
            }
            Self::RobotOffCentre { centre_x_m } => {
                format!("the robot's extent along x is centred at {centre_x_m:.3e} m, not at the origin")
            }
        }
    }

    /// Advice to the user about the property: its remedy, or when to ignore it.
    pub fn advice(&self) -> &'static str {
        match self {
            Self::LinearTetrahedra { .. } => {
                "mesh with second order (`gmsh -3 -order 2 -format msh41`), or use the built-in mesh"
            }
            Self::UnusedNodes { .. } => "ignore this if they are centres of arcs; otherwise check the mesh in Gmsh",
            Self::InvertedElements { .. } => "ignore this, or set Gmsh's option Mesh.ReorientVolumes to avoid it",
            Self::RobotOffCentre { .. } => {
                "move the geometry so that the robot's centre is the origin, unless an off-centre robot is intended"
            }
        }
    }
}

/// Permitted range of a mesh's unit of length, in m: from a picometre to a kilometre.
const UNITS_M: [f64; 2] = [1e-12, 1e3];

/// Reads a tetrahedral mesh of the quarter model from an MSH 4.1 file.
///
/// `metres_per_unit` is the length of the file's unit in m, such as 1e-3 for a file in mm. Nodes
/// keep the file's order. Nodes that belong to no volume element are dropped. The nodes of an
/// element are in the order of VTK, with positive Jacobians.
///
/// # Errors
/// [`Error::File`] if the file cannot be read. [`Error::Input`] in the following cases, with the
/// line of a text file or the byte offset of a binary one:
/// - The file is damaged or not MSH 4.1.
/// - A physical group is missing or empty.
/// - Elements are of several kinds, of higher than second order, not tetrahedra, or degenerate.
/// - A symmetry node is off its plane.
/// - A face of the boundary is in no group.
/// - Robot and outer surface touch.
pub fn read_gmsh(path: impl AsRef<Path>, metres_per_unit: f64) -> Result<GmshMesh> {
    let path = path.as_ref();
    if !(UNITS_M[0]..=UNITS_M[1]).contains(&metres_per_unit) {
        return Err(Error::input(
            InputPlace::default().at_key("metres_per_unit"),
            format!("{metres_per_unit} is not a unit of length from 1e-12 to 1e3 m"),
            "give the length of the file's unit in m, such as 1e-3 for mm",
        ));
    }
    let bytes = files::read(path, Content::Mesh, "check that the mesh file exists and may be read")?;
    let mut scanner = scanner::Scanner::new(path, &bytes);
    let raw = sections::read_sections(&mut scanner)?;
    model::build(raw, &|found, remedy| scanner.file_error(found, remedy), metres_per_unit)
}
