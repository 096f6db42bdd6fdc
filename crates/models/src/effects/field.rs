//! How an effect changes the displacement field: what it brings to the full model, and how that is reduced.
//!
//! There are four kinds, by their mathematics and not by their physics. An effect of the first kind brings its matrices; all else follows from them
//! ([`elements::fe::spatial`] steps them, `surrogate` reduces them to terms, `rheology::Beside` turns the terms into creep).

use base::error::{Error, Result};
use elements::fe::meridional::{SecondMatrix, pair_around_sphere};
use elements::fe::spatial::{Sizes, SpatialJob, SpatialRun, SpatialSystem, Splitting, Surroundings};
use elements::mesh::{ElementKind, Mesh};
use laws::rheology::Beside;
use laws::stages::{LinearField, NonlinearFamily, Spatial};

/// How an effect changes the displacement field.
#[derive(Clone, Copy)]
pub enum Field {
    /// Linear, and two matrices with scalar factors.
    Pair(&'static dyn MatrixPair),
    /// Biot's equations (physics §4.9): what stands beside the law is [`Beside::Friction`] with the mobility for its compliance, and the field's shape depends on the
    /// drained Poisson ratio. Gives the range of those for an undrained one.
    Pores(fn(f64) -> [f64; 2]),
    /// A law that is not linear.
    Nonlinear(NonlinearFamily),
    /// Strains may be large.
    Large,
}

/// Why a field is not solved for beside springpots of a law.
pub(super) const SPRINGPOTS: &str =
    "neither mass nor large displacements are solved for beside the memory of its springpot";

/// The matrices of one shape of the field.
pub struct FieldSystem {
    /// The mesh, where it is not the surroundings' own.
    pub mesh: Option<Mesh>,
    /// The matrices.
    pub system: SpatialSystem,
}

/// The parameter on which the field's shape depends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShapeParameter {
    /// Its name.
    pub name: &'static str,
    /// Its range.
    pub range: [f64; 2],
}

/// Two matrices on one set of unknowns: what the gel's law multiplies, and what stands beside it.
pub trait MatrixPair: Sync {
    /// What is modelled, in a few plain words.
    fn words(&self) -> &'static str;
    /// Why it cannot be computed for a robot on its mesh, if it cannot.
    fn lacks(&self, _surroundings: &Surroundings<'_>) -> Option<&'static str> {
        None
    }
    /// Whether what stands beside the law is a mass: then a spring in series lets waves through.
    fn has_mass(&self) -> bool {
        false
    }
    /// On what the matrices depend beside gel and robot, if on anything. Such a pair must answer by three shares: 0, one between, and 1.
    fn shape(&self) -> Option<ShapeParameter> {
        None
    }
    /// How the matrices are split into terms.
    fn splitting(&self, sizes: &Sizes) -> Splitting;
    /// The matrices, at a value of [`Self::shape`] if there is one.
    ///
    /// # Errors
    /// [`Error::Numerical`] for inverted elements, for meshes without a robot, and for meshes that [`Self::lacks`] refuses.
    fn system(&self, surroundings: &Surroundings<'_>, shape: Option<f64>) -> Result<FieldSystem>;
    /// What stands beside the law around a sphere, for the second full model, at a value of [`Self::shape`] if there is one; `None` where that model does not have it.
    fn around_sphere(&self, _sizes: &Sizes, _shape: Option<f64>) -> Option<SecondMatrix> {
        None
    }
}

impl Field {
    /// What is modelled, in a few plain words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Pair(pair) => pair.words(),
            Self::Pores(_) => "pore flow",
            Self::Nonlinear(NonlinearFamily::StrainStiffening) => "a spring that stiffens",
            Self::Nonlinear(NonlinearFamily::ShearThinning) => "a dashpot that thins",
            Self::Nonlinear(NonlinearFamily::YieldStress) => "a dashpot that yields",
            Self::Large => "large displacements",
        }
    }

    /// Why it cannot be computed for a robot on its mesh, if it cannot.
    pub fn lacks(self, surroundings: &Surroundings<'_>) -> Option<&'static str> {
        match self {
            Self::Pair(pair) => pair.lacks(surroundings),
            Self::Pores(_) if surroundings.mesh.element_kind == ElementKind::Tetrahedron4 => {
                Some("pore flow needs quadratic elements")
            }
            Self::Large if surroundings.sizes.ball.is_none() => {
                Some("large displacements are run around a sphere at the centre, on a mesh of the program's own")
            }
            _ => None,
        }
    }

    /// Whether its reduced model is learnt for one record, about the law that fits it, and not built for a gel.
    pub fn is_learnt_for_record(self) -> bool {
        matches!(self, Self::Large)
    }

    /// Whether the law is not linear in it.
    pub fn is_nonlinear(self) -> bool {
        matches!(self, Self::Nonlinear(_) | Self::Large)
    }

    /// Why a force that depends on the position cannot stand beside it, if it cannot.
    pub fn bars_feedback(self) -> Option<&'static str> {
        matches!(self, Self::Large).then_some(Spatial::BARS_FEEDBACK)
    }

    /// Whether it has mass, through which waves run.
    pub fn has_mass(self) -> bool {
        matches!(self, Self::Pair(pair) if pair.has_mass())
    }

    /// Steps the full model of a linear field through a record.
    ///
    /// # Errors
    /// Those of its parts; [`Error::Numerical`] for a law that is not linear.
    pub fn run(self, surroundings: &Surroundings<'_>, field: &LinearField, job: &SpatialJob<'_>) -> Result<SpatialRun> {
        let shape = field.shape.map(|shape| shape.value);
        match (self, shape, &field.beside) {
            (Self::Pair(pair), shape, beside) => {
                let FieldSystem { mesh, system } = pair.system(surroundings, shape)?;
                Ok(SpatialRun { mesh, ..job.run(&system, beside)? })
            }
            (Self::Pores(_), Some(drained_ratio), Beside::Friction { compliance }) => {
                job.run_pores(surroundings, compliance.value, drained_ratio)
            }
            _ => Err(Error::numerical(
                format!("`{}` has no matrices of its own", field.effect),
                "run it by the balance of `fe::nonlinear`, or by `fe::oldroyd`",
            )),
        }
    }

    /// Recorded positions (m) by the second full model of a linear field: elements of high order in the half meridian around a sphere at the centre, stepped through a record. `None` for
    /// other robots, for pore flow and for laws that are not linear.
    ///
    /// # Errors
    /// As [`Self::run`].
    pub fn run_in_half_meridian(
        self,
        surroundings: &Surroundings<'_>,
        field: &LinearField,
        job: &SpatialJob<'_>,
    ) -> Result<Option<Vec<f64>>> {
        let (Self::Pair(pair), Some(ball)) = (self, surroundings.sizes.ball) else { return Ok(None) };
        let shape = field.shape.map(|shape| shape.value);
        let Some(second) = pair.around_sphere(&surroundings.sizes, shape) else { return Ok(None) };
        let (radius_m, outer_radius_m) = (ball.robot_radius_m, ball.outer_radius_m);
        let system = pair_around_sphere(radius_m, outer_radius_m, surroundings.poisson_ratio, second)?;
        Ok(Some(SpatialJob { rows: &[], ..*job }.run(&system, &field.beside)?.position_m))
    }
}
