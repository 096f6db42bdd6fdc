//! A law that another program computes, learnt for one record over a box of its parameters.
//!
//! Its trajectories at a design of points become few time modes with polynomials for amplitudes, in logarithms of positive parameters. Each mode is split into what a linear law of given rates makes of
//! the commanded force and what that leaves ([`Learnt`]): loads then act on the linear part as on any law. How near this comes to the program under other forces is measured by asking it; where it is
//! not near enough, that load is not followed.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::chart::{dot, modes};
use super::drive::Drive;
use super::large::LoadNumber;
use super::polynomial::Basis;
use crate::error::{Error, Result};
use crate::experiment::Force;
use crate::model::{Response, TrainedRange};
use crate::number::Dual;
use crate::stages::{Learnt, LearntRecord, Load, Spatial, Spread, Stages};

/// Calls that learning may take, those of loads not counted.
const MOST_CALLS: usize = 2000;
/// Points that check what was learnt.
const N_CHECKS: u32 = 32;
/// Of them, those at which every load is checked.
const N_LOAD_CHECKS: usize = 8;
/// Degrees that are tried, one after the other.
const DEGREES: [usize; 11] = [1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 20];
/// Share of the tolerance that modes may leave.
const SHARE_OF_MODES: f64 = 0.1;
/// Rates of the linear law a decade, and beyond the record's shortest step and length.
const RATES_A_DECADE: f64 = 3.0;
/// Singular values of its columns below this share of the largest carry nothing.
const SMALLEST_SINGULAR: f64 = 1e-9;
/// Sizes of loads at which they are checked: of factors, and of the offset over the largest force.
const FACTOR_SIZE: f64 = 0.2;
/// A load is followed where the error is below this share of what the load does, if not below the tolerance.
const SHARE_OF_CHANGE: f64 = 0.03;
/// Trajectories that differ by less than this share of their size are the same.
const SAME: f64 = 1e-10;

/// The record, and how near to the program its trajectories must be learnt.
#[derive(Debug, Clone, Copy)]
pub struct OutsideRecord<'a> {
    /// Times of its rows, in s.
    pub time_s: &'a [f64],
    /// The commanded force.
    pub force: Force<'a>,
    /// Largest root mean square error, in m.
    pub tolerance_m: f64,
    /// Delay and lag at which these are checked, in s.
    pub late_s: f64,
}

/// Asks the program: its parameters and a force → positions in m at the record's rows.
pub type Ask<'a> = dyn Fn(&[f64], &Drive) -> Result<Vec<f64>> + Sync + 'a;

/// What was learnt.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OutsideSurface {
    ranges: Vec<TrainedRange>,
    degree: usize,
    modes: Vec<Vec<f64>>,
    coefficients: Vec<Vec<f64>>,
    /// Largest root mean square error (m) at points that trained nothing.
    pub error_m: f64,
    /// Calls that were made.
    pub n_calls: usize,
    loads: Vec<FollowedLoad>,
}

/// How a load is followed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct FollowedLoad {
    number: LoadNumber,
    /// Largest root mean square error (m) under it.
    error_m: f64,
    /// Why it is not followed, if it is not.
    refusal: Option<String>,
}

