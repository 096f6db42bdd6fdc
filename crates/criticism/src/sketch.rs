//! First-order scores of one record for every effect, with those of simulated records. A cohort is judged from these scores alone, without its records.
//!
//! Let Pg be the whitened signature of an effect after the base's parameters have absorbed their part (`rank`). Let n = ‖Pg‖ per unit of amplitude, and z = gᵀPr/n with
//! the whitened residual r. An amplitude a raises the log likelihood by a n z − ½ a²n², with the base's fitted law and noise. Records are also simulated from the base
//! and its noise, and law and noise are refitted; they give z and n without the effect. The cosine of two signatures gives the z that one effect causes for another.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::bootstrap::simulated_m;
use super::noise_fit::{GAIN_FLOOR, of_future};
use super::rank::{Signature, signature};
use super::refit::Refitted;
use super::residual_structure::measure_misfit;
use super::{Candidate, Fitted, Search, Subject, Tangent, outliers};
use base::error::{Error, Result};
use base::parameter::GAIN_SD;
use sampling::ensemble::RandomStream;

/// Visible fraction of a signature's norm below which the signature comes from rounding and curvature, so that its direction is meaningless.
const LEAST_VISIBLE: f64 = 1e-6;
/// Random streams for the gains of simulated future cycles, separate from the streams of the noise.
const GAIN_STREAMS: u64 = 0x6a_11;

/// Visible signatures, whitened and of norm 1; `None` for invisible ones.
type Visible = Vec<Option<DVector<f64>>>;

/// Score and norm of one signature on one record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SignatureScore {
    /// Score z: standard normal, to first order, if the effect is absent.
    pub z: f64,
    /// Norm of the whitened signature per unit of amplitude, without the part that the base absorbs; 0 if the effect is invisible.
    pub norm: f64,
}

/// Signature of one effect in a record: the indices of its scores and the scale of its size.
#[derive(Debug, Clone, PartialEq)]
pub struct EffectSignature {
    /// Slug of the effect.
    pub slug: &'static str,
    /// Name of the parameter that measures the effect's size; empty if the effect is not tested.
    pub parameter: &'static str,
    /// Reason why the effect is not tested; `None` if it is.
    pub refused: Option<String>,
    /// Indices of its signature scores: one per grid point of the parameters unidentified at its null.
    pub readings: std::ops::Range<usize>,
    /// Unit of the size: the amplitude is (size/unit)^power, with the size in the parameter's unit.
    pub unit: f64,
    /// Power: 1, or 2 for an effect whose response begins with the square of its size.
    pub power: f64,
    /// Largest size below and above the null, in this order; 0 on a side outside the support.
    pub reach: [f64; 2],
    /// Value of the parameter at the null.
    pub null: f64,
    /// True if sizes count downwards from the null, because the support lies below it.
    pub is_downwards: bool,
}

/// Scores of all signatures from one set of positions.
#[derive(Debug, Clone, PartialEq)]
pub struct ScoreSet {
    /// Signature scores from the fitted cycles.
    pub fitted: Vec<SignatureScore>,
    /// Signature scores from the fitted cycles, and from all cycles. Law and noise are those of the fitted cycles, but the standard deviation of the gain is at least that assumed
    /// for future cycles. `None` if no cycle is held out.
    pub fitted_and_all: Option<[Vec<SignatureScore>; 2]>,
}

impl ScoreSet {
    /// Signature scores from all cycles.
    pub fn all(&self) -> &[SignatureScore] {
        self.fitted_and_all.as_ref().map_or(&self.fitted, |[_, after]| after)
    }

    /// Sets of signature scores, in the order of [`RecordScores::cosines`].
    pub fn sets_mut(&mut self) -> impl Iterator<Item = &mut Vec<SignatureScore>> {
        std::iter::once(&mut self.fitted).chain(self.fitted_and_all.iter_mut().flatten())
    }
}

/// Signature scores of one record for every effect. A cohort is judged from these scores alone.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordScores {
    /// Every effect of the library, in its order.
    pub effects: Vec<EffectSignature>,
    /// Signature scores of the measured positions.
    pub told: ScoreSet,
    /// Signature scores from all cycles, from which sizes are estimated. Law and noise are those of the fitted cycles. If no cycle is held out, these are the scores from the
    /// fitted cycles.
    pub whole: Vec<SignatureScore>,
    /// Signature scores of every record simulated without any effect.
    pub simulated: Vec<ScoreSet>,
    /// Matrix of cosines between visible signatures for each set of scores, in the order of [`ScoreSet::sets_mut`].
    pub cosines: Vec<DMatrix<f64>>,
}

