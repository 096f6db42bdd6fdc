//! Mechanics of the apparatus: finite elements for a robot, a given compliance for another instrument, or an external program.

use std::path::PathBuf;

use super::mesh_check;
use super::outside::ExternalModel;
use crate::study::sha256_hex;
use base::error::{Error, InputPlace, Result, Setting};
use base::files::{self, Content};
use documents::posterior::Warning;
use elements::fe::Stiffness;
use elements::fe::exact::SphereInContainer;
use elements::fe::quality::MeshQuality;
use elements::fe::spatial::{GelAndRobot, PhysicalProperties};
use elements::fe::time::FullOrderModel;
use elements::mesh::gmsh::read_gmsh;
use elements::mesh::{Cylinder, Mesh, OffCentre, QuarterBall, Spheroid};
use record::{Apparatus, Offset, OffsetDirection, Robot, RobotShape, Vitreous};

/// Mesh level of the fitted model.
pub const MODEL_LEVEL: usize = 3;

/// A mesh file of the user.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshFile {
    /// Path of the Gmsh 4.1 file.
    pub path: PathBuf,
    /// Length in m of the file's unit.
    pub metres_per_unit: f64,
}

/// Mechanics that convert a force into a position.
pub enum Mechanics {
    /// Finite elements of a robot in the vitreous.
    FiniteElements(Box<FiniteElements>),
    /// Compliance of another instrument.
    Instrument {
        /// Displacement per force at unit creep compliance, in 1/m; for an indenter depth^p, in m^(p−2).
        compliance_per_m: f64,
    },
    /// An external program.
    External(Box<ExternalModel>),
}

/// A second compliance (1/m), with which the mesh's error is estimated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Comparison {
    /// Compliance of the next coarser built-in mesh.
    CoarserMesh(f64),
    /// Exact compliance of a sphere in the middle of its container (physics §4.2).
    Exact(f64),
}

impl Comparison {
    /// Relative error of a mesh's compliance (1/m), with its sign. With a coarser mesh it is that mesh's excess; the finer mesh's own error has the same sign and is a
    /// fraction of it.
    pub fn relative_error(self, compliance_per_m: f64) -> f64 {
        match self {
            Self::CoarserMesh(coarse) => coarse / compliance_per_m - 1.0,
            Self::Exact(exact) => compliance_per_m / exact - 1.0,
        }
    }
}

/// Meshed, assembled and analysed full-order model.
pub struct FiniteElements {
    /// The mesh.
    pub mesh: Mesh,
    /// Stiffness of the mesh.
    pub stiffness: Stiffness,
    /// Poisson ratio of the vitreous.
    pub poisson_ratio: f64,
    /// Sizes and weights of gel and robot.
    pub sizes: PhysicalProperties,
    /// Reference of the discretisation error; `None` for imported bodies other than spheres in the middle.
    pub comparison: Option<Comparison>,
    /// SHA-256 of the imported mesh's file and unit.
    pub mesh_file_sha256: Option<String>,
    /// Warnings of the mesh's reader.
    pub mesh_warnings: Vec<Warning>,
}

impl FiniteElements {
    /// Mesh, stiffness and sizes for effects that change the displacement field.
    pub fn surroundings(&self) -> GelAndRobot<'_> {
        GelAndRobot {
            mesh: &self.mesh,
            stiffness: &self.stiffness,
            poisson_ratio: self.poisson_ratio,
            sizes: self.sizes,
        }
    }
}

/// Density of water.
const WATER_KG_M3: f64 = 1000.0;

/// Sizes and weights of gel and robot in a built-in mesh of a level, or in an imported mesh (`None`).
pub fn sizes_of(robot: &Robot, vitreous: &Vitreous, level: Option<usize>) -> PhysicalProperties {
    let ball = |diameter_m: f64| level.map(|level| ball(diameter_m, 0.5 * vitreous.diameter_m, level));
    PhysicalProperties {
        // Without a density inertia is refused, and no other effect uses the weights.
        gel_density_kg_m3: vitreous.density_kg_m3.unwrap_or(WATER_KG_M3),
        robot_mass_kg: robot.density_kg_m3.unwrap_or(WATER_KG_M3) * robot.shape.volume_m3(),
        robot_radius_m: robot.shape.equivalent_radius_m(),
        outer_radius_m: 0.5 * vitreous.diameter_m,
        ball: match (robot.shape, robot.offset) {
            (RobotShape::Sphere { diameter_m }, None) => ball(diameter_m),
            _ => None,
        },
    }
}

/// Parameters of the built-in mesh around a sphere; `level` sets its fineness.
fn ball(diameter_m: f64, outer_radius_m: f64, level: usize) -> QuarterBall {
    QuarterBall { robot_radius_m: 0.5 * diameter_m, outer_radius_m, n_per_edge: level, n_layers: 4 * level }
}

/// Built-in mesh of level 1, 2, 3, …; the element size is inversely proportional to the level. Around a sphere it has level × 4·level elements along an octant's edge and
/// the radius. For a robot off the centre across the force it is a half model with twice as many.
///
/// # Errors
/// [`Error::Input`] for a robot beyond the built-in meshes: too slender, too flat, too near the outer surface, or so far off the centre that elements are inverted.
pub fn robot_mesh(robot: &Robot, vitreous: &Vitreous, level: usize) -> Result<Mesh> {
    let off_centre = robot.offset.map(|offset| OffCentre { outer_radius_m: 0.5 * vitreous.diameter_m, offset });
    let outer_radius_m = off_centre.map_or(0.5 * vitreous.diameter_m, |place| place.centred_outer_radius_m());
    let mesh = match robot.shape {
        RobotShape::Sphere { diameter_m } => ball(diameter_m, outer_radius_m, level).mesh(),
        RobotShape::Ellipsoid { length_m, diameter_m, orientation } => {
            Spheroid { length_m, diameter_m, orientation, outer_radius_m, level }.mesh()
        }
        RobotShape::Cylinder { length_m, diameter_m, orientation } => {
            Cylinder { length_m, diameter_m, orientation, outer_radius_m, level }.mesh()
        }
    };
    let mesh = match off_centre {
        Some(place) => mesh.and_then(|mesh| moved(&place, mesh)),
        None => mesh,
    };
    mesh.map_err(|error| match error {
        Error::Numerical { what, remedy } => {
            Error::input(InputPlace::file("experiment.toml").at_key("robot"), what, remedy)
        }
        other => other,
    })
}

