//! Conversion of stages into a linear system of modes, which the kernels integrate.
//!
//! The strain s of a mode with compliance a and rate r obeys s' = r (F̃ − s). Here F̃ = F eᵛᵗ is the force F times the growth at
//! the softening rate v. With Y = C a s e^{−vt} the equation is Y' = κ F − ρ Y, κ = C a r, ρ = r + v. C is the displacement per
//! force at unit creep compliance, in 1/m. The position is e^{vt} (C J₀ F + Σ Y), with J₀ the instantaneous compliance. Softening
//! therefore changes the rates and multiplies the position by a growing factor. A dashpot of fluidity φ is a mode of rate 0 with
//! κ = C φ.

use super::grading::Grading;
use super::numbers::{N_LANES, Number, Real, gather};
use super::prepared_record::{PreparedLine, PreparedRows};
use base::error::{Error, Result};
use base::number::Complex;
use laws::rheology::{Accuracy, RetardationSpectrum, TimeWindow};
use laws::stages::{Load, Observation, ReducedField, Spatial, Stages};

/// Numbers of modes and features of a model. Parameter points of equal shape are computed together. The shape alone determines a point's
/// sequence of operations.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct SystemShape {
    n_modes: usize,
    n_oscillating: usize,
    n_approaches: usize,
    pub delayed: bool,
    pub lagging: bool,
    pub softening: bool,
    pub feedback: bool,
    /// `true` if the recorded position differs from the robot's position.
    pub observed: bool,
    /// `true` if the position is an indenter's depth, which is a root of the linear response.
    pub is_depth: bool,
}

/// Numbers of one parameter point, in the order in which [`System::gather`] reads them, with the point's shape.
#[derive(Debug, Clone)]
pub(super) struct PointNumbers<T> {
    pub shape: SystemShape,
    pub grading: Grading,
    numbers: Vec<T>,
    /// Excess of a nonlinear law's position over that of the linear law, in m at every row; `None` for a linear law.
    pub excess_m: Option<Vec<T>>,
}

/// Mode of the response. Its contribution Y (m) to the position obeys Y' = κ F − ρ Y, with F the force, κ the gain and ρ the rate.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mode<T> {
    /// Gain κ in m/(N·s).
    pub gain: T,
    /// Rate ρ in 1/s.
    pub rate: T,
}

/// Linear system of modes for one or several parameter points of one shape.
#[derive(Debug, Clone)]
pub(super) struct System<S> {
    pub shape: SystemShape,
    /// Largest time steps after switches of the force, for each parameter point.
    pub gradings: [Grading; N_LANES],
    /// Instantaneous displacement of the robot per force, in m/N.
    pub instantaneous: S,
    pub modes: Vec<Mode<S>>,
    pub oscillating: Vec<Mode<Complex<S>>>,
    pub load: Load<S>,
    /// Rate 1/τ of the lag τ, in 1/s.
    pub lag_rate: S,
    pub softening_rate: S,
    pub observation: Observation<S>,
}

/// Shortest relevant time after a switch, divided by the shortest step. This fraction applies if a switch may be between rows or if the
/// force changes between rows.
pub(super) const BETWEEN_ROWS: f64 = 1e-2;

impl<T: Real> PointNumbers<T> {
    /// Converts stages into numbers, without the excess of a nonlinear law's position over that of the linear law. `window` is the range of
    /// times in s at which the record needs the creep compliance.
    pub fn new(stages: &Stages, compliance_per_m: T, window: TimeWindow, record: &PreparedRows) -> Result<Self> {
        let load = &stages.load;
        load.check()?;
        if stages.spread.is_some() && stages.state_law.is_some()
            || stages.state_law.is_some() && load.depends_on_position()
        {
            return Err(Error::numerical(
                "a quantity that depends on a state is combined with a force gradient or a computed displacement field",
                "leave one of them out",
            ));
        }
        let at_rows = !record.is_linear && load.acts_at_rows();
        let shortest_s = window.shortest_s * if at_rows { 1.0 } else { BETWEEN_ROWS };
        let window = TimeWindow { shortest_s, ..window };
        if stages.is_position_controlled {
            let relaxation = RetardationSpectrum::relaxation_of_law(&stages.law, window, Accuracy::Fast)?;
            let relaxation = RetardationSpectrum::of_dual(&relaxation);
            return Ok(Self::with_spectrum(stages, &relaxation, T::constant(1.0) / compliance_per_m, record.largest_n));
        }
        Ok(Self::with_spectrum(stages, &Self::spectrum(stages, window)?, compliance_per_m, record.largest_n))
    }

