//! Effects on the displacement field: their part of the full-order model, and its reduction.
//!
//! There are four kinds, which differ by their mathematics and not by their physics. An effect of the first kind defines its matrices, and the rest follows:
//! [`elements::fe::spatial`] steps them, `surrogate` reduces them to terms, and `rheology::AdditionalTerm` converts the terms into creep.

use base::error::{Error, Result};
use elements::fe::meridional::{EffectMatrix, build_effect_system};
use elements::fe::spatial::{
    GelAndRobot, MatrixSplitting, PhysicalProperties, SpatialInput, SpatialResult, SpatialSystem,
};
use elements::mesh::{ElementKind, Mesh};
use laws::rheology::AdditionalTerm;
use laws::stages::{LinearField, NonlinearFamily, Spatial};

/// Mathematics of an effect on the displacement field.
#[derive(Clone, Copy)]
pub enum FieldEffect {
    /// Linear, with two matrices and scalar factors.
    Pair(&'static dyn MatrixPair),
    /// Biot's equations (physics §4.9). The element beside the law is [`AdditionalTerm::Friction`] with the mobility as its compliance. The field's shape depends on the
    /// drained Poisson ratio; the function returns the range of drained ratios for an undrained one.
    Pores(fn(f64) -> [f64; 2]),
    /// Nonlinear law.
    Nonlinear(NonlinearFamily),
    /// Large strains.
    Large,
}

/// Reason why a field cannot be computed for a law with springpots.
pub(super) const SPRINGPOTS: &str = "mass and large displacements cannot be computed for a law with springpots";

/// Matrices for one shape of the field.
pub struct FieldSystem {
    /// Mesh; `None` for the surroundings' own.
    pub mesh: Option<Mesh>,
    /// Matrices of the field.
    pub system: SpatialSystem,
}

/// Parameter on which the field's shape depends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShapeParameter {
    /// Name of the parameter.
    pub name: &'static str,
    /// Range of the parameter.
    pub range: [f64; 2],
}

/// Two matrices on one set of unknowns: the gel's law multiplies the first, the element beside the law the second.
pub trait MatrixPair: Sync {
    /// Name of the effect in messages.
    fn words(&self) -> &'static str;
    /// Reason why it cannot be computed for a robot on its mesh; `None` if it can.
    fn lacks(&self, _surroundings: &GelAndRobot<'_>) -> Option<&'static str> {
        None
    }
    /// Returns `true` if the element beside the law is a mass. A spring in series then transmits waves.
    fn has_mass(&self) -> bool {
        false
    }
    /// Parameter of the matrices besides gel and robot, if there is one. Such a pair must have exactly three shares
    /// θ (physics §7.2): 0, one between, and 1.
    fn shape(&self) -> Option<ShapeParameter> {
        None
    }
    /// Splitting of the matrices into terms.
    fn splitting(&self, sizes: &PhysicalProperties) -> MatrixSplitting;
    /// Assembles the matrices, at a value of [`Self::shape`] if there is one.
    ///
    /// # Errors
    /// [`Error::Numerical`] for inverted elements, for meshes without a robot, and for meshes that [`Self::lacks`] refuses.
    fn system(&self, surroundings: &GelAndRobot<'_>, shape: Option<f64>) -> Result<FieldSystem>;
    /// Element beside the law around a sphere, for the second full-order model, at a value of [`Self::shape`] if there is one.
    /// `None` if that model does not cover the effect.
    fn around_sphere(&self, _sizes: &PhysicalProperties, _shape: Option<f64>) -> Option<EffectMatrix> {
        None
    }
}

impl FieldEffect {
    /// Name of the effect in messages.
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

    /// Reason why it cannot be computed for a robot on its mesh; `None` if it can.
    pub fn lacks(self, surroundings: &GelAndRobot<'_>) -> Option<&'static str> {
        match self {
            Self::Pair(pair) => pair.lacks(surroundings),
            Self::Pores(_) if surroundings.mesh.element_kind == ElementKind::Tetrahedron4 => {
                Some("pore flow needs quadratic elements")
            }
            Self::Large if surroundings.sizes.ball.is_none() => {
                Some("large displacements need a sphere at the centre and the built-in mesh")
            }
            _ => None,
        }
    }

    /// Returns `true` if its reduced model is trained for one record, around the law that fits it, instead of once for a gel.
    pub fn is_learnt_for_record(self) -> bool {
        matches!(self, Self::Large)
    }

    /// Returns `true` if the effect makes the law nonlinear.
    pub fn is_nonlinear(self) -> bool {
        matches!(self, Self::Nonlinear(_) | Self::Large)
    }

    /// Reason why a position-dependent force cannot be combined with it; `None` if it can.
    pub fn feedback_conflict(self) -> Option<&'static str> {
        matches!(self, Self::Large).then_some(Spatial::EXCLUDES_FEEDBACK)
    }

    /// Returns `true` if it has mass, through which waves travel.
    pub fn has_mass(self) -> bool {
        matches!(self, Self::Pair(pair) if pair.has_mass())
    }

    /// Steps the full-order model of a linear field through a record.
    ///
    /// # Errors
    /// Those of its parts. [`Error::Numerical`] for a nonlinear law.
    pub fn run(
        self,
        surroundings: &GelAndRobot<'_>,
        field: &LinearField,
        job: &SpatialInput<'_>,
    ) -> Result<SpatialResult> {
        let shape = field.shape.map(|shape| shape.value);
        match (self, shape, &field.beside) {
            (Self::Pair(pair), shape, beside) => {
                let FieldSystem { mesh, system } = pair.system(surroundings, shape)?;
                Ok(SpatialResult { mesh, ..job.run(&system, beside)? })
            }
            (Self::Pores(_), Some(drained_ratio), AdditionalTerm::Friction { compliance }) => {
                job.run_pores(surroundings, compliance.value, drained_ratio)
            }
            _ => Err(Error::numerical(
                format!("`{}` has no pair of matrices", field.effect),
                "use `fe::nonlinear` or `fe::oldroyd` for it",
            )),
        }
    }

    /// Recorded positions (m) by the second full-order model of a linear field. It steps high-order elements in the half meridian around a central sphere.
    /// `None` for other robots, for pore flow and for nonlinear laws.
    ///
    /// # Errors
    /// Those of [`Self::run`].
    pub fn run_in_half_meridian(
        self,
        surroundings: &GelAndRobot<'_>,
        field: &LinearField,
        job: &SpatialInput<'_>,
    ) -> Result<Option<Vec<f64>>> {
        let (Self::Pair(pair), Some(ball)) = (self, surroundings.sizes.ball) else { return Ok(None) };
        let shape = field.shape.map(|shape| shape.value);
        let Some(second) = pair.around_sphere(&surroundings.sizes, shape) else { return Ok(None) };
        let (radius_m, outer_radius_m) = (ball.robot_radius_m, ball.outer_radius_m);
        let system = build_effect_system(radius_m, outer_radius_m, surroundings.poisson_ratio, second)?;
        Ok(Some(SpatialInput { rows: &[], ..*job }.run(&system, &field.beside)?.position_m))
    }
}
