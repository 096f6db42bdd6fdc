//! Log posterior density of a model for an oscillation, with fits and simulations.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use base::error::{Error, InputPlace, Result, Setting};
use base::number::Dual;
use base::parameter::{ParameterSpec, RELATIVE_NOISE};
use laws::rheology::complex_modulus_pa;
use laws::stages::Stages;
use models::effects::Library;
use models::model::Model;
use posterior::model_priors::read_priors_with;
use posterior::prior::{Distribution, Prior, PriorSet};
use posterior::study::ModelSpecification;
use record::{CharacteristicSizes, OscillationRecord, SweepForm, SweepRow};
use sampling::LogDensity;
use sampling::ensemble::RandomStream;
use sampling::optimum::{Mode, find_modes};

/// Name of the default prior for oscillations. It is wide, because rheometers measure gels of any kind.
pub const DEFAULT_PRIOR: &str = "generic";
/// Prior of the relative measurement error of the moduli. The median is 2 %, and one standard deviation is a factor of three.
const NOISE_PRIOR: Distribution = Distribution::LogNormal { median: 0.02, log_sd: 1.2 };
const NOISE_PRIOR_SOURCE: &str =
    "chosen: rheometers repeat to a few per cent, a factor of three for one standard deviation";
/// Largest number of frequencies. No rheometer measures more.
const MOST_ROWS: usize = 10_000;
/// Number of starting points for a fit, drawn from the prior.
const N_STARTS: usize = 24;
/// Number of the random stream that draws the starting points of searches.
const START_STREAM: u64 = u64::MAX / 3;

/// Measured oscillation, joined with the model and the priors for its inference.
#[derive(Debug, Clone)]
pub struct SweepProblem {
    /// Measured oscillation: frequencies with two values each.
    pub sweep: OscillationRecord,
    /// Specification of the model.
    pub specification: ModelSpecification,
    /// Law and effects of the model.
    pub model: Model,
    /// Priors of the sampled parameters.
    pub priors: PriorSet,
}

/// Maximum of the posterior density, found by a search.
#[derive(Debug, Clone, PartialEq)]
pub struct SweepFit {
    /// Location of the maximum, in the sampler's coordinates.
    pub point: Vec<f64>,
    /// All parameters in natural units, fixed ones included.
    pub values: Vec<f64>,
    /// Log posterior density at the maximum, over the sampler's coordinates.
    pub ln_posterior: f64,
    /// Log-likelihood of the fitted rows.
    pub ln_likelihood: f64,
    /// Log-likelihood of the held-out rows.
    pub ln_heldout: f64,
    /// `true` if the search converged to a maximum with negative curvature.
    pub converged: bool,
    /// Standard deviation of each coordinate, from the curvature at the maximum.
    pub sd: Vec<f64>,
}

/// Characteristic times for the priors of effects. The lowest frequency gives the duration, and the highest gives the shortest visible time.
fn scales(sweep: &OscillationRecord) -> CharacteristicSizes {
    let [lowest_hz, highest_hz] = sweep.range_hz();
    let slowest_s = 1.0 / (std::f64::consts::TAU * lowest_hz);
    CharacteristicSizes {
        largest_force_n: 1.0,
        hold_s: slowest_s,
        sample_interval_s: 1.0 / (4.0 * std::f64::consts::TAU * highest_hz),
        cycle_s: slowest_s,
        duration_s: slowest_s,
        ..CharacteristicSizes::default()
    }
}

impl SweepProblem {
    /// Joins the oscillation with a model, after checking that the model suits it.
    ///
    /// # Errors
    /// [`Error::Input`] for effects that an oscillation cannot show, noise terms, unknown parameters, and unsuitable priors.
    pub fn new(sweep: OscillationRecord, specification: ModelSpecification, library: &Library) -> Result<Self> {
        if sweep.rows.len() > MOST_ROWS {
            let found = format!("{} frequencies exceed the limit of {MOST_ROWS}", sweep.rows.len());
            let remedy = "if this is a record over time, describe it as one; otherwise keep fewer frequencies";
            return Err(Error::input(InputPlace::default().at_key("sweep"), found, remedy));
        }
        let effects = specification.effects(library);
        let model = Model::new(specification.base, effects, scales(&sweep), &InputPlace::setting(Setting::Effects))?;
        if let Some(law) = specification.base.outside() {
            return Err(Error::input(
                InputPlace::setting(Setting::Forward),
                format!("{} returns positions over time, but this is an oscillation", law.url()),
                "leave out the external model: oscillations take laws of springs, dashpots and springpots",
            ));
        }
        if specification.noise != ModelSpecification::default().noise {
            return Err(Error::input(
                InputPlace::setting(Setting::Noise),
                "an oscillation has no rows over time, so noise terms do not apply",
                format!("leave out {}: the table gives the errors, or one relative error is inferred", Setting::Noise),
            ));
        }
        let of_errors: &[ParameterSpec] = if sweep.has_errors() { &[] } else { &[RELATIVE_NOISE] };
        let of_error = |spec: &ParameterSpec, _: &dyn Fn(&str) -> f64| {
            Some(Prior {
                name: spec.name.into(),
                distribution: NOISE_PRIOR,
                unit: spec.unit.into(),
                source: NOISE_PRIOR_SOURCE.into(),
            })
        };
        let all = read_priors_with(&specification.prior, &model, of_errors, &of_error, library)?;
        for (name, value) in &specification.fixed {
            let spec = model.parameters().iter().chain(of_errors).find(|spec| spec.name == name);
            if !spec.is_some_and(|spec| value.is_finite() && spec.support.contains(*value)) {
                let names: Vec<&str> = all.names().collect();
                let remedy = format!("set one of {} to a value inside its support", names.join(", "));
                return Err(Error::input(InputPlace::setting(Setting::Fixed), format!("{name} = {value}"), remedy));
            }
        }
        let fixed: Vec<&str> = specification.fixed.keys().map(String::as_str).collect();
        let priors = all.without(&fixed);
        let problem = Self { sweep, specification, model, priors };
        problem.refuse_invisible_effects(&all)?;
        Ok(problem)
    }

