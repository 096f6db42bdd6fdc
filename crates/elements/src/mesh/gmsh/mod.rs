//! Import of tetrahedral meshes that Gmsh has made (MSH 4.1, text or little-endian binary).
//!
//! The source paper meshes with Gmsh. A mesh must cover the quarter model y ≥ 0, z ≥ 0 (physics §3.1) and name four surfaces as physical groups:
//! `robot`, `outer`, `symmetry_y` (y = 0) and `symmetry_z` (z = 0); its elements are 10-node tetrahedra, or 4-node ones with a warning.
//! `tests/data/gmsh/quarter_sphere.py` makes such a mesh.

mod model;
mod orientation;
mod scanner;
mod sections;

use std::path::Path;

use crate::mesh::Mesh;
use base::error::{Error, Place, Result};
use base::files::{self, Content};

/// An imported mesh, with what its maker should know about it.
#[derive(Debug, Clone, PartialEq)]
pub struct GmshMesh {
    /// The mesh, in m.
    pub mesh: Mesh,
    /// Things that are accepted but worth knowing.
    pub warnings: Vec<GmshWarning>,
}

/// Something about an imported mesh that is accepted but worth knowing.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum GmshWarning {
    /// 4-node tetrahedra, which are too stiff in nearly incompressible gels (physics §3.4).
    LinearTetrahedra {
        /// Number of elements.
        n_elements: usize,
    },
    /// Nodes of no volume element (centres of arcs, leftovers), which were dropped.
    UnusedNodes {
        /// Number of nodes dropped.
        n_nodes: usize,
    },
    /// Elements numbered inside out, which were turned.
    InvertedElements {
        /// Number of elements turned.
        n_elements: usize,
    },
    /// The robot's extent along x is not centred at the origin.
    RobotOffCentre {
        /// Middle of the robot's extent along x, in m.
        centre_x_m: f64,
    },
}

impl GmshWarning {
    /// A short name for machines, part of the JSON output.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::LinearTetrahedra { .. } => "linear_tetrahedra",
            Self::UnusedNodes { .. } => "unused_nodes",
            Self::InvertedElements { .. } => "inverted_elements",
            Self::RobotOffCentre { .. } => "robot_off_centre",
        }
    }

    /// What was found, in one sentence.
    pub fn text(&self) -> String {
        match self {
            Self::LinearTetrahedra { n_elements } => format!(
                "the mesh has {n_elements} tetrahedra of 4 nodes, which lock: at a Poisson ratio of 0.48 they are too stiff by 18 % with \
                 5,000 unknowns, 8 % with 20,000 and 3 % with 90,000; at 0.499 by more than 100 % with 20,000"
            ),
            Self::UnusedNodes { n_nodes } => format!("{n_nodes} nodes belong to no volume element and were dropped"),
            Self::InvertedElements { n_elements } => {
                format!("{n_elements} elements were numbered inside out and have been turned")
            }
            Self::RobotOffCentre { centre_x_m } => {
                format!("the robot's extent along x is centred at {centre_x_m:.3e} m, not at the origin")
            }
        }
    }

    /// What to do about it.
    pub fn advice(&self) -> &'static str {
        match self {
            Self::LinearTetrahedra { .. } => {
                "mesh with second order (`gmsh -3 -order 2 -format msh41`), or use the built-in mesh"
            }
            Self::UnusedNodes { .. } => "nothing, if they are centres of arcs; otherwise look at the mesh in Gmsh",
            Self::InvertedElements { .. } => "nothing; Gmsh's option Mesh.ReorientVolumes avoids the message",
            Self::RobotOffCentre { .. } => {
                "move the geometry so that the robot's centre is the origin, unless an off-centre robot is meant"
            }
        }
    }
}

/// Units of length that a mesh can be in, from a picometre to a kilometre, in m.
const UNITS_M: [f64; 2] = [1e-12, 1e3];

/// Reads a tetrahedral mesh of the quarter model from an MSH 4.1 file.
///
/// `metres_per_unit` is the length of the file's unit, 1e-3 for a file in mm. Nodes keep the file's order, without those of no volume element; element
/// nodes stand in VTK's order, with positive Jacobians.
///
/// # Errors
/// [`Error::File`] when the file cannot be read; [`Error::Input`], with the line of a text file or the byte offset of a binary one, when it is damaged or not
/// MSH 4.1, when a physical group is missing or empty, when elements are of several kinds, higher than second order, not tetrahedra or degenerate, when a
/// symmetry node is off its plane, when a face of the boundary is in no group, or when robot and outer surface touch.
pub fn read_gmsh(path: impl AsRef<Path>, metres_per_unit: f64) -> Result<GmshMesh> {
    let path = path.as_ref();
    if !(UNITS_M[0]..=UNITS_M[1]).contains(&metres_per_unit) {
        return Err(Error::input(
            Place::default().at_key("metres_per_unit"),
            format!("{metres_per_unit} is not a length"),
            "give the file's unit in m, 1e-3 for mm",
        ));
    }
    let bytes = files::read(path, Content::Mesh, "check that the mesh file exists and may be read")?;
    let mut scanner = scanner::Scanner::new(path, &bytes);
    let raw = sections::read_sections(&mut scanner)?;
    model::build(raw, &|found, remedy| scanner.file_error(found, remedy), metres_per_unit)
}
