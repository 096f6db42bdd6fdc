//! What a model leaves of a record, judged: the one rule of `fit`, `sample`, `extend` and `ladder` (docs/diagnosis.md).
//!
//! Where the noise is given or estimated, misfits are measured against it ([`Misfit`]). Where it is unknown, the held-out cycles are measured against what
//! the fitted ones leave, and the residuals are tested for patterns ([`SystematicTest`]). Where draws predict the held-out cycles together, their band counts
//! as well.

use documents::posterior::{Warning, WarningKind};
use figures::number::significant;
use record::{NoiseOrigin, NoiseYardstick};

use super::misfit::{Gains, Misfit, OUTSIDE_BAND, Remainder};
use super::noise::{NoiseLikelihood, NoiseModel};
use super::problem::Problem;
use super::systematic::SystematicTest;

/// Share of the range of positions below which residuals are the rounding of files and solvers, and no pattern in them means anything.
const ROUNDING: f64 = 1e-6;

/// A fitted model's prediction of a whole record.
pub struct Prediction<'a> {
    /// Position (m) at every row.
    pub position_m: &'a [f64],
    /// Columns (m, one value a row) along which the parameters can move it.
    pub columns_m: &'a [Vec<f64>],
    /// The noise that was fitted beside it, with its parameters.
    pub noise: (NoiseModel, &'a [f64]),
    /// Size (m) of the noise that was learnt from row to row; `None` where none is learnt.
    pub learnt_noise_m: Option<f64>,
    /// Probability, by joint predictive simulation, that the held-out cycles are missed by as much; `None` where nothing was simulated.
    pub joint_p: Option<f64>,
}

/// What was found of a prediction.
#[derive(Debug, Clone, PartialEq)]
pub struct Judgement {
    /// The residuals beside the noise, or, where that is unknown, the held-out ones beside the fitted ones.
    pub misfit: Option<Misfit>,
    /// Whether the noise is neither given nor estimated.
    pub is_noise_unknown: bool,
    /// The residuals' test for patterns, where the noise is unknown and they can be tested.
    pub systematic: Option<SystematicTest>,
    /// See [`Prediction::learnt_noise_m`].
    pub learnt_noise_m: Option<f64>,
    /// See [`Prediction::joint_p`].
    pub joint_p: Option<f64>,
    /// Whether the noise has a gain and an offset for each cycle.
    pub has_gain: bool,
}

impl Judgement {
    /// Judges a prediction; `yardstick` is the noise that the record gives or shows.
    pub fn of(problem: &Problem, prediction: &Prediction, yardstick: Option<NoiseYardstick>) -> Self {
        let (experiment, record) = (&problem.experiment, &problem.experiment.record);
        let Prediction { position_m, columns_m, noise: (noise, parameters), learnt_noise_m, joint_p } = *prediction;
        let fitted = problem.positions_of(&experiment.calibration_cycles);
        let left = |positions: &[Option<f64>]| -> Vec<Option<f64>> {
            positions.iter().zip(position_m).map(|(y, x)| y.map(|y| y - x)).collect()
        };
        let has_gain = noise.names().contains(&"gain");
        let remainder = Remainder {
            record,
            fitted_m: &left(&fitted),
            heldout_m: &left(&problem.positions_of(&experiment.heldout_cycles)),
            position_m,
            absorbed_m: columns_m,
            gains: if has_gain { Gains::Declared } else { Gains::None },
        };
        let misfit = match yardstick {
            Some(NoiseYardstick { sd_m, origin }) => Misfit::of(&remainder, sd_m, matches!(origin, NoiseOrigin::Known)),
            None => Misfit::beside_fitted(&remainder),
        };
        let systematic = yardstick.is_none().then(|| {
            let mut columns: Vec<Vec<f64>> = columns_m.to_vec();
            columns.push(remainder.fitted_m.iter().map(|left| left.unwrap_or(0.0)).collect());
            let likelihood = NoiseLikelihood::new(noise, &record.time_s, &problem.recordings(), &fitted);
            let mut white = likelihood.whiten(&columns, position_m, parameters);
            white.pop().and_then(|residuals| SystematicTest::of(&residuals, &white))
        });
        let range_m = experiment.scales().position_range_m;
        let is_rounding = misfit.is_some_and(|misfit| misfit.fitted.rms_m < ROUNDING * range_m);
        let systematic =
            systematic.flatten().map(|test| if is_rounding { SystematicTest { p: 1.0, ..test } } else { test });
        Self { misfit, is_noise_unknown: yardstick.is_none(), systematic, learnt_noise_m, joint_p, has_gain }
    }

    /// Whether the held-out cycles lie outside the joint predictive band.
    pub fn is_outside_band(&self) -> bool {
        self.joint_p.is_some_and(|p| p < OUTSIDE_BAND)
    }