    /// Retardation spectrum of the gel around the robot.
    fn spectrum<N: Real>(stages: &Stages, window: TimeWindow) -> Result<RetardationSpectrum<N>> {
        Ok(match (&stages.spread, &stages.spatial) {
            (Some(ReducedField::Terms { beside, terms }), _) if stages.softening_rate_per_s.is_constant(0.0) => {
                RetardationSpectrum::spread(&stages.law, beside, terms, window, Accuracy::Fast)?
            }
            (
                Some(ReducedField::Stepped(_)),
                Some(Spatial::Nonlinear(_) | Spatial::Large { .. } | Spatial::External(_)),
            ) if stages.softening_rate_per_s.is_constant(0.0) => {
                RetardationSpectrum::of_law_with_accuracy(&stages.law, window, Accuracy::Fast)?
            }
            (None, None) => RetardationSpectrum::of_law_with_accuracy(&stages.law, window, Accuracy::Fast)?,
            _ => {
                return Err(Error::numerical(
                    "the terms of the displacement field are missing, or the gel also softens",
                    "add the compliance's terms of the field to the stages, and leave `softening` out",
                ));
            }
        })
    }

    /// Converts stages into numbers, with a given retardation spectrum of the law and for commands up to `largest_n` (N).
    pub fn with_spectrum(
        stages: &Stages,
        spectrum: &RetardationSpectrum<T>,
        compliance_per_m: T,
        largest_n: f64,
    ) -> Self {
        let (load, observation) = (&stages.load, &stages.observation);
        let shape = SystemShape {
            n_modes: spectrum.modes.len() + 1,
            n_oscillating: spectrum.oscillating.len(),
            n_approaches: observation.approaches.len(),
            delayed: load.is_delayed(),
            lagging: load.has_lag(),
            softening: !stages.softening_rate_per_s.is_constant(0.0),
            feedback: load.depends_on_position(),
            observed: observation.is_changed(),
            is_depth: observation.is_depth(),
        };
        let lag = load.of::<f64>().lag_rate_per_s();
        let strength_pa = load.feedback_strength_pa(compliance_per_m.value(), load.largest_n(largest_n));
        let grading = if shape.feedback { grading(spectrum, lag, strength_pa) } else { Grading::NONE };
        let rate = T::from_dual(stages.softening_rate_per_s);
        // A softening gel answers a prescribed position by the force of the law, times e^{−rt}.
        let (softening, growth) = if stages.is_position_controlled { (T::constant(0.0), -rate) } else { (rate, rate) };
        let load = load.of::<T>();
        let lag_rate = load.lag_rate_per_s().unwrap_or(T::constant(0.0));
        let mut numbers = Vec::with_capacity(15 + 2 * shape.n_modes + 4 * shape.n_oscillating + 2 * shape.n_approaches);
        numbers.extend([compliance_per_m * spectrum.instantaneous_per_pa, lag_rate, growth]);
        numbers.extend(load.numbers());
        numbers.extend(observation.numbers().into_iter().map(T::from_dual));
        let (real, oscillating) = modes_of(spectrum, compliance_per_m, softening);
        numbers.extend(real.flat_map(|mode| [mode.gain, mode.rate]));
        numbers.extend(oscillating.flat_map(|mode| [mode.gain.re, mode.gain.im, mode.rate.re, mode.rate.im]));
        Self { shape, grading, numbers, excess_m: None }
    }
}

