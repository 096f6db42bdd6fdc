//! Computes how well an experiment can detect each effect: the fraction of the effect's signature that the base model's parameters cannot absorb.
//!
//! The base model is calibrated first. L⁻¹ is the matrix that whitens the noise, x the positions and θ the sampled base parameters. The signature of an
//! effect's parameter ε at its null is g = L⁻¹∂x/∂ε. The matrix A = L⁻¹∂x/∂θ has one column per base parameter and one extra row per prior. P = I − AA⁺,
//! with the pseudoinverse A⁺, projects onto the changes that θ cannot absorb. The visible fraction is ‖Pg‖², divided by ‖g‖² under white noise alone. The
//! standard error of ε is 1/‖Pg‖. L also contains the noise's random effects (correlated errors, gains, offsets), which reduce the visible fraction.
//!
//! Some effects are, to first order, equivalent to a change of the law's parameters. Such an effect is evaluated at a finite size
//! ([`Effect::signature_size`]). Then g is the change of the positions at this size. Pg is the remainder after the law's parameters have absorbed as much
//! as possible. The remainder grows with the square of the size, so the standard error is the size at which ‖Pg‖ is 1.
//!
//! Effects whose vectors Pg are parallel or antiparallel are twins: this experiment cannot distinguish them (physics §5).

use documents::effects::{EffectEntry, EffectsSummary, ParameterEntry};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use base::distribution::Distribution;
use base::error::{Error, Result};
use base::parameter::NOISE_SD;
use base::parameter::ParameterSpec;
use figures::number::format_significant;
use models::effects::{Effect, EffectParameter, Library};
use models::model::{Forward, SurrogateForward};
use posterior::fit;
use posterior::learnt_displacement::deviation_m;
use posterior::monitor::{Monitor, SilentMonitor};
use posterior::noise::NoiseLikelihood;
use posterior::prepared::{KeptSurrogate, PreparedModel};
use posterior::problem::Problem;

/// Prior quantiles that serve as values of parameters which are unidentified at the null, where the effect vanishes.
const GRID: [f64; 9] = [0.02, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 0.98];

/// Computes the detectability of every effect of the library in an experiment.
///
/// # Errors
/// The errors of calibrating the base model.
pub fn run(
    problem: &Problem,
    library: &Library,
    kept: Option<KeptSurrogate>,
    monitor: &dyn Monitor,
) -> Result<EffectsSummary> {
    let calibrated = fit::run(problem, kept, monitor)?;
    monitor.stage("computing the detectability of each effect");
    let base = Base::new(problem, &calibrated)?;
    let list = library.effects().par_iter().map(|effect| entry(problem, library, *effect, &base));
    Ok(EffectsSummary {
        experiment: problem.experiment.specimen_id.clone(),
        model: problem.specification.summary(),
        noise_um: base.noise_parameters[0],
        effects: with_twins(list.collect::<Result<_>>()?),
    })
}

/// Calibrated base model, and the changes of the positions that its parameters can absorb.
struct Base {
    parameters: Vec<f64>,
    /// Indices of the parameters that are sampled, among all parameters.
    sampled: Vec<usize>,
    position_m: Vec<f64>,
    noise: NoiseLikelihood,
    noise_parameters: Vec<f64>,
    observed_rows: Vec<usize>,
    /// Orthonormal basis of the whitened changes that the base parameters can absorb. The rows of the priors come last.
    absorbed: DMatrix<f64>,
    kept: Option<KeptSurrogate>,
}

