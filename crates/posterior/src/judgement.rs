//! Judgement of a model's residuals: does the model describe the record? The commands `fit`, `sample`, `extend` and `ladder` share its rule (docs/diagnosis.md).
//!
//! If the noise is given or estimated, residuals are compared with it ([`Misfit`]). If it is unknown, the held-out residuals are compared with the fitted ones, and the
//! residuals are tested for patterns ([`SystematicTest`]). They are also tested for patterns if they exceed an estimate, which may lack slow noise, and their size
//! alone cannot tell slow noise from a misfit. If posterior draws predict the held-out cycles, the joint predictive band is a further test.

use documents::posterior::{Warning, WarningKind};
use figures::number::format_significant;
use record::noise::rounding_sd_m;
use record::{Control, NoiseOrigin, ReferenceNoise};

use super::check::unknown_jump;
use super::full_check::mean_trajectory;
use super::misfit::{GainKnowledge, Misfit, NOISE_FACTOR, OUTSIDE_BAND, Residuals, directions_of_spread};
use super::noise::{NoiseLikelihood, NoiseModel};
use super::patterns::{Pattern, TestedFit};
use super::problem::Problem;
use super::systematic::SystematicTest;

/// Root mean square of the residuals, as a fraction of the range of positions, below which they are rounding errors of files and solvers. Their patterns then have no
/// meaning.
const ROUNDING: f64 = 1e-6;

/// Least part of the residuals that is the rounding of written positions, at which their patterns are those of the rounding.
const COARSE: f64 = 0.8;

/// A fitted model's prediction of all rows of a record.
pub struct Prediction<'a> {
    /// Predicted position (m) at every row.
    pub position_m: &'a [f64],
    /// Directions in which the parameters can move the prediction: one column per direction, with one value (m) per row.
    pub columns_m: &'a [Vec<f64>],
    /// Fitted noise model and the values of its parameters, in their units.
    pub noise: (NoiseModel, &'a [f64]),
    /// Standard deviation (m) of the learnt noise that varies from row to row; `None` if no noise is learnt.
    pub learnt_noise_m: Option<f64>,
    /// Probability of a held-out misfit at least as large as the observed one, by joint predictive simulation; `None` without a simulation.
    pub joint_p: Option<f64>,
}

/// Judgement of a prediction: results of the tests of its residuals.
#[derive(Debug, Clone, PartialEq)]
pub struct Judgement {
    /// Comparison of the residuals with the noise. If the noise is unknown, it compares held-out residuals with fitted ones.
    pub misfit: Option<Misfit>,
    /// True if the noise is neither given nor estimated.
    pub is_noise_unknown: bool,
    /// Estimated noise standard deviation (m) that the fitted residuals exceed by so much that they are slow noise or a misfit. `None` if they do not, or if
    /// [`Judgement::misfit`] calls them a misfit already.
    pub exceeded_estimate_m: Option<f64>,
    /// Test of the residuals for patterns, if the noise is unknown or its estimate is exceeded, and they can be tested.
    pub systematic: Option<SystematicTest>,
    /// Pattern in residuals of fitted and held-out cycles that do not exceed the noise.
    pub pattern: Option<Pattern>,
    /// Standard deviation (m) of the learnt noise, as in [`Prediction::learnt_noise_m`].
    pub learnt_noise_m: Option<f64>,
    /// Joint probability of the held-out misfit, as in [`Prediction::joint_p`].
    pub joint_p: Option<f64>,
    /// True if the noise model has a gain and an offset for each cycle.
    pub has_gain: bool,
    /// Warning about a commanded position that jumps at an unknown time.
    pub unknown_jump: Option<Warning>,
}

