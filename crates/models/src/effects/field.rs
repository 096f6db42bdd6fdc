//! Equations of effects on the displacement field, for the full-order model and its reduction.
//!
//! [`FieldEffect`] has four kinds, which differ in their equations, not in their physics. An effect of the kind [`FieldEffect::Pair`] only
//! defines two matrices. [`elements::fe::spatial`] steps them in time, `surrogate` reduces them to terms, and `rheology::AdditionalTerm`
//! converts the terms into a creep compliance.

use base::error::{Error, Result};
use elements::fe::meridional::{EffectMatrix, build_effect_system};
use elements::fe::spatial::{
    GelAndRobot, MatrixSplitting, PhysicalProperties, SpatialInput, SpatialResult, SpatialSystem,
};
use elements::mesh::{ElementKind, Mesh};
use laws::rheology::AdditionalTerm;
use laws::stages::{LinearField, NonlinearFamily, Spatial};

/// Kind of equations of an effect on the displacement field.
#[derive(Clone, Copy)]
pub enum FieldEffect {
    /// Linear equations: two matrices with scalar factors.
    Pair(&'static dyn MatrixPair),
    /// Biot's equations of pore flow (physics §4.9). The element in parallel with the law is [`AdditionalTerm::Friction`] with
    /// the water's mobility as its compliance. The shape of the field depends on the drained Poisson ratio. The function returns
    /// the range of drained ratios for an undrained ratio.
    Pores(fn(f64) -> [f64; 2]),
    /// Nonlinear law at small strains.
    Nonlinear(NonlinearFamily),
    /// Large strains, in a gel that is an Oldroyd-B or a Giesekus fluid.
    Large,
}

/// Reason why mass or large strains cannot be combined with a law with springpots.
pub(super) const SPRINGPOTS: &str = "mass and large displacements cannot be computed for a law with springpots";

/// Matrices of a linear field at one value of its [`ShapeParameter`].
pub struct FieldSystem {
    /// Mesh of the matrices; `None` if they use the mesh of the gel and robot.
    pub mesh: Option<Mesh>,
    /// Both matrices of the linear equations, with their unknowns.
    pub system: SpatialSystem,
}

/// Parameter of an effect on which the shape of the displacement field depends, such as a pocket's radius.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShapeParameter {
    /// Name of the shape parameter.
    pub name: &'static str,
    /// Lower and upper end of the shape parameter.
    pub range: [f64; 2],
}

/// Two matrices on one set of unknowns. The gel's law multiplies the first matrix. An additional element in parallel with the law (a
/// dashpot, a mass or another law) multiplies the second matrix.
pub trait MatrixPair: Sync {
    /// Short name of the effect for messages, such as "mass".
    fn words(&self) -> &'static str;
    /// Reason why the effect cannot be computed for this robot and mesh; `None` if it can.
    fn lacks(&self, _surroundings: &GelAndRobot<'_>) -> Option<&'static str> {
        None
    }
    /// Returns `true` if the additional element is a mass. A spring in series then transmits waves.
    fn has_mass(&self) -> bool {
        false
    }
    /// Parameter on which the matrices depend in addition to gel and robot; `None` without such a parameter. Let θ be the fraction of an
    /// eigenvector's stiffness that comes from the second matrix. For a pair with a shape parameter, θ must have exactly three values
    /// (physics §7.2): 0, one value between, and 1.
    fn shape(&self) -> Option<ShapeParameter> {
        None
    }
    /// Settings for the reduction of the matrices to terms. They include factors x of the second matrix at which the full-order equations
    /// are solved.
    fn splitting(&self, sizes: &PhysicalProperties) -> MatrixSplitting;
    /// Assembles the matrices, at a value of [`Self::shape`] if the pair has a shape parameter.
    ///
    /// # Errors
    /// [`Error::Numerical`] for inverted elements, for meshes without a robot, and for meshes that [`Self::lacks`] refuses.
    fn system(&self, surroundings: &GelAndRobot<'_>, shape: Option<f64>) -> Result<FieldSystem>;
    /// Additional element around a central sphere, for the second full-order model (high-order elements in the half meridian plane).
    /// `_shape` is a value of [`Self::shape`], if the pair has one. `None` if the second full-order model does not cover the effect.
    fn around_sphere(&self, _sizes: &PhysicalProperties, _shape: Option<f64>) -> Option<EffectMatrix> {
        None
    }
}

impl FieldEffect {
    /// Short name of the effect for messages, such as "pore flow".
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

    /// Reason why the effect cannot be computed for this robot and mesh; `None` if it can.
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

    /// Returns `true` if the effect's reduced model is trained for each record, around the law that fits this record, instead of once for
    /// each gel.
    pub fn is_learnt_for_record(self) -> bool {
        matches!(self, Self::Large)
    }

    /// Returns `true` if the effect makes the law nonlinear.
    pub fn is_nonlinear(self) -> bool {
        matches!(self, Self::Nonlinear(_) | Self::Large)
    }

    /// Reason why a position-dependent force cannot be combined with this field; `None` if it can.
    pub fn feedback_conflict(self) -> Option<&'static str> {
        matches!(self, Self::Large).then_some(Spatial::EXCLUDES_FEEDBACK)
    }

    /// Returns `true` if the field has mass, so that waves travel through it.
    pub fn has_mass(self) -> bool {
        matches!(self, Self::Pair(pair) if pair.has_mass())
    }

    /// Returns positions and displacement fields of a linear effect, by stepping the full-order model through a record.
    ///
    /// # Errors
    /// Errors of the meshes, matrices and time steps. [`Error::Numerical`] for an effect with a nonlinear law.
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

    /// Returns the recorded positions (m) by the second full-order model of a linear effect. This model steps high-order elements in the
    /// half meridian plane around a central sphere. `None` for other robots, for pore flow and for nonlinear laws.
    ///
    /// # Errors
    /// Errors of [`Self::run`].
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