impl Base {
    fn new(problem: &Problem, calibrated: &fit::FitResult) -> Result<Self> {
        let record = &problem.experiment.record;
        let noise = NoiseLikelihood::new(problem.noise, &record.time_s, &problem.recordings(), &record.position_m);
        let noise_parameters = noise_parameters(problem, calibrated.summary.rmse_um);
        let forward = calibrated.model.forward();
        let parameters = calibrated.model_parameters.clone();
        let position_m = forward.trajectory_m(&parameters)?;
        let (mut columns, mut sampled) = (Vec::new(), Vec::new());
        let mut prior_rows = Vec::new();
        for (index, spec) in problem.model.parameters().iter().enumerate() {
            let Some(prior) = problem.priors.get(spec.name) else { continue };
            columns.push(forward.derivative_m(&parameters, index)?);
            sampled.push(index);
            prior_rows.push(1.0 / local_prior_sd(&prior.distribution, parameters[index]));
        }
        let white = noise.whiten(&columns, &position_m, &noise_parameters);
        let (n_rows, n_columns) = (noise.n_observed(), columns.len());
        // The columns are scaled to unit length, because the values of Young's modulus and flow viscosity differ by orders of magnitude. Otherwise
        // rounding errors would dominate one column.
        let jacobian = DMatrix::from_fn(n_rows + n_columns, n_columns, |i, j| match i.checked_sub(n_rows) {
            None => white[j][i],
            Some(row) => f64::from(u8::from(row == j)) * prior_rows[j],
        });
        let scaled = DMatrix::from_columns(&jacobian.column_iter().map(|c| c.normalize()).collect::<Vec<_>>());
        let absorbed = if n_columns == 0 { DMatrix::zeros(n_rows, 0) } else { scaled.qr().q() };
        let kept = calibrated.model.to_keep()?;
        let observed_rows = (0..record.n_rows()).filter(|row| record.position_m[*row].is_some()).collect();
        Ok(Self { parameters, sampled, position_m, noise, noise_parameters, observed_rows, absorbed, kept })
    }

    /// Computes the component of an effect's signature that the base model's parameters cannot absorb.
    fn visible(&self, Signature { whole_m, remainder_m: left_m, size }: Signature) -> VisiblePart {
        let noise_sd_m = 1e-6 * self.noise_parameters[0];
        let observed = self.observed_rows.iter().map(|row| whole_m[*row] / noise_sd_m);
        let whole: f64 = observed.map(|g| g * g).sum();
        let white = self.noise.whiten(&[left_m], &self.position_m, &self.noise_parameters);
        let mut g = DVector::zeros(self.absorbed.nrows());
        g.iter_mut().zip(&white[0]).for_each(|(g, w)| *g = *w);
        let rest = &g - &self.absorbed * (self.absorbed.transpose() * &g);
        let fraction = if whole > 0.0 { rest.norm_squared() / whole } else { 0.0 };
        let standard_error = match size {
            None => rest.norm().recip(),
            Some(size) => size.abs() * rest.norm().sqrt().recip(),
        };
        VisiblePart { fraction, rest, standard_error }
    }
}

/// Change of the positions that an effect causes, one value per row.
struct Signature {
    /// Change of the positions in m: per unit of the effect's parameter for a derivative, otherwise at the parameter value `size`.
    whole_m: Vec<f64>,
    /// Change of the positions in m that remains after the law's parameters have absorbed as much as possible. For a derivative, it equals `whole_m`.
    remainder_m: Vec<f64>,
    /// Value of the effect's parameter at which the change is computed; `None` for a derivative.
    size: Option<f64>,
}

impl Signature {
    fn derivative(column_m: Vec<f64>) -> Self {
        Self { remainder_m: column_m.clone(), whole_m: column_m, size: None }
    }
}

/// Visible part of an effect's signature (position changes per unit of the effect): the part that the base model's parameters cannot absorb.
struct VisiblePart {
    fraction: f64,
    /// Part of the whitened signature that the base model's parameters cannot absorb, called Pg in the module's documentation.
    rest: DVector<f64>,
    /// Standard error of the effect's first parameter.
    standard_error: f64,
}

/// Absolute cosine between the visible components of two effects' signatures above which the effects count as twins: equivalent to each other.
const TWIN_COSINE: f64 = 0.99;
/// Smallest meaningful visible fraction of a signature. A smaller fraction results from rounding and curvature, so the direction of the visible component
/// is meaningless.
const LEAST_VISIBLE: f64 = 1e-6;

/// Adds to each effect's entry its twins, which are the effects that this experiment cannot distinguish from it.
fn with_twins(list: Vec<(EffectEntry, Option<VisiblePart>)>) -> Vec<EffectEntry> {
    let direction = |visible: &Option<VisiblePart>| {
        visible.as_ref().filter(|v| v.fraction > LEAST_VISIBLE).map(|v| v.rest.normalize())
    };
    let directions: Vec<Option<DVector<f64>>> = list.iter().map(|(_, visible)| direction(visible)).collect();
    let slugs: Vec<String> = list.iter().map(|(entry, _)| entry.slug.clone()).collect();
    let twins_of = |i: usize| {
        let is_twin = |j: &usize| match (&directions[i], &directions[*j]) {
            (Some(a), Some(b)) => *j != i && a.dot(b).abs() > TWIN_COSINE,
            _ => false,
        };
        (0..slugs.len()).filter(is_twin).map(|j| slugs[j].clone()).collect()
    };
    let twins: Vec<Vec<String>> = (0..list.len()).map(twins_of).collect();
    list.into_iter().zip(twins).map(|((entry, _), twins)| EffectEntry { twins, ..entry }).collect()
}

