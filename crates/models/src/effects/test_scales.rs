//! Sizes and functions that the effects' tests share.

use base::number::{Dual, Scalar};
use laws::rheology::{Element, RetardationSpectrum, TimeWindow};
use record::CharacteristicSizes;

/// Sizes close to those of the reference experiment.
pub(super) const SCALES: CharacteristicSizes = CharacteristicSizes {
    largest_force_n: 4.6e-6,
    position_range_m: 0.98e-3,
    hold_s: 5.0,
    cycle_s: 10.0,
    sample_interval_s: 0.05,
    duration_s: 40.0,
    poisson_ratio: Some(0.48),
    robot_radius_m: Some(0.275e-3),
    taught_radius_m: Some(0.275e-3),
    outer_radius_m: Some(10e-3),
    depth_exponent: None,
    fits_position_offset: false,
    is_position_controlled: false,
};

/// Returns the creep compliance J(t) in 1/Pa of elements in series, from their retardation spectrum.
pub(super) fn compliance_per_pa(law: &[Element], time_s: f64) -> Dual {
    let spectrum = RetardationSpectrum::of_law(law, TimeWindow { shortest_s: 0.01, longest_s: 100.0 }).unwrap();
    let steady = spectrum.instantaneous_per_pa + spectrum.fluidity_per_pa_s * time_s;
    spectrum
        .modes
        .iter()
        .fold(steady, |sum, mode| sum - mode.compliance_per_pa * (-(mode.rate_per_s * time_s)).exp_m1())
}