impl Judgement {
    /// Judges a prediction. `yardstick` is the noise that is given or estimated from the record; `None` if it is unknown.
    pub fn of(problem: &Problem, prediction: &Prediction, yardstick: Option<ReferenceNoise>) -> Self {
        let (experiment, record) = (&problem.experiment, &problem.experiment.record);
        let Prediction { position_m, columns_m, noise: (noise, parameters), learnt_noise_m, joint_p } = *prediction;
        let fitted = problem.positions_of(&experiment.calibration_cycles);
        let heldout = problem.positions_of(&experiment.heldout_cycles);
        let left = |positions: &[Option<f64>]| -> Vec<Option<f64>> {
            positions.iter().zip(position_m).map(|(y, x)| y.map(|y| y - x)).collect()
        };
        let has_gain = noise.names().contains(&"gain");
        let remainder = Residuals {
            record,
            fitted_m: &left(&fitted),
            heldout_m: &left(&heldout),
            position_m,
            absorbed_m: columns_m,
            gains: if has_gain { GainKnowledge::Declared } else { GainKnowledge::None },
        };
        let misfit = match yardstick {
            Some(ReferenceNoise { sd_m, origin }) => Misfit::of(&remainder, sd_m, matches!(origin, NoiseOrigin::Known)),
            None => Misfit::relative_to_fitted(&remainder),
        };
        let is_above_estimate = |noise: &ReferenceNoise| {
            !matches!(noise.origin, NoiseOrigin::Known)
                && misfit
                    .is_some_and(|misfit| !misfit.is_too_large() && misfit.fitted.rms_m > NOISE_FACTOR * noise.sd_m)
        };
        let exceeded_estimate_m = yardstick.filter(is_above_estimate).map(|noise| noise.sd_m);
        let systematic = (yardstick.is_none() || exceeded_estimate_m.is_some()).then(|| {
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
        let is_systematic = systematic.is_some_and(|test| test.is_systematic());
        let is_outside = joint_p.is_some_and(|p| p < OUTSIDE_BAND);
        let is_hidden = |misfit: &Misfit| {
            !misfit.is_too_large()
                && !learnt_noise_m.is_some_and(|learnt_m| misfit.is_learnt_too_large(learnt_m))
                && rounding_sd_m(&record.position_m) <= COARSE * misfit.fitted.rms_m
        };
        let is_hidden = !is_rounding && !is_systematic && !is_outside && misfit.as_ref().is_some_and(is_hidden);
        let fit = TestedFit {
            record,
            position_m,
            measured_m: [&fitted, &heldout],
            columns_m,
            declared: noise,
            noise: (noise, parameters),
        };
        let pattern = if is_hidden { fit.clearest_pattern() } else { None };
        let is_noise_unknown = yardstick.is_none();
        let unknown_jump = match experiment.control {
            Control::Position => unknown_jump(record, yardstick.map_or(0.0, |noise| noise.sd_m)),
            Control::Force => None,
        };
        Self {
            misfit,
            is_noise_unknown,
            exceeded_estimate_m,
            systematic,
            pattern,
            learnt_noise_m,
            joint_p,
            has_gain,
            unknown_jump,
        }
    }

    /// Judges the mean of the trajectories (m) of posterior draws. Also takes the values of the noise parameters of each draw, in their units.
    pub fn of_draws(
        problem: &Problem,
        (trajectories_m, noise): (&[Vec<f64>], &[Vec<f64>]),
        joint_p: Option<f64>,
        yardstick: Option<ReferenceNoise>,
    ) -> Self {
        let mean_m = mean_trajectory(trajectories_m, None);
        let n_directions = problem.model.parameters().len();
        let prediction = Prediction {
            position_m: &mean_m,
            columns_m: &directions_of_spread(trajectories_m, &mean_m, n_directions),
            noise: (problem.noise, &median_parameters(noise)),
            learnt_noise_m: Some(1e-6 * median_row_sd_um(problem.noise, noise)),
            joint_p,
        };
        Self::of(problem, &prediction, yardstick)
    }

    /// Lists the warnings that follow from the judgement, most serious first.
    pub fn warnings(&self) -> Vec<Warning> {
        let mut list: Vec<Warning> = self.unknown_jump.iter().cloned().collect();
        list.extend(self.misfit.iter().flat_map(|misfit| self.of_misfit(misfit)));
        list.extend(self.of_unknown_noise());
        list.extend(self.pattern.as_ref().map(of_pattern));
        if let Some(p) = self.joint_p.filter(|p| *p < OUTSIDE_BAND) {
            list.push(Warning {
                kind: WarningKind::HeldoutOutsideBand,
                text: format!(
                    "the held-out cycles lie outside the 99.9 % joint predictive band (probability at most {p:.1e}): the fitted model does not predict them"
                ),
                advice: "look in the predictive figure for the rows that disagree; the model lacks an effect that these cycles show".into(),
            });
        }
        list
    }

    fn of_misfit(&self, left: &Misfit) -> Vec<Warning> {
        let noise_um = 1e6 * left.noise_m;
        let learnt_m = self.learnt_noise_m.filter(|_| !self.is_noise_unknown);
        let is_learnt_too_large = learnt_m.is_some_and(|learnt_m| left.is_learnt_too_large(learnt_m));
        let of_noise = match self.is_noise_unknown {
            true => "the root mean square residual of the fitted cycles,",
            false => "the noise of",
        };
        let miss = |(which, rms_um): (&str, f64)| {
            let over_noise = rms_um / noise_um;
            let [rms_um, noise_um] = [rms_um, noise_um].map(|um| format_significant(um, 3));
            format!("the {which} cycles by {rms_um} µm ({over_noise:.1} × {of_noise} {noise_um} µm)")
        };
        let sizes = [("fitted", Some(left.fitted)), ("held-out", left.heldout)];
        let too_large =
            sizes.into_iter().filter_map(|(which, size)| Some((which, size?))).filter(|pair| pair.1.is_too_large);
        let misses: Vec<String> = too_large.map(|(which, size)| miss((which, 1e6 * size.rms_m))).collect();
        let mut list = Vec::new();
        if !misses.is_empty() {
            let mut warning = Warning {
                kind: WarningKind::MisfitAboveNoise,
                text: format!("the model misses {}", misses.join(" and ")),
                advice: "the model does not describe this measurement; do not interpret its parameters as material properties. `vitreo-uq check` finds gaps and jumps of the \
                    record, `vitreo-uq diagnose` searches for the missing effect, `vitreo-uq extend --with EFFECT` adds it".into(),
            };
            if let Some(returning_m) = left.returning_m {
                warning.text +=
                    &format!(", and {} µm of it recur in every cycle", format_significant(1e6 * returning_m, 3));
            }
            if let Some(gains) = left.implausible_gains {
                warning.text += &format!("; {}", gains.words());
            }
            // A learnt noise that is not too large and has no gain cannot hide a misfit inside the joint band. Only the uncertainty of the parameters can hide it.
            let is_covered = !is_learnt_too_large && !self.has_gain && self.joint_p.is_some_and(|p| p >= OUTSIDE_BAND);
            if !left.fitted.is_too_large && is_covered {
                warning.text +=
                    ", but the spread of the posterior covers this: the fitted cycles do not determine the parameters";
                warning.advice = "fit more or longer cycles, or give a more informative prior (--prior)".into();
            }
            list.push(warning);
        }
        if let Some(learnt_um) = learnt_m.filter(|_| is_learnt_too_large).map(|learnt_m| 1e6 * learnt_m) {
            let origin = if left.is_known { "known" } else { "estimated" };
            list.push(Warning {
                kind: WarningKind::LearntNoiseAboveKnown,
                text: format!(
                    "the learnt noise of {} µm is {:.1} × the {origin} noise of {} µm: it has absorbed a misfit",
                    format_significant(learnt_um, 3),
                    learnt_um / noise_um,
                    format_significant(noise_um, 3)
                ),
                advice:
                    "read the posterior's intervals as the size of the misfit, not as the precision of the measurement"
                        .into(),
            });
        }
        list
    }

    /// Warning of residuals whose size does not show whether they are noise, because the noise is unknown or its estimate may lack slow noise.
    fn of_unknown_noise(&self) -> Option<Warning> {
        const ADVICE: &str = "give `noise_um` in [measurement], or record the bead at rest";
        let pattern = self.systematic.filter(SystematicTest::is_systematic).map(|test| {
            format!(
                "systematic (autocorrelation {:.2} at lag 1, runs of one sign {:.1} standard deviations {} than by chance, p {}): they are no noise of the fitted kind",
                test.first_autocorrelation,
                test.runs_score.abs(),
                if test.runs_score < 0.0 { "longer" } else { "shorter" },
                format_significant(test.p, 1)
            )
        });
        let (kind, text, advice) = match (self.is_noise_unknown, self.exceeded_estimate_m, pattern, self.systematic) {
            (true, _, Some(pattern), _) => (
                WarningKind::SystematicResidual,
                format!("the residuals of the fitted cycles are {pattern}"),
                "the law is wrong, or the noise is slow: run `vitreo-uq diagnose`, try another law (--base), or give `noise_um` in [measurement]",
            ),
            (true, _, None, Some(_)) => (
                WarningKind::NoiseUnknown,
                "the noise is neither given nor can it be estimated; the residuals look like noise of the fitted size, so a misfit that looks like noise cannot be ruled out".into(),
                ADVICE,
            ),
            (true, _, None, None) => (
                WarningKind::ResidualsUntested,
                "the noise is neither given nor can it be estimated, and the residuals are too few for a test of patterns: the size of a misfit cannot be judged".into(),
                ADVICE,
            ),
            (false, Some(estimate_m), Some(pattern), _) => {
                let rms_m = self.misfit.map_or(f64::NAN, |misfit| misfit.fitted.rms_m);
                let [rms_um, noise_um] = [rms_m, estimate_m].map(|m| format_significant(1e6 * m, 3));
                let over = rms_m / estimate_m;
                (
                    WarningKind::SystematicResidual,
                    format!(
                        "the residuals of the fitted cycles, {rms_um} µm or {over:.1} × the estimated noise of {noise_um} µm, are {pattern}"
                    ),
                    "the law is wrong, or the record has slow noise that the estimate lacks: run `vitreo-uq diagnose`; if the tracker drifts, sample it with slow noise \
                    (--noise white,ou)",
                )
            }
            (false, ..) => return None,
        };
        Some(Warning { kind, text, advice: advice.into() })
    }
}

fn middle(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Median of each noise parameter over draws, in the parameter's unit.
fn median_parameters(noise: &[Vec<f64>]) -> Vec<f64> {
    let n_parameters = noise.first().map_or(0, Vec::len);
    (0..n_parameters).map(|k| middle(noise.iter().map(|draw| draw[k]).collect())).collect()
}

/// Median over draws of the standard deviation (µm) of the noise that varies from row to row. `noise` holds the values of the noise parameters of each draw.
pub fn median_row_sd_um(model: NoiseModel, noise: &[Vec<f64>]) -> f64 {
    middle(noise.iter().map(|parameters| model.row_sd_um(parameters)).collect())
}

fn of_pattern(pattern: &Pattern) -> Warning {
    Warning {
        kind: WarningKind::ResidualPattern,
        text: format!("{}: predictions may be off by about as much as the noise, and parameters by more than their intervals say, because they have absorbed a part of the pattern", pattern.words()),
        advice: "`vitreo-uq compare` shows the pattern, and `vitreo-uq diagnose` searches for its cause; if the tracker drifts (--noise white,ou) or its scale changes from cycle to cycle (--noise white,gain), sample with this noise".into(),
    }
}

#[cfg(test)]
#[path = "judgement_tests.rs"]
mod tests;
