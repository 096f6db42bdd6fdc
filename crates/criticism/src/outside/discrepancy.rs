//! Smooth residual structure: a Gaussian process of one quantity, fitted to the part of the residual that the model's parameters cannot absorb.

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rayon::prelude::*;

use super::OutsideRequest;
use super::look::starts;
use super::setting::SearchSetting;
use super::shape::StructureShape;
use crate::derivatives::columns_m;
use crate::noise_fit::natural;
use crate::{Candidate, Fitted, Search, Subject, Tangent};
use base::error::Result;
use sampling::ensemble::RandomStream;

base::named_enum! {
    /// Quantity on which a discrepancy depends.
    pub enum Axis {
        /// Elapsed fraction of the cycle.
        Phase = "cycle_phase",
        /// Time since the last force step, in s. The discrepancy changes its sign with the direction of the step.
        TimeSinceStep = "time_since_step",
        /// Time, in s.
        AbsoluteTime = "time",
        /// Force (N) that acts just before the time of a row.
        Force = "force",
    }
    /// Name of the axis in the document of `diagnose`.
    pub fn name
}

impl Axis {
    fn basis(self) -> StructureShape {
        match self {
            Self::Phase => StructureShape::CycleLocked { n_harmonics: 8 },
            Self::TimeSinceStep => StructureShape::SinceStep { n_knots: 12 },
            Self::AbsoluteTime => StructureShape::SlowChange { n_waves: 14 },
            Self::Force => StructureShape::ForceLevel,
        }
    }

    /// Prior covariance of the basis functions' amplitudes, as a fraction of the process's variance: that of a squared exponential kernel. The kernel's length is `length` knots,
    /// or 1/`length` waves.
    fn covariance(self, n: usize, length: f64) -> DMatrix<f64> {
        let kernel = |distance: f64| (-0.5 * distance * distance).exp();
        DMatrix::from_fn(n, n, |i, j| match self {
            Self::TimeSinceStep => kernel((i as f64 - j as f64) / length),
            _ if i != j => 0.0,
            Self::Phase => kernel((1 + i / 2) as f64 / length),
            Self::AbsoluteTime => kernel((1 + i) as f64 / length),
            Self::Force => 1.0,
        })
    }
}

/// A smooth residual structure, orthogonal to the tangent space of the model's parameters, so that it shifts none of them.
#[derive(Debug, Clone, PartialEq)]
pub struct Discrepancy {
    /// Axis of the process.
    pub axis: Axis,
    /// Gain in log evidence by the process, at the best size and smoothness, in nats.
    pub gain_nats: f64,
    /// p of `gain_nats`, from simulations, corrected for all axes.
    pub p_familywise: f64,
    /// Root mean square (µm) of the process's mean over the fitted rows.
    pub size_um: f64,
    /// Value of the axis's quantity, one per row of the record.
    pub coordinate: Vec<f64>,
    /// Sign of the process at each row: that of the last force step for [`Axis::TimeSinceStep`], 1 for all other axes.
    pub sign: Vec<f64>,
    /// Posterior mean (m), one per row, to be added to a prediction.
    pub mean_m: Vec<f64>,
    /// Posterior standard deviation (m), one per row; a prediction's variance grows by its square.
    pub sd_m: Vec<f64>,
    /// Residual (m) of the model without the process, after the model's parameters have absorbed their part, at the fitted rows; `None` in other rows.
    pub residual_m: Vec<Option<f64>>,
    /// Fit of the model without the process. The noise was estimated together with the process.
    pub fitted: Fitted,
}

/// Standard deviations of the process that are tried, as multiples of the known or estimated noise standard deviation.
const SIZES: [f64; 9] = [0.06, 0.12, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0];
/// Smoothness of the processes that are tried: the correlation length in knots, or the number of waves beyond which amplitudes become small.
const LENGTHS: [f64; 4] = [1.0, 2.0, 4.0, 8.0];

