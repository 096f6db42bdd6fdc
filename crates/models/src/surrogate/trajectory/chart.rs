//! Box in the space of a law's coordinates, with a surrogate of the trajectories in it. The surrogate combines a few time modes (functions
//! of time) with amplitudes that are polynomials of the coordinates. A box may instead consist of two halves, or have no surrogate.

use super::polynomial::Basis;
use base::number::Scalar;
use serde::{Deserialize, Serialize};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Largest number of time modes (functions of time that the surrogate of a box combines).
const MOST_MODES: usize = 40;
/// Largest residual of a training trajectory after its projection on the time modes, as a fraction of the accepted error (tolerance). The
/// rest of the tolerance remains for the polynomials.
const SHARE_OF_MODES: f64 = 0.1;
/// Largest number of times that a box is halved.
const MOST_HALVINGS: usize = 2;
/// Ratio of the error to the tolerance above which a box is not halved, because its halves would also fail.
const FARTHEST: f64 = 12.0;

/// Function that runs the stepper (the reduced model that is stepped in time) at coordinates. It returns the excess (m) over the linear
/// law's position at every row at unit modulus, and the displacement (m) that scales errors. Both may have a common factor.
pub(super) type Run<'a> = dyn Fn(&[f64]) -> Option<Trained> + Sync + 'a;
pub(super) type Trained = (Vec<f64>, f64);

/// Box in the space of a law's coordinates, with its trained content.
#[derive(Debug)]
pub(super) struct CoordinateBox {
    lower: Vec<f64>,
    upper: Vec<f64>,
    n_halvings: usize,
    /// Runs of the stepper for building the box; `None` before the building begins and after it is complete.
    work: Mutex<Option<Arc<BoxRuns>>>,
    made: OnceLock<BoxContent>,
}

/// Runs of the stepper at the check points of a fit, followed by runs at its design points. The runs for one polynomial degree are the
/// first runs for the next degree.
#[derive(Debug)]
struct BoxRuns {
    /// Index of the next run to be started, for each degree.
    next: Vec<AtomicUsize>,
    runs: Vec<OnceLock<Option<Trained>>>,
}

#[derive(Debug)]
enum BoxContent {
    Smooth(Surface),
    Halves {
        coordinate: usize,
        at: f64,
        halves: Box<[CoordinateBox; 2]>,
    },
    /// No fit is accurate enough, so the stepper computes the trajectories.
    Rough,
}

/// Time modes of the trajectories in a box, and the polynomials of the modes' amplitudes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Surface {
    /// Index of the polynomials' degree in the list of bases.
    level: usize,
    /// Values of each mode (outer) at each row of the record (inner).
    modes: Vec<Vec<f64>>,
    /// Coefficients of each mode (outer) for each polynomial (inner).
    coefficients: Vec<Vec<f64>>,
    /// Largest error at points that were not used for training, relative to the displacement at the point.
    pub certified: f64,
}

impl CoordinateBox {
    pub fn new(lower: Vec<f64>, upper: Vec<f64>) -> Self {
        Self::halved(lower, upper, 0)
    }

    fn halved(lower: Vec<f64>, upper: Vec<f64>, n_halvings: usize) -> Self {
        Self { lower, upper, n_halvings, work: Mutex::new(None), made: OnceLock::new() }
    }