    /// Returns the problem with other rows, each a frequency with its two values.
    pub fn with_rows(&self, rows: Vec<SweepRow>) -> Self {
        Self { sweep: OscillationRecord { rows, ..self.sweep.clone() }, ..self.clone() }
    }

    /// Refuses effects that change more than the relation of stress and strain, because a stationary oscillation does not show them.
    fn refuse_invisible_effects(&self, all: &PriorSet) -> Result<()> {
        // Parameters are set to the 0.8 quantile of their priors, because a prior's median may be the null, at which the effect vanishes.
        let aside: Vec<Dual> = self
            .model
            .parameters()
            .iter()
            .map(|spec| all.get(spec.name).map_or(f64::NAN, |prior| prior.distribution.quantile(0.8)).into())
            .collect();
        let seen = self
            .model
            .stages(&aside)
            .is_ok_and(|stages| stages == Stages { base: stages.base, ..Stages::of_law(stages.law.clone()) });
        if seen || self.model.effects().is_empty() {
            return Ok(());
        }
        let slugs: Vec<&str> = self.model.effects().iter().map(|effect| effect.slug()).collect();
        Err(Error::input(
            InputPlace::setting(Setting::Effects),
            format!("{}: an oscillation shows only effects that change the law", slugs.join(", ")),
            "leave the effect out, or measure a creep record",
        ))
    }

    /// Specifications of all parameters: those of the model, then the relative error if it is inferred.
    pub fn parameters(&self) -> Vec<ParameterSpec> {
        let of_errors = (!self.sweep.has_errors()).then_some(RELATIVE_NOISE);
        self.model.parameters().iter().copied().chain(of_errors).collect()
    }

    /// Values of all parameters, in natural units, at a point in the sampler's coordinates. Fixed parameters are included.
    pub fn values(&self, point: &[f64]) -> Vec<f64> {
        let mut sampled = self.priors.priors().iter().zip(point);
        let value = |spec: ParameterSpec| match self.specification.fixed.get(spec.name) {
            Some(value) => *value,
            None => sampled.next().map_or(f64::NAN, |(prior, z)| prior.distribution.from_unconstrained(*z)),
        };
        self.parameters().into_iter().map(value).collect()
    }

    /// Predicted pair of values at each frequency: storage and loss modulus (Pa), or modulus (Pa) and phase (rad). `None` if the model has no prediction.
    pub fn predict(&self, values: &[f64]) -> Option<Vec<[f64; 2]>> {
        let n = self.model.parameters().len();
        let parameters: Vec<Dual> = values[..n].iter().map(|value| (*value).into()).collect();
        let law = self.model.stages(&parameters).ok()?.law;
        let shear = 1.0 / (2.0 + 2.0 * self.sweep.poisson_ratio);
        let at = |row: &SweepRow| {
            let modulus = complex_modulus_pa(&law, std::f64::consts::TAU * row.frequency_hz);
            let pair = self.sweep.form.of_moduli(shear * modulus.re, shear * modulus.im);
            pair.iter().all(|number| number.is_finite()).then_some(pair)
        };
        self.sweep.rows.iter().map(at).collect()
    }

    /// Standard deviations of the measurement errors of both values of a row, given the predicted `pair` of values.
    pub fn sd(&self, row: &SweepRow, pair: [f64; 2], values: &[f64]) -> [f64; 2] {
        row.sd.unwrap_or_else(|| {
            let relative = values.last().copied().unwrap_or(f64::NAN);
            let [storage, loss] = self.sweep.form.moduli(pair);
            match self.sweep.form {
                SweepForm::StorageAndLoss => [relative * storage.hypot(loss); 2],
                SweepForm::ModulusAndPhase => [relative * pair[0], relative],
            }
        })
    }