/// Base model of a record at its fit.
pub struct BaseFit {
    /// The model and its fit.
    pub base: Refitted,
    /// Rows excluded as outliers of the tracker.
    pub outlier_rows: Vec<usize>,
    /// True if the base's residual exceeds the noise.
    pub has_misfit: bool,
    /// Root mean square residual (µm) of the base on the scored cycle and the number of positions there; `None` if no cycle is held out.
    pub rmse_heldout: Option<(f64, usize)>,
}

/// Computes the scores of a record: fits the base, then scores every effect's signature at that fit in the data and in `n_simulations` simulated records.
///
/// # Errors
/// Errors of fitting the base.
pub fn sketch(subject: &Subject, n_simulations: usize, seed: u64) -> Result<(RecordScores, BaseFit)> {
    let (subject, fitted, outlier_rows) = outliers::exclude_outliers(subject, &subject.base())?;
    let base = Refitted { candidate: subject.base(), fitted, future: None };
    let of = |effect: &&'static dyn models::effects::Effect| sketch_effect(&subject, &base, effect.slug());
    let found: Vec<(EffectSignature, Vec<Vec<f64>>)> =
        subject.library().effects().par_iter().map(of).collect::<Result<_>>()?;
    let (mut effects, mut columns_m) = (Vec::new(), Vec::new());
    for (asked, columns) in found {
        let first = columns_m.len();
        columns_m.extend(columns);
        effects.push(EffectSignature { readings: first..columns_m.len(), ..asked });
    }
    let is_scored = subject.scored_m.iter().any(Option::is_some);
    let whole = is_scored.then(|| with_all_cycles_fitted(&subject)).transpose()?;
    let (told, directions) = read_sets(&subject, whole.as_ref(), (&base.candidate, &base.fitted), &columns_m)?;
    let of_whole = match &whole {
        Some(whole) => read(whole, &base.candidate, &base.fitted, &columns_m)?.0,
        None => told.fitted.clone(),
    };
    let cosines = directions.iter().map(cosines).collect();
    let chance = |number: usize| -> Result<ScoreSet> {
        let position_m = with_gains_of_future_cycles(&subject, &base, (seed, number));
        let data = subject.with_positions(&position_m);
        let whole = whole.as_ref().map(|subject| subject.with_positions(&position_m));
        let start = (base.fitted.theta.clone(), base.fitted.noise);
        let fitted = data.fit(&base.candidate, &[start], Search::Local)?;
        Ok(self::read_sets(&data, whole.as_ref(), (&base.candidate, &fitted), &columns_m)?.0)
    };
    let simulated = (0..n_simulations).into_par_iter().map(chance).collect::<Result<_>>()?;
    let leaves_too_much = measure_misfit(&subject, &base, &[])?.is_too_large();
    let n_scored = subject.scored_m.iter().flatten().count();
    let rmse_heldout = base.fitted.rmse_m(&subject.scored_m).map(|rmse_m| (1e6 * rmse_m, n_scored));
    let said = RecordScores { effects, told, whole: of_whole, simulated, cosines };
    Ok((said, BaseFit { base, outlier_rows, has_misfit: leaves_too_much, rmse_heldout }))
}

/// Returns the scores of columns (m, one value per row of the record) at a fit, and the directions of each set. The fitted cycles of `whole` include the scored ones.
fn read_sets(
    subject: &Subject,
    whole: Option<&Subject>,
    (candidate, fitted): (&Candidate, &Fitted),
    columns_m: &[Vec<f64>],
) -> Result<(ScoreSet, Vec<Visible>)> {
    let (readings, directions) = read(subject, candidate, fitted, columns_m)?;
    let Some(whole) = whole else {
        return Ok((ScoreSet { fitted: readings, fitted_and_all: None }, vec![directions]));
    };
    let noise = of_future(subject.noise(), fitted.noise);
    let wary = Fitted { noise, ..fitted.clone() };
    let (before, of_before) = read(subject, candidate, &wary, columns_m)?;
    let (after, of_after) = read(whole, candidate, &wary, columns_m)?;
    let told = ScoreSet { fitted: readings, fitted_and_all: Some([before, after]) };
    Ok((told, vec![directions, of_before, of_after]))
}