    /// Returns the fitted surface (time modes and polynomials) at coordinates inside the box, and the coordinates scaled to [−1, 1] in the
    /// box or in one of its halves. The box is built on first use. `None` if no surface is accurate enough.
    pub fn surface<'a, N: Scalar>(
        &'a self,
        values: &[f64],
        coordinates: &[N],
        bases: &[Basis],
        tolerance: f64,
        run: &Run<'_>,
    ) -> Option<(&'a Surface, Vec<N>)> {
        match self.made(bases, tolerance, run) {
            BoxContent::Rough => None,
            BoxContent::Halves { coordinate, at, halves } => {
                let half = &halves[usize::from(values[*coordinate] >= *at)];
                half.surface(values, coordinates, bases, tolerance, run)
            }
            BoxContent::Smooth(surface) => {
                let ends = self.lower.iter().zip(&self.upper);
                let scaled = coordinates
                    .iter()
                    .zip(ends)
                    .map(|(x, (lower, upper))| (*x * 2.0 + N::constant(-lower - upper)) * (1.0 / (upper - lower)));
                Some((surface, scaled.collect()))
            }
        }
    }

    /// True if nothing remains to be built for the law at coordinates inside the box.
    pub fn is_made(&self, values: &[f64]) -> bool {
        match self.made.get() {
            None => false,
            Some(BoxContent::Halves { coordinate, at, halves }) => {
                halves[usize::from(values[*coordinate] >= *at)].is_made(values)
            }
            Some(BoxContent::Smooth(_) | BoxContent::Rough) => true,
        }
    }

    /// Returns the content of the box. Every thread that needs the box helps to build it, and all threads get equal results.
    fn made(&self, bases: &[Basis], tolerance: f64, run: &Run<'_>) -> &BoxContent {
        if let Some(made) = self.made.get() {
            return made;
        }
        // All degrees use the same check points, and the design of each degree starts with the points of the lower degrees.
        let Some(Basis { checks, design, .. }) = bases.last() else {
            return self.made.get_or_init(|| BoxContent::Rough);
        };
        let work = {
            let mut work = self.work.lock().unwrap_or_else(PoisonError::into_inner);
            match (&*work, self.made.get()) {
                (_, Some(made)) => return made,
                (Some(work), None) => work.clone(),
                (None, None) => {
                    let ends = bases.iter().map(|basis| checks.len() + basis.design.len());
                    let begins = std::iter::once(0).chain(ends).take(bases.len());
                    let next = begins.map(AtomicUsize::new).collect();
                    let runs = (0..checks.len() + design.len()).map(|_| OnceLock::new()).collect();
                    let begun = Arc::new(BoxRuns { next, runs });
                    *work = Some(begun.clone());
                    begun
                }
            }
        };
        let at = |number: usize| {
            let point = checks.get(number).unwrap_or_else(|| &design[number - checks.len()]);
            run(&self.coordinates_of(point))
        };
        let mut made = None;
        for (level, (basis, next)) in bases.iter().zip(&work.next).enumerate() {
            let places = &work.runs[..checks.len() + basis.design.len()];
            loop {
                let number = next.fetch_add(1, Ordering::Relaxed);
                let Some(place) = places.get(number) else { break };
                place.get_or_init(|| at(number));
            }
            // `get_or_init` waits for runs that other threads have started.
            let runs: Vec<_> =
                places.iter().enumerate().map(|(k, place)| place.get_or_init(|| at(k)).as_ref()).collect();
            made = self.make(bases, level, tolerance, &runs);
            if made.is_some() {
                break;
            }
        }
        let made = self.made.get_or_init(|| made.unwrap_or(BoxContent::Rough));
        *self.work.lock().unwrap_or_else(PoisonError::into_inner) = None;
        made
    }

    fn coordinates_of(&self, point: &[f64]) -> Vec<f64> {
        let ends = self.lower.iter().zip(&self.upper);
        point.iter().zip(ends).map(|(x, (lower, upper))| 0.5 * (lower + upper) + 0.5 * (upper - lower) * x).collect()
    }

    /// Returns the content of the box for polynomials of one degree; `None` if the next degree should be tried.
    fn make(&self, bases: &[Basis], level: usize, tolerance: f64, runs: &[Option<&Trained>]) -> Option<BoxContent> {
        let Some(runs) = runs.iter().copied().collect::<Option<Vec<_>>>() else { return Some(BoxContent::Rough) };
        let surface = Surface::new(bases, level, tolerance, &runs);
        if surface.certified <= tolerance {
            return Some(BoxContent::Smooth(surface));
        }
        if level + 1 < bases.len() {
            return None;
        }
        if self.n_halvings >= MOST_HALVINGS || surface.certified.is_nan() || surface.certified > FARTHEST * tolerance {
            return Some(BoxContent::Rough);
        }
        let squares: Vec<f64> = (0..bases[level].n_polynomials())
            .map(|k| surface.coefficients.iter().map(|of_mode| of_mode[k] * of_mode[k]).sum())
            .collect();
        let tails = bases[level].tails(&squares);
        let coordinate = (0..tails.len()).max_by(|a, b| tails[*a].total_cmp(&tails[*b])).unwrap_or(0);
        let at = 0.5 * (self.lower[coordinate] + self.upper[coordinate]);
        let (mut below, mut above) = (self.upper.clone(), self.lower.clone());
        below[coordinate] = at;
        above[coordinate] = at;
        let half = |lower: Vec<f64>, upper: Vec<f64>| Self::halved(lower, upper, self.n_halvings + 1);
        Some(BoxContent::Halves {
            coordinate,
            at,
            halves: Box::new([half(self.lower.clone(), below), half(above, self.upper.clone())]),
        })
    }
}

