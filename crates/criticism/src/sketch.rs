//! What one record says of every effect, to first order, and what it would say by chance: few numbers, from which a cohort of records can be judged without any of
//! them being at hand.
//!
//! With Pg the whitened signature of an effect that a base's parameters cannot absorb (`rank`), n = ‖Pg‖ a unit of its amplitude and
//! z = gᵀPr/n, the log likelihood of an amplitude a, law and noise of the base as they were fitted, is a n z − ½ a²n² above that of none. Records that are simulated from
//! the base and its noise, both fitted anew, give z and n without the effect. The cosines of two signatures say what one effect makes of another's z.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::bootstrap::simulated_m;
use super::leftover::misfit;
use super::noise_fit::{GAIN_FLOOR, of_future};
use super::rank::{Signature, signature};
use super::refit::Refitted;
use super::{Candidate, Fitted, Search, Subject, Tangent, outliers};
use base::error::{Error, Result};
use base::parameter::GAIN_SD;
use sampling::ensemble::RandomStream;

/// Visible shares (of a norm) below this are rounding and curvature, whose directions mean nothing.
const LEAST_VISIBLE: f64 = 1e-6;
/// Streams of the gains of simulated future cycles, apart from those of their noise.
const GAIN_STREAMS: u64 = 0x6a_11;

/// Visible signatures, whitened and of norm 1; `None` where nothing is visible.
type Visible = Vec<Option<DVector<f64>>>;

/// What a record says of one signature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Score: standard normal, to first order, where the effect is not there.
    pub z: f64,
    /// ‖Pg‖ a unit of amplitude; 0 where nothing is visible.
    pub norm: f64,
}

/// What a record is asked about one effect.
#[derive(Debug, Clone, PartialEq)]
pub struct Asked {
    /// Slug.
    pub slug: &'static str,
    /// Name of the parameter that is its size; empty where the effect is not looked for.
    pub parameter: &'static str,
    /// Why it is not looked for, if it is not.
    pub refused: Option<String>,
    /// Places of its readings: one a point of the grid of what means nothing at its null.
    pub readings: std::ops::Range<usize>,
    /// Its amplitude is (size/unit)^power, size in the parameter's unit.
    pub unit: f64,
    /// 1, or 2 for an effect that begins with its square.
    pub power: f64,
    /// Largest size below and above the null; 0 on the side that the support leaves out.
    pub reach: [f64; 2],
    /// Size at which the parameter is at its null, and whether sizes above it lower the parameter.
    pub null: f64,
    /// Whether sizes count downwards from the null: the support lies below it.
    pub is_downwards: bool,
}

/// What positions say of every signature.
#[derive(Debug, Clone, PartialEq)]
pub struct Told {
    /// From the fitted cycles.
    pub fitted: Vec<Reading>,
    /// From the fitted cycles and from all, under the law and the noise of the fitted ones, its gain no less than future cycles are scored by; `None` where no
    /// cycle is held out.
    pub before_and_after: Option<[Vec<Reading>; 2]>,
}

impl Told {
    /// From all cycles.
    pub fn all(&self) -> &[Reading] {
        self.before_and_after.as_ref().map_or(&self.fitted, |[_, after]| after)
    }

    /// The sets of readings, in the order of [`Said::cosines`].
    pub fn sets_mut(&mut self) -> impl Iterator<Item = &mut Vec<Reading>> {
        std::iter::once(&mut self.fitted).chain(self.before_and_after.iter_mut().flatten())
    }
}

/// What one record says of every effect: all that the judgement of a cohort needs.
#[derive(Debug, Clone, PartialEq)]
pub struct Said {
    /// Every effect of the library, in its order.
    pub effects: Vec<Asked>,
    /// The measured positions.
    pub told: Told,
    /// All of them, under the law and the noise of the fitted ones: what sizes are taken from. Those of the fitted cycles where no cycle is held out.
    pub whole: Vec<Reading>,
    /// Of every simulated record without any effect.
    pub simulated: Vec<Told>,
    /// Cosines of visible signatures, of each set of readings.
    pub cosines: Vec<DMatrix<f64>>,
}

/// A record's base model at its fit.
pub struct Based {
    /// The model and its fit.
    pub base: Refitted,
    /// Rows that were left out as outliers of the tracker.
    pub outlier_rows: Vec<usize>,
    /// Whether the base leaves more than the noise allows.
    pub leaves_too_much: bool,
    /// Root mean square error (µm) of the base on the scored cycle and the positions there; `None` where no cycle is held out.
    pub rmse_heldout: Option<(f64, usize)>,
}