/// Simulates positions (m) from the base and its noise. Each held-out cycle gets a random gain of the size that its scoring assumes, even if few fitted cycles show none.
fn with_gains_of_future_cycles(subject: &Subject, base: &Refitted, (seed, number): (u64, usize)) -> Vec<f64> {
    let mut position_m = simulated_m(subject, base, seed, number);
    let gain_sd = (GAIN_FLOOR.powi(2) - subject.noise().value(&base.fitted.noise, &GAIN_SD).powi(2)).max(0.0).sqrt();
    let mut stream = RandomStream::new(seed ^ GAIN_STREAMS, number as u64);
    let experiment = subject.experiment();
    for cycle in &experiment.heldout_cycles {
        let gain = gain_sd * stream.normal();
        let rows = experiment.record.cycle.iter().zip(&base.fitted.position_m).zip(&mut position_m);
        rows.filter(|((row_cycle, _), _)| *row_cycle == cycle).for_each(|((_, x), position_m)| *position_m += gain * x);
    }
    position_m
}

fn cosines(directions: &Visible) -> DMatrix<f64> {
    let cosine = |i: usize, j: usize| match (&directions[i], &directions[j]) {
        (Some(a), Some(b)) => a.dot(b),
        _ => 0.0,
    };
    DMatrix::from_fn(directions.len(), directions.len(), cosine)
}

/// Returns the subject with the scored cycles among the fitted ones; outliers stay excluded.
pub fn with_all_cycles_fitted(subject: &Subject) -> Result<Subject> {
    let experiment = subject.experiment();
    let cycles: Vec<u32> = experiment.calibration_cycles.iter().chain(&experiment.heldout_cycles).copied().collect();
    let left_out: Vec<usize> = (0..subject.fitted_m.len())
        .filter(|row| subject.fitted_m[*row].is_none() && subject.scored_m[*row].is_none())
        .collect();
    Ok(subject.with_cycles(&cycles, &[])?.without_rows(&left_out))
}

/// Returns an effect's entry and the columns of its response (m). An effect that is not tested has no columns.
fn sketch_effect(subject: &Subject, base: &Refitted, slug: &'static str) -> Result<(EffectSignature, Vec<Vec<f64>>)> {
    let not = |why: String| {
        let asked = EffectSignature {
            slug,
            parameter: "",
            refused: Some(why),
            readings: 0..0,
            unit: 1.0,
            power: 1.0,
            reach: [0.0; 2],
            null: 0.0,
            is_downwards: false,
        };
        Ok((asked, Vec::new()))
    };
    let candidate = match subject.extended(&[slug]) {
        Ok(candidate) => candidate,
        Err(Error::Input { found, .. }) => return not(found),
        Err(other) => return Err(other),
    };
    let found = match signature(subject, (&base.candidate, &base.fitted), &candidate) {
        Ok(found) => found,
        Err(Error::Numerical { what, .. }) => return not(what),
        Err(other) => return Err(other),
    };
    let Some(found) = found else { return not("its size is fixed".into()) };
    let Signature { columns_m, parameter, unit, power, reach, null, is_downwards } = found;
    if columns_m.is_empty() || !(unit > 0.0 && unit.is_finite()) {
        return not("its response is invisible in this record".into());
    }
    let readings = 0..columns_m.len();
    Ok((
        EffectSignature { slug, parameter, refused: None, readings, unit, power, reach, null, is_downwards },
        columns_m,
    ))
}

/// Returns the scores of columns (m, one value per row of the record) at a fit, over the fitted cycles, and their unit directions.
fn read(
    subject: &Subject,
    candidate: &Candidate,
    fitted: &Fitted,
    columns_m: &[Vec<f64>],
) -> Result<(Vec<SignatureScore>, Visible)> {
    let tangent = Tangent::new(subject, candidate, fitted)?;
    let residual = tangent.projected_residual();
    let of = |white: DVector<f64>| {
        let whole = white.norm();
        let visible = tangent.project(white);
        let norm = visible.norm();
        // NaN counts as invisible, too.
        if norm > LEAST_VISIBLE * whole && norm.is_finite() {
            let direction = visible / norm;
            (SignatureScore { z: direction.dot(&residual), norm }, Some(direction))
        } else {
            (SignatureScore { z: 0.0, norm: 0.0 }, None)
        }
    };
    Ok(tangent.whiten(columns_m).into_iter().map(of).unzip())
}
