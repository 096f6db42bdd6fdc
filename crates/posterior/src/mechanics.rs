//! Mechanical models of the apparatus, which convert a force into a position: finite elements for a robot, a known compliance for another instrument, or an external
//! program.

use std::path::PathBuf;
use std::sync::OnceLock;

use super::mesh_check;
use super::outside::ExternalModel;
use base::error::{Error, InputPlace, Result, Setting};
use base::files::{self, Content};
use base::sha256::sha256_hex;
use documents::posterior::Warning;
use elements::fe::Stiffness;
use elements::fe::exact::SphereInContainer;
use elements::fe::quality::MeshQuality;
use elements::fe::spatial::{GelAndRobot, PhysicalProperties};
use elements::fe::time::FullOrderModel;
use elements::mesh::gmsh::read_gmsh;
use elements::mesh::{Cylinder, Mesh, OffCentre, QuarterBall, Spheroid};
use record::{Apparatus, Offset, OffsetDirection, Robot, RobotShape, Vitreous};

/// Refinement level of the built-in mesh with which models are fitted.
pub const MODEL_LEVEL: usize = 3;

/// Mesh file that the user provides for the gel.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshFile {
    /// Path of the Gmsh 4.1 file.
    pub path: PathBuf,
    /// Length in m of one unit of the file's coordinates.
    pub metres_per_unit: f64,
}

/// Mechanical model of the apparatus, which converts a force into a position.
pub enum Mechanics {
    /// Finite elements of the vitreous around a robot.
    FiniteElements(Box<FiniteElements>),
    /// Instrument other than a robot, with a known compliance.
    Instrument {
        /// Displacement per force at unit creep compliance, in 1/m. For an indenter, whose force is proportional to a power p of its depth: depth^p per force, in
        /// m^(p−2).
        compliance_per_m: f64,
    },
    /// External program that predicts positions from force and parameters.
    External(Box<ExternalModel>),
}

/// Reference compliance (1/m) for an estimate of the mesh's discretisation error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Comparison {
    /// Compliance of the next coarser built-in mesh.
    CoarserMesh(f64),
    /// Exact compliance of a sphere in the middle of its container (physics §4.2).
    Exact(f64),
}

impl Comparison {
    /// Signed relative error of a mesh's compliance (1/m). With an exact reference, the error is exact. With a coarser mesh, the result is the relative difference
    /// between the two meshes. The true error then has the same sign and is a fraction of the result.
    pub fn relative_error(self, compliance_per_m: f64) -> f64 {
        match self {
            Self::CoarserMesh(coarse) => coarse / compliance_per_m - 1.0,
            Self::Exact(exact) => compliance_per_m / exact - 1.0,
        }
    }
}

/// Full-order model of the gel: mesh, stiffness and material sizes, with its discretisation error and warnings.
pub struct FiniteElements {
    /// Mesh of the gel around the robot.
    pub mesh: Mesh,
    /// Stiffness matrix of the mesh.
    pub stiffness: Stiffness,
    /// Poisson ratio of the vitreous.
    pub poisson_ratio: f64,
    /// Sizes, densities and masses of gel and robot.
    pub sizes: PhysicalProperties,
    /// Reference compliance of the discretisation error; `None` for imported meshes unless the robot is a sphere in the middle.
    pub comparison: Option<Comparison>,
    /// SHA-256 of the imported mesh file and its unit; `None` for a built-in mesh.
    pub mesh_file_sha256: Option<String>,
    /// Warnings about an imported mesh.
    pub mesh_warnings: Vec<Warning>,
    /// Full-order model at this Poisson ratio; empty until it is asked for.
    full_order: OnceLock<FullOrderModel>,
}

impl FiniteElements {
    /// Full-order model at this Poisson ratio. The stiffness is factorised at the first call only.
    ///
    /// # Errors
    /// Errors of the factorisation.
    pub fn full_order(&self) -> Result<&FullOrderModel> {
        if let Some(model) = self.full_order.get() {
            return Ok(model);
        }
        let model = FullOrderModel::new(&self.stiffness, self.poisson_ratio)?;
        Ok(self.full_order.get_or_init(|| model))
    }

    /// Displacement of every unknown for 1 N on the whole robot, at unit Young's modulus, in 1/m.
    ///
    /// # Errors
    /// Errors of [`Self::full_order`].
    pub fn field_per_n(&self) -> Result<&[f64]> {
        Ok(self.full_order()?.field_per_n())
    }

    /// Displacement of the robot per force at unit creep compliance, in 1/m.
    ///
    /// # Errors
    /// Errors of [`Self::full_order`].
    pub fn compliance_per_m(&self) -> Result<f64> {
        Ok(self.full_order()?.compliance_per_m())
    }

    /// Returns mesh, stiffness and sizes, as input of effects that change the displacement field.
    pub fn surroundings(&self) -> GelAndRobot<'_> {
        GelAndRobot {
            mesh: &self.mesh,
            stiffness: &self.stiffness,
            poisson_ratio: self.poisson_ratio,
            sizes: self.sizes,
        }
    }
}