impl Surface {
    /// Fits time modes and polynomials of one degree to the runs at the design points, and computes the fit's error at the check points.
    /// `runs` has the check points first. Residuals after the projection on the time modes are at most a tenth of the tolerance.
    pub fn new(bases: &[Basis], level: usize, tolerance: f64, runs: &[&Trained]) -> Self {
        let basis = &bases[level];
        let (checks, design) = runs.split_at(basis.checks.len());
        // Trajectories are divided by their typical displacement, which varies within a box.
        let scaled: Vec<Vec<f64>> =
            design.iter().map(|(excess_m, amplitude_m)| excess_m.iter().map(|x| x / amplitude_m).collect()).collect();
        let modes = modes(scaled, SHARE_OF_MODES * tolerance);
        let coefficients: Vec<Vec<f64>> = modes
            .iter()
            .map(|mode| {
                let amplitudes = design.iter().map(|(excess_m, _)| dot(mode, excess_m));
                let amplitudes = nalgebra::DVector::from_iterator(design.len(), amplitudes);
                (&basis.fit * amplitudes).iter().copied().collect()
            })
            .collect();
        let mut surface = Self { level, modes, coefficients, certified: 0.0 };
        for (point, (excess_m, amplitude_m)) in basis.checks.iter().zip(checks) {
            let found = surface.excess_m(bases, point, 1.0, excess_m.len());
            let error = found.iter().zip(excess_m).fold(0.0_f64, |worst, (a, b)| worst.max((a - b).abs()));
            surface.certified = surface.certified.max(error / amplitude_m);
        }
        surface
    }

    /// Returns the surface (time modes and polynomials) restricted to these rows.
    pub fn at(&self, rows: &[usize]) -> Self {
        let modes = self.modes.iter().map(|mode| rows.iter().map(|row| mode[*row]).collect()).collect();
        Self { modes, ..self.clone() }
    }

    /// Returns the fitted excess (m) over the linear law's position at the first `n_rows` rows, at a place in the box. `factor` multiplies
    /// the result.
    pub fn excess_m<N: Scalar>(&self, bases: &[Basis], place: &[N], factor: N, n_rows: usize) -> Vec<N> {
        let polynomials = bases[self.level].values(place);
        let mut excess_m = vec![N::constant(0.0); n_rows];
        for (mode, coefficients) in self.modes.iter().zip(&self.coefficients) {
            let sum = polynomials.iter().zip(coefficients).fold(N::constant(0.0), |sum, (p, c)| sum + *p * *c);
            let amplitude = sum * factor;
            excess_m.iter_mut().zip(mode).for_each(|(x, value)| *x += amplitude * *value);
        }
        excess_m
    }
}

/// Returns orthonormal modes. Each mode is the normalised trajectory with the largest residual so far. The search ends when no
/// residual exceeds `tolerance` at any row.
fn modes(mut trajectories: Vec<Vec<f64>>, tolerance: f64) -> Vec<Vec<f64>> {
    let mut modes: Vec<Vec<f64>> = Vec::new();
    while modes.len() < MOST_MODES {
        let largest = |trajectory: &Vec<f64>| trajectory.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        let worst =
            (0..trajectories.len()).max_by(|a, b| largest(&trajectories[*a]).total_cmp(&largest(&trajectories[*b])));
        let Some(worst) = worst.filter(|k| largest(&trajectories[*k]) > tolerance) else { break };
        let mut mode = trajectories[worst].clone();
        // A second orthogonalisation removes the rounding errors of the first.
        for other in &modes {
            subtract(&mut mode, other);
        }
        let norm = dot(&mode, &mode).sqrt();
        if norm == 0.0 {
            break;
        }
        mode.iter_mut().for_each(|x| *x /= norm);
        trajectories.iter_mut().for_each(|trajectory| subtract(trajectory, &mode));
        modes.push(mode);
    }
    modes
}

fn subtract(from: &mut [f64], mode: &[f64]) {
    let share = dot(from, mode);
    from.iter_mut().zip(mode).for_each(|(x, m)| *x -= share * m);
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}
