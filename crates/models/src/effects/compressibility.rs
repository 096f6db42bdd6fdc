//! `compressibility`: the gel's Poisson ratio differs from the one in the experiment's file.
//!
//! The finite-element stiffness for unit Young's modulus is 2 μ(ν) K_dev + κ(ν) K_vol. K_dev and K_vol are its deviatoric and volumetric
//! matrices, μ = 1/(2(1+ν)) is the shear modulus, and κ = 1/(3(1−2ν)) the bulk modulus. Null: the Poisson ratio ν of the experiment. Valid
//! for −1 < ν < 0.5. A gel that can lose water is more compressible than its instantaneous response suggests. In a creep test at one place
//! the effect only rescales Young's modulus and the viscosities (physics §5), so the data cannot distinguish it from these parameters.
//! Sources for the response of a tracked sphere as a function of ν: physics §4.1; Schnurr et al. 1997, Macromolecules 30:7781.

use super::{Effect, EffectDescription, EffectParameter, Stage, Stages};
use base::distribution::Distribution;
use base::error::{Error, Result};
use base::number::Dual;
use base::parameter::{ParameterSpec, Support};
use record::CharacteristicSizes;

/// Limits of the Poisson ratio. At each limit, the shear or the bulk modulus for unit Young's modulus is infinite.
const ENDS: (f64, f64) = (-1.0, 0.5);

/// Uniform prior of the Poisson ratio from 0.3 to 0.499. If the experiment's ratio is outside or near an end, the range is widened to
/// contain it.
fn prior(scales: &CharacteristicSizes) -> Distribution {
    let (lowest, highest) = (0.3, 0.499);
    let Some(value) = scales.poisson_ratio else { return Distribution::Uniform { lower: lowest, upper: highest } };
    let halfway = |end: f64| 0.5 * (value + end);
    Distribution::Uniform {
        lower: f64::min(lowest, value - 0.18).max(halfway(ENDS.0)),
        upper: f64::max(highest, halfway(ENDS.1)),
    }
}

const PARAMETERS: &[EffectParameter] = &[EffectParameter {
    spec: ParameterSpec::new("compressibility.poisson_ratio", "ν", "1", Support { lower: ENDS.0, upper: ENDS.1 }),
    null: &|scales| scales.poisson_ratio,
    prior: &prior,
    prior_source: "chosen: from a drained gel, 0.3, to a nearly incompressible one, 0.499, and around the experiment's ratio",
}];

/// Effect `compressibility`: the gel's Poisson ratio differs from the one in the experiment's file.
pub struct Compressibility;

impl Effect for Compressibility {
    fn description(&self) -> EffectDescription {
        EffectDescription {
            slug: "compressibility",
            stage: Stage::Mechanics,
            summary: "the gel's Poisson ratio differs from the one in the file",
            equation: "K = 2 μ(ν) K_dev + κ(ν) K_vol",
            parameters: PARAMETERS,
        }
    }
    fn changes_field(&self) -> bool {
        true
    }
    fn apply(&self, parameters: &[Dual], scales: &CharacteristicSizes, stages: &mut Stages) -> Result<()> {
        let ratio = parameters[0];
        if !(ratio.value > ENDS.0 && ratio.value < ENDS.1) {
            return Err(Error::numerical(
                format!("{} = {} is not inside ({}, {})", PARAMETERS[0].spec.name, ratio.value, ENDS.0, ENDS.1),
                "give a Poisson ratio between the ends",
            ));
        }
        if !scales.poisson_ratio.is_some_and(|value| ratio.is_constant(value)) {
            stages.poisson_ratio = Some(ratio);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::test_scales::SCALES;
    use elements::fe::exact::sphere_in_infinite_medium_n_per_m;

    fn ratio_written(parameter: Dual) -> Option<Dual> {
        let mut stages = Stages::of_law(Vec::new());
        Compressibility.apply(&[parameter], &SCALES, &mut stages).unwrap();
        stages.poisson_ratio
    }

    #[test]
    fn the_experiments_own_ratio_is_left_alone_and_any_other_is_written() {
        assert_eq!(ratio_written(0.48.into()), None);
        assert_eq!(ratio_written(Dual::variable(0.48)), Some(Dual::variable(0.48)));
        assert_eq!(ratio_written(0.4.into()), Some(0.4.into()));
    }

    /// Checks the displacement per force of a sphere in an infinite medium, (1+ν)(5−6ν)/(12π E R(1−ν)) with ν Poisson's ratio, E Young's
    /// modulus and R the radius (physics §4.1). The displacement changes by a few per cent over the whole prior, and a change of E
    /// compensates this.
    #[test]
    fn the_response_moves_by_less_than_a_twelfth_over_the_prior() {
        let Distribution::Uniform { lower, upper } = prior(&SCALES) else { panic!("not uniform") };
        assert_eq!((lower, upper), (0.3, 0.499));
        let stiffness = |ratio: f64| sphere_in_infinite_medium_n_per_m(1.0, ratio, 0.275e-3);
        let change = stiffness(lower) / stiffness(upper) - 1.0;
        assert!(change.abs() < 1.0 / 12.0, "{change}");
    }

    #[test]
    fn the_ends_are_refused() {
        for end in [-1.0, 0.5] {
            let mut stages = Stages::of_law(Vec::new());
            let error = Compressibility.apply(&[end.into()], &SCALES, &mut stages).unwrap_err();
            assert!(error.to_string().contains("compressibility.poisson_ratio"), "{error}");
        }
    }
}