fn moved(place: &OffCentre, centred: Mesh) -> Result<Mesh> {
    let mesh = place.displace_mesh(centred)?;
    let n_inverted = MeshQuality::of(&mesh).n_inverted;
    if n_inverted > 0 {
        return Err(Error::numerical(
            format!(
                "{n_inverted} elements of the built-in mesh are inverted with the robot {:.4} mm off the centre of a radius of {:.4} mm",
                1e3 * place.offset.distance_m,
                1e3 * place.outer_radius_m
            ),
            "give a smaller `offset_mm`: the robot is too near the outer surface for the built-in mesh",
        ));
    }
    Ok(mesh)
}

/// Force per displacement and Pa of Young's modulus (m), if known exactly: for a sphere in the middle.
pub fn exact_stiffness_m(robot: &Robot, vitreous: &Vitreous) -> Option<f64> {
    let (RobotShape::Sphere { diameter_m }, None) = (robot.shape, robot.offset) else { return None };
    let exact = SphereInContainer::new(vitreous.poisson_ratio, 0.5 * diameter_m, 0.5 * vitreous.diameter_m);
    Some(exact.stiffness_n_per_m(1.0))
}

/// Exact comparison, if there is one.
fn exact_comparison(robot: &Robot, vitreous: &Vitreous) -> Option<Comparison> {
    exact_stiffness_m(robot, vitreous).map(|stiffness_m| Comparison::Exact(1.0 / stiffness_m))
}

/// Reads the user's mesh and returns it with warnings. Without a robot it may contain any body.
///
/// # Errors
/// [`Error::Input`] and [`Error::File`] of the reader.
pub fn read_mesh(file: &MeshFile, robot: Option<&Robot>, vitreous: &Vitreous) -> Result<(Mesh, Vec<Warning>)> {
    let read = read_gmsh(&file.path, file.metres_per_unit)?;
    let said = read.warnings.iter().map(|w| mesh_check::warning(w.message(), w.advice()));
    let doubts = mesh_check::mesh_warnings(&read.mesh, robot, vitreous);
    let warnings = said.chain(doubts).collect();
    Ok((read.mesh, warnings))
}

/// Refuses a robot off the centre across the force with an imported mesh, which is a quarter model. Along the force, the mesh contains the offset.
fn refuse_across(robot: &Robot) -> Result<()> {
    match robot.offset {
        Some(Offset { direction: OffsetDirection::Across, distance_m }) => Err(Error::input(
            InputPlace::setting(Setting::Mesh),
            format!(
                "the robot is {:.4} mm off the centre across the force, but a mesh from a file is a quarter model, symmetric about that line",
                1e3 * distance_m
            ),
            format!("leave `{}` out: the built-in mesh is a half model, which this robot needs", Setting::Mesh),
        )),
        _ => Ok(()),
    }
}

fn hash_of(file: &MeshFile) -> Result<String> {
    let mut bytes = files::read(&file.path, Content::Mesh, "give a mesh that can be read")?;
    bytes.extend_from_slice(&file.metres_per_unit.to_le_bytes());
    Ok(sha256_hex(&bytes))
}

impl Mechanics {
    /// Meshes and assembles a robot's surroundings (or reads the user's mesh). The compliance of an instrument is used directly.
    pub fn new(apparatus: &Apparatus, mesh_file: Option<&MeshFile>) -> Result<Self> {
        let (robot, vitreous) = match apparatus {
            Apparatus::Instrument { compliance_per_m } => {
                return Ok(Self::Instrument { compliance_per_m: *compliance_per_m });
            }
            Apparatus::Indenter(indenter) => {
                return Ok(Self::Instrument { compliance_per_m: indenter.compliance() });
            }
            Apparatus::Robot { robot, vitreous } => (robot, vitreous),
        };
        let poisson_ratio = vitreous.poisson_ratio;
        let (mesh, mesh_warnings, comparison) = match mesh_file {
            Some(file) => {
                refuse_across(robot)?;
                let (mesh, warnings) = read_mesh(file, Some(robot), vitreous)?;
                (mesh, warnings, exact_comparison(robot, vitreous))
            }
            None => {
                let coarse = Stiffness::new(&robot_mesh(robot, vitreous, MODEL_LEVEL - 1)?)?;
                let coarse_per_m = FullOrderModel::new(&coarse, poisson_ratio)?.compliance_per_m();
                (robot_mesh(robot, vitreous, MODEL_LEVEL)?, Vec::new(), Some(Comparison::CoarserMesh(coarse_per_m)))
            }
        };
        let mesh_file_sha256 = match mesh_file {
            Some(file) => Some(hash_of(file)?),
            None => None,
        };
        let stiffness = Stiffness::new(&mesh)?;
        Ok(Self::FiniteElements(Box::new(FiniteElements {
            mesh,
            stiffness,
            poisson_ratio,
            sizes: sizes_of(robot, vitreous, mesh_file.is_none().then_some(MODEL_LEVEL)),
            comparison,
            mesh_file_sha256,
            mesh_warnings,
        })))
    }
}