/// A Gaussian process of one axis, size and smoothness. Its independent coordinates are combinations of the basis functions whose contributions to the whitened data are
/// uncorrelated. Along each of them the data are normal, with a variance of 1 plus an entry of `variances`.
struct Process {
    /// Matrix that converts the process's independent coordinates into amplitudes of the basis functions.
    to_amplitudes: DMatrix<f64>,
    /// Prior variances of the process's independent coordinates, in the whitened data.
    variances: DVector<f64>,
    /// Contributions of the process's independent coordinates to the whitened data, one column each; their squared lengths are `variances`.
    directions: DMatrix<f64>,
}

impl Process {
    fn new(visible: &DMatrix<f64>, axis: Axis, length: f64, sd: f64) -> Self {
        let prior = axis.covariance(visible.ncols(), length) * (sd * sd);
        let SymmetricEigen { eigenvectors, eigenvalues } = prior.symmetric_eigen();
        let root = &eigenvectors * DMatrix::from_diagonal(&eigenvalues.map(|value| value.max(0.0).sqrt()));
        let scaled = visible * &root;
        let SymmetricEigen { eigenvectors, eigenvalues } = scaled.tr_mul(&scaled).symmetric_eigen();
        let directions = scaled * &eigenvectors;
        Self { to_amplitudes: root * eigenvectors, variances: eigenvalues.map(|value| value.max(0.0)), directions }
    }

    /// Log evidence (nats) with the process, relative to white noise alone.
    fn gain_nats(&self, residual: &DVector<f64>) -> f64 {
        let along = self.directions.tr_mul(residual);
        along.iter().zip(&self.variances).map(|(z, d)| 0.5 * (z * z / (1.0 + d) - d.ln_1p())).sum()
    }

    /// Posterior mean of the amplitudes, and a square root of their covariance.
    fn posterior(&self, residual: &DVector<f64>) -> (DVector<f64>, DMatrix<f64>) {
        let along = self.directions.tr_mul(residual);
        let mean = along.component_div(&self.variances.map(|d| 1.0 + d));
        let sds = self.variances.map(|d| 1.0 / (1.0 + d).sqrt());
        (&self.to_amplitudes * mean, &self.to_amplitudes * DMatrix::from_diagonal(&sds))
    }
}

/// One axis, with the data and the Gaussian processes that are tried along it.
struct PreparedDiscrepancy {
    axis: Axis,
    tangent: Tangent,
    fitted: Fitted,
    columns: Vec<Vec<f64>>,
    processes: Vec<Process>,
}

/// Fits Gaussian processes of phase, time since the step, absolute time and force to the residual in the fitted rows. Returns them in order of decreasing gain. For each process,
/// the noise is estimated together with a free curve of its axis, so that the noise does not absorb the structure.
///
/// # Errors
/// Errors of [`Subject::fit`] and [`Tangent::new`].
pub fn discrepancies(
    subject: &Subject,
    candidate: &Candidate,
    fitted: &Fitted,
    request: &OutsideRequest,
) -> Result<Vec<Discrepancy>> {
    let setting = SearchSetting::new(subject, candidate, fitted)?;
    let prepared: Vec<PreparedDiscrepancy> =
        Axis::ALL.par_iter().map(|axis| prepare(subject, candidate, fitted, &setting, *axis)).collect::<Result<_>>()?;
    let best = |prepared: &PreparedDiscrepancy, residual: &DVector<f64>| {
        let gains = prepared.processes.iter().map(|process| process.gain_nats(residual)).enumerate();
        gains.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, 0.0))
    };
    let by_chance = |simulation: usize| {
        let mut stream = RandomStream::new(request.seed, simulation as u64);
        let white = DVector::from_fn(prepared[0].tangent.n_rows(), |_, _| stream.normal());
        prepared.iter().map(|prepared| best(prepared, &white).1).fold(0.0, f64::max)
    };
    let chance: Vec<f64> = (0..request.n_simulations).into_par_iter().map(by_chance).collect();
    let mut found = Vec::with_capacity(prepared.len());
    for of_axis in &prepared {
        let (place, gain_nats) = best(of_axis, of_axis.tangent.residual());
        let as_good = chance.iter().filter(|other| **other >= gain_nats).count();
        let p_familywise = (1 + as_good) as f64 / (1 + chance.len()) as f64;
        let Some(process) = of_axis.processes.get(place) else { continue };
        found.push(of_axis.discrepancy(subject, candidate, &setting, process, gain_nats, p_familywise)?);
    }
    found.sort_by(|a, b| b.gain_nats.total_cmp(&a.gain_nats));
    Ok(found)
}