impl OutsideSurface {
    /// Learns a law over ranges of its parameters.
    ///
    /// # Errors
    /// Those of the program's answers; [`Error::Numerical`] where no polynomials within the calls that are allowed come near enough, and where nothing moves.
    pub fn learn(ranges: &[TrainedRange], record: &OutsideRecord<'_>, ask: &Ask<'_>) -> Result<Self> {
        let n_free = ranges.iter().filter(|range| is_free(range)).count();
        let commanded = Drive::commanded(record.time_s, record.force);
        let at = |place: &Vec<f64>| ask(&parameters_at(ranges, place), &commanded);
        let mut checks: Vec<Vec<f64>> = Vec::new();
        let mut runs: Vec<Vec<f64>> = Vec::new();
        let mut nearest: Option<f64> = None;
        for degree in DEGREES {
            if N_CHECKS as usize + Basis::n_points(n_free, degree) > MOST_CALLS {
                break;
            }
            let Some(basis) = Basis::new(n_free, degree, N_CHECKS) else { break };
            if checks.is_empty() {
                checks = basis.checks.par_iter().map(at).collect::<Result<_>>()?;
            }
            let more: Vec<Vec<f64>> = basis.design[runs.len()..].par_iter().map(at).collect::<Result<_>>()?;
            runs.extend(more);
            let modes = modes(runs.clone(), SHARE_OF_MODES * record.tolerance_m);
            let coefficients = modes
                .iter()
                .map(|mode| {
                    let amplitudes = DVector::from_iterator(runs.len(), runs.iter().map(|run| dot(mode, run)));
                    (&basis.fit * amplitudes).iter().copied().collect()
                })
                .collect();
            let mut surface = Self {
                ranges: ranges.to_vec(),
                degree,
                modes,
                coefficients,
                error_m: 0.0,
                n_calls: checks.len() + runs.len(),
                loads: Vec::new(),
            };
            for (place, run) in basis.checks.iter().zip(&checks) {
                let found = surface.trajectory_m(&basis.values(place));
                surface.error_m = surface.error_m.max(rms(found.iter().zip(run).map(|(a, b)| a - b)));
            }
            if surface.error_m <= record.tolerance_m {
                surface.check_loads(record, &basis.checks, &checks, ask)?;
                return Ok(surface);
            }
            nearest = Some(surface.error_m);
        }
        let nearest_um = 1e6 * nearest.unwrap_or(f64::NAN);
        Err(Error::numerical(
            format!(
                "what {} calls taught of somebody else's model misses it by {nearest_um:.3} µm over the box of the priors, and a tenth of the noise is {:.3} µm",
                checks.len() + runs.len(),
                1e6 * record.tolerance_m
            ),
            "narrow the priors of the law's parameters, or fix some of them (--set)",
        ))
    }

    fn trajectory_m(&self, polynomials: &[f64]) -> Vec<f64> {
        let mut position_m = vec![0.0; self.modes.first().map_or(0, Vec::len)];
        for (mode, coefficients) in self.modes.iter().zip(&self.coefficients) {
            let amplitude = dot(polynomials, coefficients);
            position_m.iter_mut().zip(mode).for_each(|(x, value)| *x += amplitude * value);
        }
        position_m
    }

    /// Asks for trajectories under every load, at points that trained nothing.
    fn check_loads(
        &mut self,
        record: &OutsideRecord<'_>,
        places: &[Vec<f64>],
        still_m: &[Vec<f64>],
        ask: &Ask<'_>,
    ) -> Result<()> {
        let OutsideRecord { time_s, force, .. } = *record;
        let model = OutsideModel::new(self.clone(), time_s, force)?;
        let response = Response::new(time_s, force, time_s.len());
        let largest_n = force.at_rows_n.iter().fold(0.0_f64, |most, force_n| most.max(force_n.abs()));
        for number in LoadNumber::ALL {
            let size = match number {
                LoadNumber::PositiveFactor | LoadNumber::NegativeFactor => FACTOR_SIZE,
                LoadNumber::Offset => FACTOR_SIZE * largest_n,
                LoadNumber::Delay | LoadNumber::Lag => record.late_s,
            };
            let is_signed = !matches!(number, LoadNumber::Delay | LoadNumber::Lag);
            let at = |(k, (place, still_m)): (usize, (&Vec<f64>, &Vec<f64>))| -> Result<[f64; 3]> {
                let sign = if is_signed && k % 2 == 1 { -1.0 } else { 1.0 };
                let load = number.alone(sign * size * (1 + k % 4) as f64 / 4.0);
                let parameters = parameters_at(&self.ranges, place);
                let asked_m = ask(&parameters, &Drive::behind(&load, time_s, force))?;
                let found_m = model.trajectory_m(&parameters, load, &response)?;
                let change = |moved: &[f64]| rms(moved.iter().zip(still_m).map(|(a, b)| a - b));
                let error_m = rms(found_m.iter().zip(&asked_m).map(|(a, b)| a - b));
                Ok([error_m, change(&asked_m), rms(asked_m.iter().copied())])
            };
            let pairs: Vec<_> = places.iter().zip(still_m).take(N_LOAD_CHECKS).enumerate().collect();
            let found: Vec<[f64; 3]> = pairs.into_par_iter().map(at).collect::<Result<_>>()?;
            self.n_calls += found.len();
            let error_m = found.iter().fold(0.0_f64, |worst, own| worst.max(own[0]));
            let is_asked = force.at_rows_n.iter().any(|force_n| match number {
                LoadNumber::PositiveFactor => *force_n > 0.0,
                LoadNumber::NegativeFactor => *force_n < 0.0,
                _ => true,
            });
            let is_deaf = is_asked && found.iter().all(|[_, change_m, size_m]| *change_m <= SAME * size_m);
            let is_near = found.iter().all(|[error_m, change_m, _]| {
                *error_m <= record.tolerance_m.max(SHARE_OF_CHANGE * change_m) + self.error_m
            });
            let refusal = if is_deaf {
                Some("somebody else's model gives the same answer for two different forces, so that loads cannot be followed".into())
            } else if is_near {
                None
            } else {
                Some(format!(
                    "{} is followed to {:.3} µm only beside somebody else's law, and a tenth of the noise is {:.3} µm",
                    words(number),
                    1e6 * error_m,
                    1e6 * record.tolerance_m
                ))
            };
            self.loads.push(FollowedLoad { number, error_m, refusal });
        }
        Ok(())
    }

