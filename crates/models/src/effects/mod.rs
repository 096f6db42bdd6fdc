//! The library of physical effects: one file each (physics §5).
//!
//! An effect belongs to one stage of command → load → mechanics → observation and is nested: at its null value the model is the one without
//! it. Listing, help, prior checks, ranking and the conformance tests read [`EFFECTS`]; no other file names an effect.

mod actuator_lag;
mod beside_fields;
mod clock_offset;
mod compressibility;
mod field;
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

pub use field::{Field, FieldSystem, MatrixPair, ShapeParameter};
pub use formula::{Formula, Mistake};
pub use large_displacement::{AMPLITUDE, MOBILITY, needs_a_sphere};
pub use laws::stages::{Approach, LinearField, Load, Observation, Spatial, Stages};
pub use library::{Library, parameter_named};
pub use state_effect::{QuantityName, StateEffect, define, defined};

use base::distribution::Distribution;
use base::error::Result;
use base::number::Dual;
use base::parameter::ParameterSpec;
use laws::rheology::BaseLaw;
use record::Scales;

/// All effects, in the order in which a model applies them.
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

/// Nuisances of an experiment itself, which every model of it has before its effects: they are no claims about the gel, and no one adds them.
pub const NUISANCES: &[&dyn Effect] = &[&position_offset::PositionOffset];

/// Those that an experiment has.
pub fn nuisances(scales: &Scales) -> &'static [&'static dyn Effect] {
    if scales.fits_position_offset { NUISANCES } else { &[] }
}

/// Range of positions by which default priors are scaled, in m: the measured one, or a millimetre, the largest displacement of the
/// reference experiment (physics §1), where nothing is measured.
fn position_range_m(scales: &Scales) -> f64 {
    if scales.position_range_m > 0.0 { scales.position_range_m } else { 1e-3 }
}

/// Radius of the robot by which default priors are scaled, in m; a millimetre for an instrument.
fn robot_radius_m(scales: &Scales) -> f64 {
    scales.robot_radius_m.unwrap_or(1e-3)
}

/// Largest force by which default priors are scaled, in N; a micronewton where none is commanded.
fn largest_force_n(scales: &Scales) -> f64 {
    if scales.largest_force_n > 0.0 { scales.largest_force_n } else { 1e-6 }
}

/// The viscosity (Pa·s) at which the largest force would move the robot through the range of positions in one hold, by Stokes' law.
fn apparent_viscosity_pa_s(scales: &Scales) -> f64 {
    let force_n = largest_force_n(scales);
    force_n * hold_s(scales) / (6.0 * std::f64::consts::PI * robot_radius_m(scales) * position_range_m(scales))
}

/// Time in s between force steps by which laws and priors are scaled; a second where there is none.
fn hold_s(scales: &Scales) -> f64 {
    if scales.hold_s > 0.0 { scales.hold_s } else { 1.0 }
}

/// s₀ = F_max/(4πR²) in Pa: the largest force over the robot's surface.
fn reference_stress_pa(scales: &Scales) -> f64 {
    largest_force_n(scales) / (4.0 * std::f64::consts::PI * robot_radius_m(scales).powi(2))
}

/// Where in the way from the command to the camera an effect acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// Between the command and the force on the robot.
    Load,
    /// Between the force and the robot's position.
    Mechanics,
    /// Between the robot's position and the recorded one.
    Observation,
}

impl Stage {
    /// Name in lists and JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Load => "load",
            Self::Mechanics => "mechanics",
            Self::Observation => "observation",
        }
    }
}

/// What the sizes of an experiment make of something.
pub type OfScales<T> = dyn Fn(&Scales) -> T + Send + Sync;

/// One parameter of an effect: the only place where its name, symbol, unit, support, null and default prior stand.
#[derive(Clone, Copy)]
pub struct EffectParameter {
    /// Name `slug.name`, symbol, unit, support.
    pub spec: ParameterSpec,
    /// Value at which the effect is not there; `None` where the parameter means nothing at the effect's null.
    pub null: &'static OfScales<Option<f64>>,
    /// Default prior, scaled by the experiment.
    pub prior: &'static OfScales<Distribution>,
    /// Where the prior's numbers come from.
    pub prior_source: &'static str,
    /// Step from the null by which a signature is taken where the derivative at the null vanishes, jumps or cannot be computed; `None` where the
    /// derivative serves.
    pub finite_step: Option<&'static OfScales<f64>>,
}

impl std::fmt::Debug for EffectParameter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("EffectParameter").field("spec", &self.spec).finish_non_exhaustive()
    }
}

/// A physical effect that a base model may lack.
pub trait Effect: Sync {
    /// Name in commands, files and parameters.
    fn slug(&self) -> &'static str;
    /// Its stage.
    fn stage(&self) -> Stage;
    /// What it adds, in a few plain words.
    fn summary(&self) -> &'static str;
    /// Its equation, as text.
    fn equation(&self) -> &'static str;
    /// Its parameters, in the order in which [`Effect::apply`] takes them.
    fn parameters(&self) -> &'static [EffectParameter];
    /// How it changes the displacement field, if it does in more than a factor; one such effect a model.
    fn field(&self) -> Option<Field> {
        None
    }
    /// Whether the displacement field is another than the base's.
    fn changes_field(&self) -> bool {
        self.field().is_some()
    }
    /// Whether it needs finite elements, which an instrument does not have.
    fn needs_finite_elements(&self) -> bool {
        self.changes_field()
    }
    /// Why it cannot stand beside an effect with a [`Self::field`], if it cannot.
    fn barred_beside(&self, _field: Field) -> Option<&'static str> {
        None
    }
    /// Size of the first parameter at which the effect shows, where a small one is to first order nothing but other values of the law's parameters: its signature is then
    /// what the best of those leaves at this size, and grows with the square of the size.
    fn shows_at(&self, _scales: &Scales) -> Option<f64> {
        None
    }
    /// Whether it speaks of the robot's position where it acts, which only a position that answers linearly lets it do.
    fn acts_on_position(&self) -> bool {
        false
    }
    /// Whether by it a quantity depends on a state; one such effect a model, and none beside it that speaks of the position itself.
    fn depends_on_state(&self) -> bool {
        false
    }
    /// Whether its law is not linear: beside such an effect only those of load and observation stand.
    fn is_nonlinear(&self) -> bool {
        self.field().is_some_and(Field::is_nonlinear)
    }
    /// Whether its reduced model is learnt for one record, about the law that fits it, and not built for a gel.
    fn is_learnt_for_record(&self) -> bool {
        self.field().is_some_and(Field::is_learnt_for_record)
    }
    /// Why it cannot be added to this base law, if it cannot.
    fn conflict(&self, _base: &BaseLaw) -> Option<&'static str> {
        None
    }
    /// Writes the effect at `parameters` (SI, inside the support) into the stages. Effects with a [`Self::field`] come last, so that they find the law as the others have
    /// made it.
    ///
    /// # Errors
    /// [`base::Error::Numerical`] where there is no model at these parameters.
    fn apply(&self, parameters: &[Dual], scales: &Scales, stages: &mut Stages) -> Result<()>;
}