fn prepare(
    subject: &Subject,
    candidate: &Candidate,
    fitted: &Fitted,
    setting: &SearchSetting,
    axis: Axis,
) -> Result<PreparedDiscrepancy> {
    let columns = axis.basis().columns_m(setting);
    let extended = candidate.with_columns(columns.clone());
    let start = extended.embed(candidate, &fitted.theta);
    let clean = natural(&subject.noise_prior().white());
    let noise = subject.fit(&extended, &starts(start, fitted, clean), Search::Local)?.noise;
    let pairs = [(fitted.theta.clone(), noise)];
    // The parameters are those of the model alone, since the process describes the residual of that model.
    let alone = subject.fit(candidate, &pairs, Search::Local)?;
    let fitted = Fitted { noise, ..alone };
    let tangent = Tangent::new(subject, candidate, &fitted)?;
    let visible = DMatrix::from_columns(&tangent.visible(&columns));
    let yardstick = 1e6 * subject.reference_noise_m();
    let mut processes = Vec::new();
    for length in LENGTHS {
        processes.extend(SIZES.map(|size| Process::new(&visible, axis, length, size * yardstick)));
    }
    Ok(PreparedDiscrepancy { axis, tangent, fitted, columns, processes })
}

impl PreparedDiscrepancy {
    fn discrepancy(
        &self,
        subject: &Subject,
        candidate: &Candidate,
        setting: &SearchSetting,
        process: &Process,
        gain_nats: f64,
        p_familywise: f64,
    ) -> Result<Discrepancy> {
        let n_rows = setting.time_s.len();
        let parameter_columns_m = columns_m(subject, candidate, &self.fitted.theta)?;
        let white = self.tangent.whiten(&self.columns);
        let mut basis = DMatrix::from_fn(n_rows, self.columns.len(), |row, k| self.columns[k][row]);
        for (k, white) in white.iter().enumerate() {
            let steps = self.tangent.absorbing_step(white).unwrap_or_default();
            for (column, step) in parameter_columns_m.iter().zip(steps) {
                (0..n_rows).for_each(|row| basis[(row, k)] -= step * column[row]);
            }
        }
        let (amplitudes, root) = process.posterior(self.tangent.residual());
        let mean = &basis * amplitudes;
        let spread = basis * root;
        let squares: f64 = setting.rows.iter().map(|row| mean[*row].powi(2)).sum();
        // The fit used another noise. With this noise the parameters absorb slightly more of the residual.
        let steps = self.tangent.absorbing_step(self.tangent.residual()).unwrap_or_default();
        let absorbed_m =
            |row: usize| parameter_columns_m.iter().zip(&steps).map(|(column, step)| step * column[row]).sum::<f64>();
        let left_m = |row: usize| subject.fitted_m[row].map(|y| y - self.fitted.position_m[row] - absorbed_m(row));
        Ok(Discrepancy {
            axis: self.axis,
            gain_nats,
            p_familywise,
            size_um: 1e6 * (squares / setting.rows.len().max(1) as f64).sqrt(),
            coordinate: (0..n_rows).map(|row| coordinate(setting, self.axis, row)).collect(),
            sign: (0..n_rows).map(|row| sign(setting, self.axis, row)).collect(),
            mean_m: mean.iter().copied().collect(),
            sd_m: (0..n_rows).map(|row| spread.row(row).norm()).collect(),
            residual_m: (0..n_rows).map(left_m).collect(),
            fitted: self.fitted.clone(),
        })
    }
}

fn coordinate(setting: &SearchSetting, axis: Axis, row: usize) -> f64 {
    match axis {
        Axis::Phase => setting.phase[row].fract(),
        Axis::TimeSinceStep => setting.since_step[row].1,
        Axis::AbsoluteTime => setting.time_s[row],
        Axis::Force => setting.acting_force_n[row],
    }
}

fn sign(setting: &SearchSetting, axis: Axis, row: usize) -> f64 {
    if axis == Axis::TimeSinceStep { setting.since_step[row].0 } else { 1.0 }
}