    /// What is said of it, gravest first.
    pub fn warnings(&self) -> Vec<Warning> {
        let mut list: Vec<Warning> = self.misfit.iter().flat_map(|misfit| self.of_misfit(misfit)).collect();
        list.extend(self.of_unknown_noise());
        if let Some(p) = self.joint_p.filter(|p| *p < OUTSIDE_BAND) {
            list.push(Warning {
                kind: WarningKind::HeldoutOutsideBand,
                text: format!(
                    "the held-out cycles lie outside the 99.9 % joint predictive band (probability at most {p:.1e}): the fitted model does not predict them"
                ),
                advice: "look at the predictive figure for where it fails; the model lacks something that these cycles show".into(),
            });
        }
        list
    }

    fn of_misfit(&self, left: &Misfit) -> Vec<Warning> {
        let noise_um = 1e6 * left.noise_m;
        let learnt_m = self.learnt_noise_m.filter(|_| !self.is_noise_unknown);
        let is_learnt_too_large = learnt_m.is_some_and(|learnt_m| left.is_learnt_too_large(learnt_m));
        let of_noise = match self.is_noise_unknown {
            true => "what it leaves of the fitted cycles,",
            false => "the noise of",
        };
        let miss = |(which, rms_um): (&str, f64)| {
            let over_noise = rms_um / noise_um;
            let [rms_um, noise_um] = [rms_um, noise_um].map(|um| significant(um, 3));
            format!("the {which} cycles by {rms_um} µm ({over_noise:.1} × {of_noise} {noise_um} µm)")
        };
        let sizes = [("fitted", Some(left.fitted)), ("held-out", left.heldout)];
        let too_large =
            sizes.into_iter().filter_map(|(which, size)| Some((which, size?))).filter(|own| own.1.is_too_large);
        let misses: Vec<String> = too_large.map(|(which, size)| miss((which, 1e6 * size.rms_m))).collect();
        let mut list = Vec::new();
        if !misses.is_empty() {
            let mut warning = Warning {
                kind: WarningKind::MisfitAboveNoise,
                text: format!("the model misses {}", misses.join(" and ")),
                advice: "the model is not enough for this measurement; do not read its parameters as material properties: `vitreo-uq check` names gaps and jumps of the record, `vitreo-uq diagnose` looks for what the model lacks, `vitreo-uq extend --with EFFECT` adds it".into(),
            };
            if let Some(returning_m) = left.returning_m {
                warning.text +=
                    &format!(", and {} µm of it come again in every cycle", significant(1e6 * returning_m, 3));
            }
            // Where the noise is as it should be, and not of another kind in each cycle, only the parameters' spread is left to cover a misfit.
            let is_covered = !is_learnt_too_large && !self.has_gain && self.joint_p.is_some_and(|p| p >= OUTSIDE_BAND);
            if !left.fitted.is_too_large && is_covered {
                warning.text +=
                    ", which the posterior's own spread covers: the fitted cycles do not determine the parameters";
                warning.advice = "fit more cycles or longer ones, or give a more informative prior (--prior)".into();
            }
            list.push(warning);
        }
        if let Some(learnt_um) = learnt_m.filter(|_| is_learnt_too_large).map(|learnt_m| 1e6 * learnt_m) {
            let origin = if left.is_known { "known" } else { "estimated" };
            list.push(Warning {
                kind: WarningKind::LearntNoiseAboveKnown,
                text: format!(
                    "the learnt noise, {} µm, is {:.1} × the {origin} noise of {} µm: it has swallowed a misfit",
                    significant(learnt_um, 3),
                    learnt_um / noise_um,
                    significant(noise_um, 3)
                ),
                advice: "the posterior's widths describe the misfit, not the measurement's precision".into(),
            });
        }
        list
    }

    fn of_unknown_noise(&self) -> Option<Warning> {
        const ADVICE: &str = "give `noise_um` in [measurement], or record the bead at rest";
        if !self.is_noise_unknown {
            return None;
        }
        let (kind, text, advice) = match self.systematic {
            Some(test) if test.is_systematic() => (
                WarningKind::SystematicResidual,
                format!(
                    "the residuals of the fitted cycles are systematic (autocorrelation {:.2} at lag 1, runs of one sign {:.1} standard deviations {} than chance makes, p {}): whatever the noise is, it is not of the fitted kind",
                    test.first_autocorrelation,
                    test.runs_score.abs(),
                    if test.runs_score < 0.0 { "longer" } else { "shorter" },
                    significant(test.p, 1)
                ),
                "the law is wrong, or the noise is slow: run `vitreo-uq diagnose`, try another law (--base), or give `noise_um` in [measurement]",
            ),
            Some(_) => (
                WarningKind::NoiseUnknown,
                "the noise is neither given nor can it be estimated; the residuals look like noise of the size that was fitted, so a misfit that looks like noise would not be seen".into(),
                ADVICE,
            ),
            None => (
                WarningKind::ResidualsUntested,
                "the noise is neither given nor can it be estimated, and the residuals are too few to be tested for patterns: nothing says how much misfit is too much".into(),
                ADVICE,
            ),
        };
        Some(Warning { kind, text, advice: advice.into() })
    }
}