    /// Largest root mean square error (m) under the loads that are followed; `None` where none is.
    pub fn load_error_m(&self) -> Option<f64> {
        self.loads.iter().filter(|own| own.refusal.is_none()).map(|own| own.error_m).reduce(f64::max)
    }

    /// Whether as many modes and coefficients are there as belong together.
    pub fn is_whole(&self, n_rows: usize) -> bool {
        self.modes.len() == self.coefficients.len() && self.modes.iter().all(|mode| mode.len() == n_rows)
    }
}

fn words(number: LoadNumber) -> &'static str {
    match number {
        LoadNumber::PositiveFactor => "a factor of forces forward",
        LoadNumber::NegativeFactor => "a factor of forces backward",
        LoadNumber::Offset => "a force that is added",
        LoadNumber::Delay => "a force that comes late",
        LoadNumber::Lag => "a force that lags",
    }
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut n) = (0.0, 0_usize);
    for value in values {
        sum += value * value;
        n += 1;
    }
    (sum / n.max(1) as f64).sqrt()
}

fn is_free(range: &TrainedRange) -> bool {
    range.upper > range.lower
}

/// Parameters at a place of the box; those whose range is positive are moved by their logarithm.
fn parameters_at(ranges: &[TrainedRange], place: &[f64]) -> Vec<f64> {
    let mut places = place.iter();
    let value = |range: &TrainedRange| {
        let (true, Some(x)) = (is_free(range), if is_free(range) { places.next() } else { None }) else {
            return range.lower;
        };
        let share = 0.5 * (1.0 + x);
        if range.lower > 0.0 {
            range.lower * (range.upper / range.lower).powf(share)
        } else {
            range.lower + share * (range.upper - range.lower)
        }
    };
    ranges.iter().map(value).collect()
}

/// Answers from what was learnt.
#[derive(Debug)]
pub struct OutsideModel {
    surface: OutsideSurface,
    basis: Basis,
    record: Arc<LearntRecord>,
}

impl OutsideModel {
    /// For the record that it was learnt for.
    ///
    /// # Errors
    /// [`Error::Numerical`] where the linear law cannot be fitted, as to a record without a force.
    pub fn new(surface: OutsideSurface, time_s: &[f64], force: Force<'_>) -> Result<Self> {
        let n_free = surface.ranges.iter().filter(|range| is_free(range)).count();
        let basis = Basis::of_degree(n_free, surface.degree);
        let record = Arc::new(split(&surface.modes, time_s, force)?);
        Ok(Self { surface, basis, record })
    }

    /// What was learnt.
    pub fn surface(&self) -> &OutsideSurface {
        &self.surface
    }

    /// What stands for the law at stages of it.
    ///
    /// # Errors
    /// [`Error::OutsideTrainedRange`], and [`Error::Numerical`] for loads that are not followed.
    pub fn spread(&self, stages: &Stages) -> Result<Option<Spread>> {
        let Some(Spatial::Outside(parameters)) = &stages.spatial else { return Ok(None) };
        if !stages.load.gradient_per_m.is_constant(0.0) {
            return Err(not_followed(
                "a force that depends on the position is not followed beside somebody else's law",
            ));
        }
        for FollowedLoad { number, refusal, .. } in &self.surface.loads {
            if let Some(refusal) = refusal.as_ref().filter(|_| !number.of(&stages.load).is_constant(0.0)) {
                return Err(not_followed(refusal));
            }
        }
        let mut place = Vec::new();
        for (range, value) in self.surface.ranges.iter().zip(parameters) {
            if !range.contains(value.value) {
                return Err(Error::OutsideTrainedRange {
                    parameter: range.name.clone(),
                    value: value.value,
                    lower: range.lower,
                    upper: range.upper,
                });
            }
            if is_free(range) && range.lower > 0.0 {
                let (middle, half) = (0.5 * (range.lower * range.upper).ln(), 0.5 * (range.upper / range.lower).ln());
                place.push((value.ln() - Dual::constant(middle)) * (1.0 / half));
            } else if is_free(range) {
                let (middle, half) = (0.5 * (range.lower + range.upper), 0.5 * (range.upper - range.lower));
                place.push((*value - Dual::constant(middle)) * (1.0 / half));
            }
        }
        let polynomials = self.basis.values(&place);
        let amplitude = |coefficients: &Vec<f64>| {
            polynomials.iter().zip(coefficients).fold(Dual::ZERO, |sum, (value, c)| sum + *value * *c)
        };
        let amplitudes = self.surface.coefficients.iter().map(amplitude).collect();
        Ok(Some(Spread::Learnt(Learnt { record: self.record.clone(), amplitudes })))
    }