/// Returns the largest steps after switches for a law behind a lag of this rate (1/s); `None` without a lag. For a force gradient, the
/// exponent (gradient times position) is `strength_pa` times the creep compliance.
pub(super) fn grading<T: Real>(spectrum: &RetardationSpectrum<T>, lag_rate: Option<f64>, strength_pa: f64) -> Grading {
    let real = spectrum.modes.iter().map(|mode| (mode.compliance_per_pa.value(), mode.rate_per_s.value()));
    let size = |[re, im]: [T; 2]| re.value().hypot(im.value());
    let complex = spectrum.oscillating.iter().map(|mode| (size(mode.compliance_per_pa), size(mode.rate_per_s)));
    let mut rough: Vec<(f64, f64)> = real.chain(complex).collect();
    let fluidity = spectrum.fluidity_per_pa_s.value();
    let total = spectrum.instantaneous_per_pa.value()
        + rough.iter().map(|(compliance, _)| compliance).sum::<f64>()
        + lag_rate.map_or(0.0, |rate| fluidity / rate);
    // If the total is 0, no decaying mode has an error, and any scale is suitable.
    let inverse = if total > 0.0 { 1.0 / total } else { 1.0 };
    rough.iter_mut().for_each(|(share, _)| *share *= inverse);
    let mut modes: Vec<(f64, f64)> = rough.iter().map(|&(share, rate)| (share * rate, rate)).collect();
    modes.push((fluidity * inverse, 0.0));
    rough.extend(lag_rate.map(|rate| (1.0, rate)));
    Grading::new(&rough, &modes, strength_pa / inverse)
}

/// Returns the real and the oscillating modes of the response to a force, with `compliance_per_m` in 1/m. The dashpot's mode is the last
/// real mode.
pub(super) fn modes_of<T: Real>(
    spectrum: &RetardationSpectrum<T>,
    compliance_per_m: T,
    softening: T,
) -> (impl Iterator<Item = Mode<T>>, impl Iterator<Item = Mode<Complex<T>>>) {
    let real = spectrum.modes.iter().map(move |mode| Mode {
        gain: compliance_per_m * mode.compliance_per_pa * mode.rate_per_s,
        rate: mode.rate_per_s + softening,
    });
    let flowing = Mode { gain: compliance_per_m * spectrum.fluidity_per_pa_s, rate: softening };
    let oscillating = spectrum.oscillating.iter().map(move |mode| {
        let complex = |[re, im]: [T; 2]| Complex { re, im };
        let rate = complex(mode.rate_per_s);
        let gain = (complex(mode.compliance_per_pa) * rate).times(compliance_per_m);
        Mode { gain, rate: Complex { re: rate.re + softening, im: rate.im } }
    });
    (real.chain([flowing]), oscillating)
}

impl<S: Number> System<S> {
    /// Builds the system of several parameter points of one shape. Unused lanes repeat the last point.
    pub fn gather(points: &[&PointNumbers<S::Lane>]) -> Self {
        let shape = points[0].shape;
        let mut next = 0;
        let mut take = || {
            next += 1;
            gather::<S>(|lane| points[lane.min(points.len() - 1)].numbers[next - 1])
        };
        Self {
            shape,
            gradings: std::array::from_fn(|lane| points[lane.min(points.len() - 1)].grading),
            instantaneous: take(),
            lag_rate: take(),
            softening_rate: take(),
            load: Load::of_numbers(std::array::from_fn(|_| take())),
            observation: Observation::of_numbers(shape.n_approaches, &mut take),
            modes: (0..shape.n_modes).map(|_| Mode { gain: take(), rate: take() }).collect(),
            oscillating: (0..shape.n_oscillating)
                .map(|_| Mode { gain: Complex { re: take(), im: take() }, rate: Complex { re: take(), im: take() } })
                .collect(),
        }
    }

    /// Returns the force (N) of a command at a time (s) and its rate (N/s), with the load's factors but without its offset.
    pub fn scaled(&self, line: PreparedLine, time_s: f64) -> (S, S) {
        let scaled = |commanded: f64| self.load.scaled(commanded, line.is_positive);
        (scaled(line.at_n(time_s)), scaled(line.slope_n_per_s))
    }

    /// Time in s by which a lag delays a linearly changing force; 0 without a lag.
    pub fn late_s(&self) -> S {
        if self.shape.lagging { S::constant(1.0) / self.lag_rate } else { S::constant(0.0) }
    }
}