    /// Residuals of both values of each row, divided by the standard deviations of the measurement errors.
    pub fn residuals(&self, predicted: &[[f64; 2]], values: &[f64]) -> Vec<[f64; 2]> {
        let of_row = |(row, pair): (&SweepRow, &[f64; 2])| {
            let sd = self.sd(row, *pair, values);
            [0, 1].map(|k| (row.pair[k] - pair[k]) / sd[k])
        };
        self.sweep.rows.iter().zip(predicted).map(of_row).collect()
    }

    /// Log-likelihood of the fitted rows, or of the held-out rows if `of_heldout` is set. It is −∞ if the model has no prediction.
    pub fn ln_likelihood(&self, values: &[f64], of_heldout: bool) -> f64 {
        let Some(predicted) = self.predict(values) else { return f64::NEG_INFINITY };
        let mut sum = 0.0;
        for (row, pair) in self.sweep.rows.iter().zip(&predicted).filter(|(row, _)| row.is_heldout == of_heldout) {
            for (k, sd) in self.sd(row, *pair, values).into_iter().enumerate() {
                let residual = (row.pair[k] - pair[k]) / sd;
                sum -= 0.5 * residual * residual + sd.ln() + 0.5 * std::f64::consts::TAU.ln();
            }
        }
        if sum.is_nan() { f64::NEG_INFINITY } else { sum }
    }

    /// Draws `n` points from the prior, at which searches for the maximum of the posterior density start.
    pub fn starts(&self, seed: u64, n: usize) -> Vec<Vec<f64>> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(START_STREAM);
        (0..n).map(|_| self.priors.to_unconstrained(&self.priors.draw(&mut rng))).collect()
    }

    /// Finds the highest maximum of the posterior density. Searches start from prior draws and from the points in `also`. `None` if no search succeeds.
    ///
    /// # Errors
    /// Those of [`find_modes`].
    pub fn fit(&self, seed: u64, also: &[Vec<f64>]) -> Result<Option<SweepFit>> {
        self.fit_from(&[self.starts(seed, N_STARTS), also.to_vec()].concat())
    }

    /// Finds the highest maximum of the posterior density. Searches start from `starts`. `None` if no search succeeds.
    ///
    /// # Errors
    /// Those of [`find_modes`].
    pub fn fit_from(&self, starts: &[Vec<f64>]) -> Result<Option<SweepFit>> {
        Ok(self.maxima(starts)?.into_iter().next())
    }

    /// Finds all maxima of the posterior density that searches from `starts` reach, highest first. End points of searches that did not converge come last.
    ///
    /// # Errors
    /// Those of [`find_modes`].
    pub fn maxima(&self, starts: &[Vec<f64>]) -> Result<Vec<SweepFit>> {
        let modes = find_modes(self, starts)?;
        let mut fits: Vec<SweepFit> = modes.iter().map(|mode| self.fit_of(mode)).collect();
        fits.sort_by(|a, b| b.converged.cmp(&a.converged).then_with(|| b.ln_posterior.total_cmp(&a.ln_posterior)));
        Ok(fits)
    }

    fn fit_of(&self, mode: &Mode) -> SweepFit {
        let values = self.values(&mode.location);
        let n = mode.location.len();
        let covariance = nalgebra::DMatrix::from_row_slice(n, n, &mode.precision).try_inverse();
        let sd = (0..n).map(|k| covariance.as_ref().map_or(f64::NAN, |c| c[(k, k)].max(0.0).sqrt())).collect();
        SweepFit {
            ln_likelihood: self.ln_likelihood(&values, false),
            ln_heldout: self.ln_likelihood(&values, true),
            point: mode.location.clone(),
            values,
            ln_posterior: mode.log_density,
            converged: mode.converged,
            sd,
        }
    }

    /// Simulates measured rows by adding noise to the predicted values. `values` holds all parameters, from which the noise follows.
    pub fn simulate_rows(&self, predicted: &[[f64; 2]], values: &[f64], stream: &mut RandomStream) -> Vec<SweepRow> {
        let row = |(row, pair): (&SweepRow, &[f64; 2])| {
            let sd = self.sd(row, *pair, values);
            SweepRow { pair: [0, 1].map(|k| pair[k] + sd[k] * stream.normal()), ..*row }
        };
        self.sweep.rows.iter().zip(predicted).map(row).collect()
    }
}

impl LogDensity for SweepProblem {
    fn dimension(&self) -> usize {
        self.priors.priors().len()
    }

    fn log_density(&self, points: &[f64], log_density: &mut [f64]) {
        let n = log_density.len();
        for (i, value) in log_density.iter_mut().enumerate() {
            let point: Vec<f64> = (0..self.dimension()).map(|d| points[d * n + i]).collect();
            *value = self.ln_likelihood(&self.values(&point), false);
        }
        self.priors.add_ln_pdf_unconstrained(points, log_density);
    }
}