/// Values of the noise parameters. The noise standard deviation (µm) is the known value, or else the root mean square residual of the calibrated base
/// model. The other parameters are prior medians.
fn noise_parameters(problem: &Problem, rmse_um: f64) -> Vec<f64> {
    let known = problem.experiment.reference_noise().map_or(rmse_um, |yardstick| 1e6 * yardstick.sd_m);
    let value = |name: &str| problem.range_of(name, 0.5).lower;
    problem.noise.parameters().iter().map(|p| if p.name == NOISE_SD.name { known } else { value(p.name) }).collect()
}

/// Prior standard deviation of a parameter near `value`. For a prior of the parameter's logarithm, it is `value` times the standard deviation of the
/// logarithm.
fn local_prior_sd(distribution: &Distribution, value: f64) -> f64 {
    match *distribution {
        Distribution::LogNormal { log_sd, .. } => log_sd * value,
        Distribution::LogUniform { lower, upper } => (upper / lower).ln() / 12_f64.sqrt() * value,
        _ => (distribution.quantile(0.841) - distribution.quantile(0.159)) / 2.0,
    }
}

fn entry(
    problem: &Problem,
    library: &Library,
    effect: &'static dyn Effect,
    base: &Base,
) -> Result<(EffectEntry, Option<VisiblePart>)> {
    let scales = problem.model.scales();
    let parameter = |p: &EffectParameter| ParameterEntry {
        name: p.spec.name.into(),
        symbol: p.spec.symbol.into(),
        unit: p.spec.unit.into(),
        support: [p.spec.support.lower, p.spec.support.upper].map(|end| Some(end).filter(|end| end.is_finite())),
        null: (p.null)(scales),
        prior: (p.prior)(scales).to_string(),
    };
    let mut entry = EffectEntry {
        slug: effect.slug().into(),
        stage: effect.stage().name().into(),
        summary: effect.description().summary.into(),
        equation: effect.description().equation.into(),
        parameters: effect.parameters().iter().map(parameter).collect(),
        visible_fraction: None,
        standard_error: None,
        twins: Vec::new(),
        refused: None,
    };
    let mut specification = problem.specification.clone();
    if specification.effects.iter().any(|slug| slug == effect.slug()) {
        entry.refused = Some("the model already has this effect".into());
        return Ok((entry, None));
    }
    specification.effects.push(effect.slug().into());
    let extended = match problem.with_model(specification, library) {
        Ok(extended) => extended,
        Err(Error::Input { found, .. }) => {
            entry.refused = Some(found);
            return Ok((entry, None));
        }
        Err(other) => return Err(other),
    };
    if effect.is_learnt_for_record() {
        let law = &base.parameters[..problem.model.base().parameters().len()];
        let deviation_m = match deviation_m(problem, law) {
            Ok(deviation_m) => deviation_m,
            Err(Error::Numerical { what, .. }) => {
                entry.refused = Some(what);
                return Ok((entry, None));
            }
            Err(other) => return Err(other),
        };
        let largest = |values: &[f64]| values.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let most_um = 1e6 * largest(&deviation_m);
        let ball = problem.finite_elements().and_then(|fe| fe.sizes.ball);
        let at = ball.map_or(String::new(), |ball| {
            format!("at {} radii ", format_significant(largest(&base.position_m) / ball.robot_radius_m, 2))
        });
        entry.summary = format!(
            "{}: {at}up to {} µm here, {} × the noise",
            entry.summary,
            format_significant(most_um, 2),
            format_significant(most_um / base.noise_parameters[0], 2)
        );
        // The deviation grows with the square of the parameter, so its derivative at 1 is twice its value.
        let visible = base.visible(Signature::derivative(deviation_m.iter().map(|x| 2.0 * x).collect()));
        entry.visible_fraction = Some(visible.fraction);
        entry.standard_error = Some(visible.standard_error).filter(|error| error.is_finite());
        return Ok((entry, Some(visible)));
    }
    let prepared = PreparedModel::unverified(&extended, base.kept.clone(), &SilentMonitor)?;
    let forward = SurrogateForward { trained: &[], ..prepared.forward() };
    let seen = signatures(effect, &forward, base)?.into_iter().map(|signature| base.visible(signature));
    let best = seen.max_by(|a, b| a.fraction.total_cmp(&b.fraction));
    if let Some(visible) = &best {
        entry.visible_fraction = Some(visible.fraction);
        entry.standard_error = Some(visible.standard_error).filter(|error| error.is_finite());
    }
    Ok((entry, best))
}