    fn trajectory_m(&self, parameters: &[f64], load: Load, response: &Response) -> Result<Vec<f64>> {
        let law = parameters.iter().copied().map(Dual::constant).collect();
        let mut stages = Stages { load, spatial: Some(Spatial::Outside(law)), ..Stages::of_law(Vec::new()) };
        stages.spread = self.spread(&stages)?;
        response.trajectory_m(&stages, 1.0)
    }
}

fn not_followed(why: &str) -> Error {
    Error::numerical(why, "leave this effect of the load out")
}

/// Modes as a linear law and what it leaves.
fn split(modes: &[Vec<f64>], time_s: &[f64], force: Force<'_>) -> Result<LearntRecord> {
    let steps = time_s.windows(2).map(|pair| pair[1] - pair[0]);
    let shortest_s = steps.fold(f64::INFINITY, f64::min);
    let span_s = time_s.last().zip(time_s.first()).map_or(0.0, |(last, first)| last - first);
    let rates_per_s: Vec<f64> = if shortest_s.is_finite() && shortest_s > 0.0 {
        let decades = (3.0 * span_s / shortest_s).log10().max(0.0);
        let n = 1 + (RATES_A_DECADE * decades).ceil() as usize;
        (0..n).map(|k| (3.0 / shortest_s) * 10.0_f64.powf(-decades * k as f64 / (n.max(2) - 1) as f64)).collect()
    } else {
        Vec::new()
    };
    let n_numbers = rates_per_s.len() + 2;
    let response = Response::new(time_s, force, time_s.len());
    let column = |place: usize| -> Result<Vec<f64>> {
        let unit = (0..n_numbers).map(|k| f64::from(u8::from(k == place))).collect();
        let record = LearntRecord {
            time_s: time_s.to_vec(),
            force: force.into(),
            rates_per_s: rates_per_s.clone(),
            laws: vec![unit],
            left_m: vec![vec![0.0; time_s.len()]],
        };
        let learnt = Learnt { record: Arc::new(record), amplitudes: vec![Dual::ONE] };
        let mut stages = Stages::of_law(Vec::new());
        (stages.spatial, stages.spread) = (Some(Spatial::Outside(Vec::new())), Some(Spread::Learnt(learnt)));
        response.trajectory_m(&stages, 1.0)
    };
    let columns: Vec<Vec<f64>> = (0..n_numbers).map(column).collect::<Result<_>>()?;
    let sizes: Vec<f64> = columns.iter().map(|own| dot(own, own).sqrt().max(f64::MIN_POSITIVE)).collect();
    let design = DMatrix::from_fn(time_s.len(), n_numbers, |row, k| columns[k][row] / sizes[k]);
    let svd = design.clone().svd(true, true);
    let smallest = SMALLEST_SINGULAR * svd.singular_values.iter().fold(0.0_f64, |most, own| most.max(*own));
    let (mut laws, mut left_m) = (Vec::new(), Vec::new());
    for mode in modes {
        let wanted = DVector::from_column_slice(mode);
        let numbers = svd.solve(&wanted, smallest).map_err(|_| {
            Error::numerical(
                "a linear law cannot be fitted to what was learnt",
                "give a record with a force that moves",
            )
        })?;
        let left = &wanted - &design * &numbers;
        laws.push(numbers.iter().zip(&sizes).map(|(number, size)| number / size).collect());
        left_m.push(left.iter().copied().collect());
    }
    Ok(LearntRecord { time_s: time_s.to_vec(), force: force.into(), rates_per_s, laws, left_m })
}