/// Density of water in kg/m³, which replaces a missing density of gel or robot.
const WATER_KG_M3: f64 = 1000.0;

/// Sizes, densities and masses of gel and robot. `level` is the refinement level of the built-in mesh, or `None` for an imported mesh.
pub fn sizes_of(robot: &Robot, vitreous: &Vitreous, level: Option<usize>) -> PhysicalProperties {
    let ball = |diameter_m: f64| level.map(|level| ball(diameter_m, 0.5 * vitreous.diameter_m, level));
    PhysicalProperties {
        // Only inertia uses the densities, and without them inertia is refused. Any value serves here.
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

/// Parameters of the built-in mesh of level `level` around a sphere. The gel has the outer radius `outer_radius_m`.
fn ball(diameter_m: f64, outer_radius_m: f64, level: usize) -> QuarterBall {
    QuarterBall { robot_radius_m: 0.5 * diameter_m, outer_radius_m, n_per_edge: level, n_layers: 4 * level }
}

/// Creates the built-in mesh of refinement level `level` (1, 2, 3, …). The element size is inversely proportional to the level. Around a sphere, the mesh has `level`
/// elements along an octant's edge and 4·`level` elements along the radius. A robot off the centre across the force needs a half model with twice as many elements.
///
/// # Errors
/// [`Error::Input`] for a robot without a built-in mesh. The robot is too slender, too flat, too near the outer surface, or so far off the centre that elements are
/// inverted.
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

/// Exact stiffness of a sphere in the middle of its container: force per displacement and per Young's modulus, in m. `None` for other shapes and for a sphere off the
/// centre.
pub fn exact_stiffness_m(robot: &Robot, vitreous: &Vitreous) -> Option<f64> {
    let (RobotShape::Sphere { diameter_m }, None) = (robot.shape, robot.offset) else { return None };
    let exact = SphereInContainer::new(vitreous.poisson_ratio, 0.5 * diameter_m, 0.5 * vitreous.diameter_m);
    Some(exact.stiffness_n_per_m(1.0))
}

/// Reference compliance in closed form; `None` unless the robot is a sphere in the middle.
fn exact_comparison(robot: &Robot, vitreous: &Vitreous) -> Option<Comparison> {
    exact_stiffness_m(robot, vitreous).map(|stiffness_m| Comparison::Exact(1.0 / stiffness_m))
}

/// Reads the user's mesh and returns it with warnings. Without a robot, the mesh may contain a body of any shape and size.
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

/// Refuses an imported mesh, which is a quarter model, for a robot off the centre across the force. An offset along the force is allowed, because the mesh can contain
/// it.
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
    /// Creates the mechanics of an apparatus. For a robot, this builds or reads the mesh and assembles the stiffness. An instrument's known compliance is used
    /// directly.
    pub fn new(apparatus: &Apparatus, mesh_file: Option<&MeshFile>) -> Result<Self> {
        let (robot, vitreous) = match apparatus {
            Apparatus::Instrument { compliance_per_m, .. } => {
                return Ok(Self::Instrument { compliance_per_m: *compliance_per_m });
            }
            Apparatus::Indenter(indenter) => {
                return Ok(Self::Instrument { compliance_per_m: indenter.compliance() });
            }
            Apparatus::Robot { robot, vitreous } => (robot, vitreous),
        };
        let poisson_ratio = vitreous.poisson_ratio;
        let with_stiffness = |mesh: Mesh| Stiffness::new(&mesh).map(|stiffness| (mesh, stiffness));
        let ((mesh, stiffness), mesh_warnings, comparison) = match mesh_file {
            Some(file) => {
                refuse_across(robot)?;
                let (mesh, warnings) = read_mesh(file, Some(robot), vitreous)?;
                (with_stiffness(mesh)?, warnings, exact_comparison(robot, vitreous))
            }
            None => {
                let coarse_per_m = || -> Result<f64> {
                    let coarse = Stiffness::new(&robot_mesh(robot, vitreous, MODEL_LEVEL - 1)?)?;
                    Ok(FullOrderModel::new(&coarse, poisson_ratio)?.compliance_per_m())
                };
                let fine = || robot_mesh(robot, vitreous, MODEL_LEVEL).and_then(with_stiffness);
                let (fine, coarse_per_m) = rayon::join(fine, coarse_per_m);
                (fine?, Vec::new(), Some(Comparison::CoarserMesh(coarse_per_m?)))
            }
        };
        let mesh_file_sha256 = match mesh_file {
            Some(file) => Some(hash_of(file)?),
            None => None,
        };
        Ok(Self::FiniteElements(Box::new(FiniteElements {
            mesh,
            stiffness,
            poisson_ratio,
            sizes: sizes_of(robot, vitreous, mesh_file.is_none().then_some(MODEL_LEVEL)),
            comparison,
            mesh_file_sha256,
            mesh_warnings,
            full_order: OnceLock::new(),
        })))
    }
}
