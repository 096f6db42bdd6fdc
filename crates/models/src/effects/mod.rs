//! Library of physical effects, one file each (physics §5).
//!
//! An effect belongs to one stage of command → load → mechanics → observation. At its null value the model equals the model without the
//! effect. Listing, help, prior checks, ranking and the conformance tests read [`EFFECTS`]. Apart from tests, no other file names an
//! effect.

mod actuator_lag;
mod clock_offset;
mod compressibility;
mod field;
mod field_conflicts;
mod first_body;
mod force_asymmetry;
mod force_bias;
mod force_gradient;
mod formula;
mod fractional_damping;
mod inertia;
mod instantaneous_elasticity;
mod interface_slip;
mod large_displacement;
mod library;
mod liquefied_pocket;
mod outer_wall_compliance;
mod poroelasticity;
mod position_offset;
mod second_retardation;
mod shear_thinning;
mod softening;
mod state_effect;
mod strain_stiffening;
#[cfg(test)]
mod test_scales;
mod tracking_drift;
mod yield_stress;

pub use field::{FieldEffect, FieldSystem, MatrixPair, ShapeParameter};
pub use formula::{Formula, FormulaError};
pub use large_displacement::{AMPLITUDE, MOBILITY, sphere_required_error};
pub use laws::stages::{DriftApproach, LinearField, Load, Observation, Spatial, Stages};
pub use library::{Library, parameter_named};
pub use position_offset::POSITION_OFFSET;
pub use state_effect::{QuantityName, StateEffect, define, defined};

use base::distribution::Distribution;
use base::error::Result;
use base::number::Dual;
use base::parameter::ParameterSpec;
use laws::rheology::BaseLaw;
use record::CharacteristicSizes;

/// All effects of the program, in the order in which a model applies them.
pub const EFFECTS: &[&dyn Effect] = &[
    &clock_offset::ClockOffset,
    &force_asymmetry::ForceAsymmetry,
    &force_bias::ForceBias,
    &actuator_lag::ActuatorLag,
    &force_gradient::ForceGradient,
    &instantaneous_elasticity::InstantaneousElasticity,
    &second_retardation::SecondRetardation,
    &fractional_damping::FractionalDamping,
    &softening::Softening,
    &compressibility::Compressibility,
    &inertia::Inertia,
    &interface_slip::InterfaceSlip,
    &liquefied_pocket::LiquefiedPocket,
    &outer_wall_compliance::OuterWallCompliance,
    &poroelasticity::Poroelasticity,
    &strain_stiffening::StrainStiffening,
    &shear_thinning::ShearThinning,
    &yield_stress::YieldStress,
    &large_displacement::LargeDisplacement,
    &tracking_drift::TrackingDrift,
];

/// Nuisances, which are unknowns of an experiment and not of the gel. Every model of an experiment with nuisances applies them before its
/// effects. Users cannot add them.
pub const NUISANCES: &[&dyn Effect] = &[&position_offset::PositionOffset];

/// Nuisances of the experiment with these sizes.
pub fn nuisances(scales: &CharacteristicSizes) -> &'static [&'static dyn Effect] {
    if scales.fits_position_offset { NUISANCES } else { &[] }
}

/// Measured range of positions in m, which scales default priors. Without measurements it is a millimetre, the largest
/// displacement of the reference experiment (physics §1).
fn position_range_m(scales: &CharacteristicSizes) -> f64 {
    if scales.position_range_m > 0.0 { scales.position_range_m } else { 1e-3 }
}

/// Radius of the robot in m, which scales default priors. It is a millimetre for an instrument.
fn robot_radius_m(scales: &CharacteristicSizes) -> f64 {
    scales.robot_radius_m.unwrap_or(1e-3)
}

/// Largest force in N, which scales default priors. It is a micronewton if no force is commanded.
fn largest_force_n(scales: &CharacteristicSizes) -> f64 {
    if scales.largest_force_n > 0.0 { scales.largest_force_n } else { 1e-6 }
}

/// Viscosity (Pa·s) at which the largest force moves the robot through the range of positions in one hold, by Stokes' law.
fn apparent_viscosity_pa_s(scales: &CharacteristicSizes) -> f64 {
    let force_n = largest_force_n(scales);
    force_n * hold_s(scales) / (6.0 * std::f64::consts::PI * robot_radius_m(scales) * position_range_m(scales))
}

/// Time in s between force steps, which scales laws and default priors. It is a second for a record without force steps.
fn hold_s(scales: &CharacteristicSizes) -> f64 {
    if scales.hold_s > 0.0 { scales.hold_s } else { 1.0 }
}

/// Stress s₀ = F_max/(4πR²) in Pa: the largest force divided by the area of the robot's surface, both of the record that taught the law.
fn reference_stress_pa(scales: &CharacteristicSizes) -> f64 {
    let radius_m = scales.taught_radius_m.unwrap_or_else(|| robot_radius_m(scales));
    largest_force_n(scales) / (4.0 * std::f64::consts::PI * radius_m.powi(2))
}