/// Signatures of an effect: the position changes that its first parameter causes near the null, where the effect vanishes. If other parameters of the
/// effect are unidentified at the null, there is one signature for each prior quantile in [`GRID`].
fn signatures(effect: &dyn Effect, forward: &SurrogateForward, base: &Base) -> Result<Vec<Signature>> {
    let (model, scales) = (forward.model, forward.model.scales());
    let effect_parameters = effect.parameters();
    let is_first = |spec: &ParameterSpec| effect_parameters.first().is_some_and(|parameter| parameter.spec == *spec);
    let Some(first) = model.parameters().iter().position(is_first) else { return Ok(Vec::new()) };
    let is_free = effect_parameters.iter().any(|p| (p.null)(scales).is_none());
    let mut list = Vec::new();
    for probability in if is_free { &GRID[..] } else { &GRID[4..5] } {
        let values = effect_parameters
            .iter()
            .map(|p| (p.null)(scales).unwrap_or_else(|| (p.prior)(scales).quantile(*probability)));
        let mut parameters = base.parameters.clone();
        parameters.splice(first..first, values);
        list.push(match (effect.signature_size(scales), effect.finite_step(scales)) {
            (Some(size), _) => finite(forward, base, parameters, first, size)?,
            (None, None) => Signature::derivative(forward.derivative_m(&parameters, first)?),
            (None, Some(step)) => {
                let here = forward.trajectory_m(&parameters)?;
                parameters[first] += step;
                let there = forward.trajectory_m(&parameters)?;
                Signature::derivative(here.iter().zip(&there).map(|(a, b)| (b - a) / step).collect())
            }
        });
    }
    Ok(list)
}

/// Number of Gauss–Newton steps in which the law's parameters absorb an effect of finite size.
const ABSORBING_STEPS: usize = 8;

/// Signature of an effect at a finite size. The law's parameters are fitted so that the extended model is as close to the base model as possible. The
/// difference that remains is the remainder.
fn finite(
    forward: &SurrogateForward,
    base: &Base,
    mut parameters: Vec<f64>,
    first: usize,
    size: f64,
) -> Result<Signature> {
    parameters[first] = size;
    let difference = |there: &[f64]| -> Vec<f64> { there.iter().zip(&base.position_m).map(|(a, b)| a - b).collect() };
    let whole_m = difference(&forward.trajectory_m(&parameters)?);
    let mut left_m = whole_m.clone();
    // Only the law's parameters are fitted here, because they are positive. The linear projection in `Base::visible` accounts for the parameters of other
    // effects.
    let n_law = forward.model.base().parameters().len();
    let free: Vec<usize> = base.sampled.iter().copied().filter(|k| *k < n_law).collect();
    for _ in 0..ABSORBING_STEPS {
        let columns = free.iter().map(|k| {
            let slope = forward.derivative_m(&parameters, *k)?;
            Ok(slope.iter().map(|x| x * parameters[*k]).collect())
        });
        let mut columns: Vec<Vec<f64>> = columns.collect::<Result<_>>()?;
        columns.push(left_m.clone());
        let white = base.noise.whiten(&columns, &base.position_m, &base.noise_parameters);
        let Some((rest, columns)) = white.split_last() else { break };
        let n = rest.len();
        let jacobian = DMatrix::from_fn(n, columns.len(), |i, j| columns[j][i]);
        let Ok(step) = jacobian.svd(true, true).solve(&DVector::from_column_slice(rest), 1e-10) else { break };
        for (k, change) in free.iter().zip(step.iter()) {
            parameters[*k] *= (-change).clamp(-1.0, 1.0).exp();
        }
        left_m = difference(&forward.trajectory_m(&parameters)?);
    }
    Ok(Signature { whole_m, remainder_m: left_m, size: Some(size) })
}