/// Reads a record: the base fitted, every effect's signature at that fit, and as many simulated records.
///
/// # Errors
/// Whatever fitting the base refuses.
pub fn sketch(subject: &Subject, n_simulations: usize, seed: u64) -> Result<(Said, Based)> {
    let (subject, fitted, outlier_rows) = outliers::without(subject, &subject.base())?;
    let base = Refitted { candidate: subject.base(), fitted, future: None };
    let of = |effect: &&'static dyn models::effects::Effect| asked(&subject, &base, effect.slug());
    let found: Vec<(Asked, Vec<Vec<f64>>)> = subject.library().effects().par_iter().map(of).collect::<Result<_>>()?;
    let (mut effects, mut columns_m) = (Vec::new(), Vec::new());
    for (asked, columns) in found {
        let first = columns_m.len();
        columns_m.extend(columns);
        effects.push(Asked { readings: first..columns_m.len(), ..asked });
    }
    let is_scored = subject.scored_m.iter().any(Option::is_some);
    let whole = is_scored.then(|| whole(&subject)).transpose()?;
    let (told, directions) = told(&subject, whole.as_ref(), (&base.candidate, &base.fitted), &columns_m)?;
    let of_whole = match &whole {
        Some(whole) => read(whole, &base.candidate, &base.fitted, &columns_m)?.0,
        None => told.fitted.clone(),
    };
    let cosines = directions.iter().map(cosines).collect();
    let chance = |number: usize| -> Result<Told> {
        let position_m = with_gains_of_future_cycles(&subject, &base, (seed, number));
        let data = subject.with_positions(&position_m);
        let whole = whole.as_ref().map(|own| own.with_positions(&position_m));
        let start = (base.fitted.theta.clone(), base.fitted.noise);
        let fitted = data.fit(&base.candidate, &[start], Search::Local)?;
        Ok(self::told(&data, whole.as_ref(), (&base.candidate, &fitted), &columns_m)?.0)
    };
    let simulated = (0..n_simulations).into_par_iter().map(chance).collect::<Result<_>>()?;
    let leaves_too_much = misfit(&subject, &base, &[])?.is_too_large();
    let n_scored = subject.scored_m.iter().flatten().count();
    let rmse_heldout = base.fitted.rmse_m(&subject.scored_m).map(|rmse_m| (1e6 * rmse_m, n_scored));
    let said = Said { effects, told, whole: of_whole, simulated, cosines };
    Ok((said, Based { base, outlier_rows, leaves_too_much, rmse_heldout }))
}

/// What positions say of columns (m, one value a row of the record) beside a fit, and the directions of each set of readings. `whole` has the scored cycles among the fitted ones.
fn told(
    subject: &Subject,
    whole: Option<&Subject>,
    (candidate, fitted): (&Candidate, &Fitted),
    columns_m: &[Vec<f64>],
) -> Result<(Told, Vec<Visible>)> {
    let (readings, directions) = read(subject, candidate, fitted, columns_m)?;
    let Some(whole) = whole else {
        return Ok((Told { fitted: readings, before_and_after: None }, vec![directions]));
    };
    let noise = of_future(subject.noise(), fitted.noise);
    let wary = Fitted { noise, ..fitted.clone() };
    let (before, of_before) = read(subject, candidate, &wary, columns_m)?;
    let (after, of_after) = read(whole, candidate, &wary, columns_m)?;
    let told = Told { fitted: readings, before_and_after: Some([before, after]) };
    Ok((told, vec![directions, of_before, of_after]))
}

/// Positions (m) simulated from the base and its noise. A cycle that no fit has seen has a gain of its own: as large as they are scored by, also where few fitted cycles show none.
fn with_gains_of_future_cycles(subject: &Subject, base: &Refitted, (seed, number): (u64, usize)) -> Vec<f64> {
    let mut position_m = simulated_m(subject, base, seed, number);
    let gain_sd = (GAIN_FLOOR.powi(2) - subject.noise().value(&base.fitted.noise, &GAIN_SD).powi(2)).max(0.0).sqrt();
    let mut stream = RandomStream::new(seed ^ GAIN_STREAMS, number as u64);
    let experiment = subject.experiment();
    for cycle in &experiment.heldout_cycles {
        let gain = gain_sd * stream.normal();
        let rows = experiment.record.cycle.iter().zip(&base.fitted.position_m).zip(&mut position_m);
        rows.filter(|((own, _), _)| *own == cycle).for_each(|((_, x), position_m)| *position_m += gain * x);
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

/// The same experiment with the scored cycles among the fitted ones; outliers stay out.
pub fn whole(subject: &Subject) -> Result<Subject> {
    let experiment = subject.experiment();
    let cycles: Vec<u32> = experiment.calibration_cycles.iter().chain(&experiment.heldout_cycles).copied().collect();
    let left_out: Vec<usize> = (0..subject.fitted_m.len())
        .filter(|row| subject.fitted_m[*row].is_none() && subject.scored_m[*row].is_none())
        .collect();
    Ok(subject.with_cycles(&cycles, &[])?.without_rows(&left_out))
}

/// An effect and its columns; none where it is not looked for.
fn asked(subject: &Subject, base: &Refitted, slug: &'static str) -> Result<(Asked, Vec<Vec<f64>>)> {
    let not = |why: String| {
        let asked = Asked {
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
        return not("it shows nothing here".into());
    }
    let readings = 0..columns_m.len();
    Ok((Asked { slug, parameter, refused: None, readings, unit, power, reach, null, is_downwards }, columns_m))
}

/// Readings of columns (m, one value a row of the record) beside a fit, over the fitted cycles, and their unit directions.
fn read(
    subject: &Subject,
    candidate: &Candidate,
    fitted: &Fitted,
    columns_m: &[Vec<f64>],
) -> Result<(Vec<Reading>, Visible)> {
    let tangent = Tangent::new(subject, candidate, fitted)?;
    let residual = tangent.projected_residual();
    let of = |white: DVector<f64>| {
        let whole = white.norm();
        let visible = tangent.project(white);
        let norm = visible.norm();
        // NaN counts as nothing, too.
        if norm > LEAST_VISIBLE * whole && norm.is_finite() {
            let direction = visible / norm;
            (Reading { z: direction.dot(&residual), norm }, Some(direction))
        } else {
            (Reading { z: 0.0, norm: 0.0 }, None)
        }
    };
    Ok(tangent.whiten(columns_m).into_iter().map(of).unzip())
}