base::named_enum! {
    /// Stage between the command and the camera at which an effect acts.
    #[derive(PartialOrd, Ord)]
    pub enum Stage {
        /// Stage between the command and the force on the robot.
        Load = "load",
        /// Stage between the force and the robot's position.
        Mechanics = "mechanics",
        /// Stage between the robot's position and the recorded position.
        Observation = "observation",
    }
    /// Name of the stage in lists and JSON.
    pub fn name
}

/// Function of the characteristic sizes of an experiment, such as its largest force and its duration.
pub type ScaleFunction<T> = dyn Fn(&CharacteristicSizes) -> T + Send + Sync;

/// Parameter of an effect, with its name, symbol, unit, support, null and default prior.
#[derive(Clone, Copy)]
pub struct EffectParameter {
    /// Name `slug.name`, symbol, unit and support.
    pub spec: ParameterSpec,
    /// Value at which the effect vanishes; `None` if the parameter is unidentified at the effect's null.
    pub null: &'static ScaleFunction<Option<f64>>,
    /// Default prior, scaled by the sizes of the experiment.
    pub prior: &'static ScaleFunction<Distribution>,
    /// Source of the numbers in the default prior.
    pub prior_source: &'static str,
}

/// Name, stage, texts and parameters of an effect.
#[derive(Clone, Copy)]
pub struct EffectDescription {
    /// Name of the effect in commands, files and parameter names.
    pub slug: &'static str,
    /// Stage at which the effect acts.
    pub stage: Stage,
    /// Description in a few plain words.
    pub summary: &'static str,
    /// Equation, as text.
    pub equation: &'static str,
    /// Parameters, in the order in which [`Effect::apply`] takes them.
    pub parameters: &'static [EffectParameter],
}

/// Physical effect that a base model may lack.
pub trait Effect: Sync {
    /// Name, stage, texts and parameters of the effect.
    fn description(&self) -> EffectDescription;
    /// [`EffectDescription::slug`].
    fn slug(&self) -> &'static str {
        self.description().slug
    }
    /// [`EffectDescription::stage`].
    fn stage(&self) -> Stage {
        self.description().stage
    }
    /// [`EffectDescription::parameters`].
    fn parameters(&self) -> &'static [EffectParameter] {
        self.description().parameters
    }
    /// Equations of the displacement field; `None` if the effect only multiplies the base law's field by a factor. A model may have at most
    /// one effect with such equations.
    fn field(&self) -> Option<FieldEffect> {
        None
    }
    /// Returns `true` if the effect changes the displacement field by more than a factor.
    fn changes_field(&self) -> bool {
        self.field().is_some()
    }
    /// Returns `true` if the effect needs finite elements, which an instrument does not have.
    fn needs_finite_elements(&self) -> bool {
        self.changes_field()
    }
    /// Reason why the effect cannot be combined with an effect on the displacement field ([`Self::field`]); `None` if it can.
    fn conflict_with_field(&self, _field: FieldEffect) -> Option<&'static str> {
        None
    }
    /// Value of the first parameter at which the effect's signature (the change of the trajectory that it causes) is computed. The value is
    /// given if a small effect is to first order equivalent to a change of the law's parameters; `None` for other effects. The signature is
    /// then the residual of the best fit by the law's parameters, which grows with the square of the value.
    fn signature_size(&self, _scales: &CharacteristicSizes) -> Option<f64> {
        None
    }
    /// Step of the first parameter from its null by which the effect's signature (the change of the trajectory that it causes) is computed. The
    /// step is needed if the derivative at the null vanishes, jumps or cannot be computed. `None` if the signature is this derivative.
    fn finite_step(&self, _scales: &CharacteristicSizes) -> Option<f64> {
        None
    }
    /// Returns `true` if the effect depends on the robot's position. The position must then be linear in the force.
    fn depends_on_position(&self) -> bool {
        false
    }
    /// Returns `true` if the effect makes a quantity depend on a state. A model may have at most one effect that depends on a state, and no
    /// other effect that depends on the position.
    fn depends_on_state(&self) -> bool {
        false
    }
    /// Returns `true` if the effect makes the law nonlinear. It can then be combined with effects of load and observation only.
    fn is_nonlinear(&self) -> bool {
        self.field().is_some_and(FieldEffect::is_nonlinear)
    }
    /// Returns `true` if the effect's reduced model is trained for each record, around the law that fits this record, instead of once for
    /// each gel.
    fn is_learnt_for_record(&self) -> bool {
        self.field().is_some_and(FieldEffect::is_learnt_for_record)
    }
    /// Returns `true` if the effect's equation contains the largest force of the record.
    fn refers_to_largest_force(&self) -> bool {
        false
    }
    /// Reason why the effect cannot be added to this base law; `None` if it can.
    fn conflict(&self, _base: &BaseLaw) -> Option<&'static str> {
        None
    }
    /// Writes the effect into the stages, the model's equations. `parameters` are in SI units and inside their supports. Effects with a
    /// [`Self::field`] are applied last, after all other effects have changed the law.
    ///
    /// # Errors
    /// [`base::Error::Numerical`] if there is no model at these parameters.
    fn apply(&self, parameters: &[Dual], scales: &CharacteristicSizes, stages: &mut Stages) -> Result<()>;
}
