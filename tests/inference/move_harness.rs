//! Every move must leave correlated, bounded and heavy-tailed targets invariant; incorrect moves must be caught.
//!
//! Ensembles begin from exact draws of the target, so any deviation comes from the move. Student's t with 63 degrees of freedom compares the averages of a functional
//! over 64 independent ensembles with its exact expectation. With correct moves all
//! comparisons of this file together fail once in 10⁶.

use statrs::distribution::{ContinuousCDF, StudentsT};
use std::sync::Arc;
use vitreo_uq::sampling::LogDensity;
use vitreo_uq::sampling::ensemble::moves::{
    DifferentialEvolution, HalfStep, Independence, Mixture, Move, Snooker, Stretch, default_move,
};
use vitreo_uq::sampling::ensemble::{Ensemble, Kernel, RandomStream};
use vitreo_uq::sampling::optimum::{Modes, Optimum};

const N_ENSEMBLES: usize = 64;
const N_WALKERS: usize = 16;
const N_STEPS: usize = 400;
/// Moves × targets × functionals, rounded up.
const N_COMPARISONS: f64 = 500.0;
const FALSE_FAILURE_RATE: f64 = 1e-6;

/// A function of a point with its exact expectation.
type Functional = (String, Box<dyn Fn(&[f64]) -> f64>, f64);

trait Target: LogDensity {
    fn draw(&self, stream: &mut RandomStream) -> Vec<f64>;
    fn functionals(&self) -> Vec<Functional>;
}

/// Indicators of a coordinate lying below given points, with their probabilities.
fn indicators(d: usize, at: &[(f64, f64)]) -> Vec<Functional> {
    at.iter()
        .map(|&(limit, probability)| -> Functional {
            (format!("P(x{d} < {limit})"), Box::new(move |x| f64::from(x[d] < limit)), probability)
        })
        .collect()
}

fn each_point(points: &[f64], out: &mut [f64], dimension: usize, f: impl Fn(&[f64]) -> f64) {
    let n = out.len();
    for (i, value) in out.iter_mut().enumerate() {
        let point: Vec<f64> = (0..dimension).map(|d| points[d * n + i]).collect();
        *value = f(&point);
    }
}

/// x₀ = 100 z₀, x₁ = z₀ + 0.1 z₁, x₂ = 0.5 z₀ − z₁ + 0.01 z₂: correlations of 0.995 and scales from 1 to 100.
struct Correlated;

impl LogDensity for Correlated {
    fn dimension(&self) -> usize {
        3
    }
    fn log_density(&self, points: &[f64], log_density: &mut [f64]) {
        each_point(points, log_density, 3, |x| {
            let z0 = x[0] / 100.0;
            let z1 = (x[1] - z0) / 0.1;
            let z2 = (x[2] - 0.5 * z0 + z1) / 0.01;
            -0.5 * (z0 * z0 + z1 * z1 + z2 * z2)
        });
    }
}

impl Target for Correlated {
    fn draw(&self, stream: &mut RandomStream) -> Vec<f64> {
        let z = [stream.normal(), stream.normal(), stream.normal()];
        vec![100.0 * z[0], z[0] + 0.1 * z[1], 0.5 * z[0] - z[1] + 0.01 * z[2]]
    }
    fn functionals(&self) -> Vec<Functional> {
        let q95 = 1.6448536269514722;
        let mut all = Vec::new();
        for (d, sd) in [100.0, 1.01_f64.sqrt(), 1.2501_f64.sqrt()].into_iter().enumerate() {
            all.extend(indicators(d, &[(-q95 * sd, 0.05), (0.0, 0.5), (q95 * sd, 0.95)]));
            all.push((format!("x{d}²"), Box::new(move |x| (x[d] / sd).powi(2)), 1.0));
        }
        all.push(("x0·x2".into(), Box::new(|x| x[0] * x[2]), 50.0));
        all
    }
}

/// x₀ uniform on (0, 1), x₁ exponential, x₂ of density 2x on (0, 1): hard edges, with the highest density on one of them.
struct Bounded;

impl LogDensity for Bounded {
    fn dimension(&self) -> usize {
        3
    }
    fn log_density(&self, points: &[f64], log_density: &mut [f64]) {
        each_point(points, log_density, 3, |x| {
            let inside = (0.0..1.0).contains(&x[0]) && x[1] > 0.0 && x[2] > 0.0 && x[2] < 1.0;
            if inside { x[2].ln() - x[1] } else { f64::NEG_INFINITY }
        });
    }
}

impl Target for Bounded {
    fn draw(&self, stream: &mut RandomStream) -> Vec<f64> {
        vec![stream.unit(), -stream.unit().ln(), stream.unit().sqrt()]
    }
    fn functionals(&self) -> Vec<Functional> {
        let mut all = indicators(0, &[(0.05, 0.05), (0.5, 0.5), (0.95, 0.95)]);
        all.extend(indicators(1, &[(-(0.95_f64.ln()), 0.05), (2.0_f64.ln(), 0.5), (20.0_f64.ln(), 0.95)]));
        all.extend(indicators(2, &[(0.05_f64.sqrt(), 0.05), (0.5_f64.sqrt(), 0.5), (0.95_f64.sqrt(), 0.95)]));
        all.push(("x1".into(), Box::new(|x| x[1]), 1.0));
        all.push(("x1²".into(), Box::new(|x| x[1] * x[1]), 2.0));
        all
    }
}

/// Multivariate t with four degrees of freedom in three dimensions.
struct HeavyTailed;

impl LogDensity for HeavyTailed {
    fn dimension(&self) -> usize {
        3
    }
    fn log_density(&self, points: &[f64], log_density: &mut [f64]) {
        each_point(points, log_density, 3, |x| -3.5 * (1.0 + x.iter().map(|v| v * v).sum::<f64>() / 4.0).ln());
    }
}

impl Target for HeavyTailed {
    fn draw(&self, stream: &mut RandomStream) -> Vec<f64> {
        let chi2 = -2.0 * (stream.unit() * stream.unit()).ln();
        (0..3).map(|_| stream.normal() * (4.0 / chi2).sqrt()).collect()
    }
    fn functionals(&self) -> Vec<Functional> {
        let marginal = StudentsT::new(0.0, 1.0, 4.0).unwrap();
        let (q95, q99) = (marginal.inverse_cdf(0.95), marginal.inverse_cdf(0.99));
        (0..3)
            .flat_map(|d| indicators(d, &[(-q99, 0.01), (-q95, 0.05), (0.0, 0.5), (q95, 0.95), (q99, 0.99)]))
            .collect()
    }
}

/// A move without its correction.
struct WithoutFactor(Arc<dyn Move>);

impl Move for WithoutFactor {
    fn name(&self) -> String {
        format!("{} without its factor", self.0.name())
    }
    fn propose(&self, step: HalfStep) {
        let HalfStep { moving, complement, shared, random_streams, proposals, log_factors } = step;
        let inner = HalfStep { moving, complement, shared, random_streams, proposals, log_factors: &mut *log_factors };
        self.0.propose(inner);
        log_factors.fill(0.0);
    }
}

/// Largest |t| over functionals, with the functional's name.
fn largest_t(target: &dyn Target, kernel: &dyn Move, seed: u64) -> (f64, String) {
    let functionals = target.functionals();
    let averages: Vec<Vec<f64>> = (0..N_ENSEMBLES).map(|k| ensemble_averages(target, kernel, seed, k)).collect();
    let t_of = |f: usize| {
        let values: Vec<f64> = averages.iter().map(|row| row[f]).collect();
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
        (mean - functionals[f].2).abs() / (variance / n).sqrt()
    };
    let values = (0..functionals.len()).map(|f| (t_of(f), functionals[f].0.clone()));
    values.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap()
}

fn ensemble_averages(target: &dyn Target, kernel: &dyn Move, seed: u64, number: usize) -> Vec<f64> {
    let dimension = target.dimension();
    let mut stream = RandomStream::new(seed, (1 << 62) + number as u64);
    let starts: Vec<Vec<f64>> = (0..N_WALKERS).map(|_| target.draw(&mut stream)).collect();
    let positions: Vec<f64> = (0..dimension).flat_map(|d| starts.iter().map(move |start| start[d])).collect();
    let mut log_density = vec![0.0; N_WALKERS];
    target.log_density(&positions, &mut log_density);
    let mut ensemble = Ensemble::new(seed, number, dimension, &positions, &log_density);
    let functionals = target.functionals();
    let mut sums = vec![0.0; functionals.len()];
    for _ in 0..N_STEPS {
        ensemble.step(target, &Kernel { local: kernel, jumps: None }).unwrap();
        for walker in 0..N_WALKERS {
            let point = ensemble.position(walker);
            sums.iter_mut().zip(&functionals).for_each(|(sum, (_, f, _))| *sum += f(&point));
        }
    }
    sums.into_iter().map(|sum| sum / (N_STEPS * N_WALKERS) as f64).collect()
}

fn threshold() -> f64 {
    let dof = N_ENSEMBLES as f64 - 1.0;
    StudentsT::new(0.0, 1.0, dof).unwrap().inverse_cdf(1.0 - 0.5 * FALSE_FAILURE_RATE / N_COMPARISONS)
}

/// Two modes at wrong places with wrong widths. A correct independence move tolerates them.
fn misplaced_jumps() -> Independence {
    let mut modes = Modes::default();
    for (location, precision) in [(0.3, 4.0), (2.0, 1.0)] {
        let mut matrix = vec![0.0; 9];
        (0..3).for_each(|d| matrix[4 * d] = precision);
        let optimum = Optimum { location: vec![location; 3], log_density: 0.0, precision: matrix, converged: true };
        modes.add(&optimum);
    }
    Independence::from_modes(&modes, 3).unwrap()
}

fn assert_invariant(kernel: &dyn Move, targets: &[&dyn Target]) {
    for (seed, target) in (31..).zip(targets) {
        let (t, worst) = largest_t(*target, kernel, seed);
        assert!(t < threshold(), "{}: t = {t:.1} for {worst}, target {seed}", kernel.name());
    }
}

#[test]
fn stretch_is_invariant() {
    assert_invariant(&Stretch::default(), &[&Correlated, &Bounded, &HeavyTailed]);
}

#[test]
fn differential_evolution_is_invariant() {
    assert_invariant(&DifferentialEvolution::default(), &[&Correlated, &Bounded, &HeavyTailed]);
}

#[test]
fn snooker_is_invariant() {
    assert_invariant(&Snooker::default(), &[&Correlated, &Bounded, &HeavyTailed]);
}

#[test]
fn the_default_mixture_is_invariant() {
    assert_invariant(&default_move(), &[&Correlated, &Bounded, &HeavyTailed]);
}

#[test]
fn misplaced_jumps_are_invariant() {
    assert_invariant(&misplaced_jumps(), &[&Bounded, &HeavyTailed]);
    let mixed = Mixture::new(vec![
        (0.5, Box::new(misplaced_jumps()) as Box<dyn Move>),
        (0.5, Box::new(Stretch::default()) as Box<dyn Move>),
    ]);
    assert_invariant(&mixed, &[&Bounded, &HeavyTailed]);
}

/// The harness can fail: each missing correction is found on at least one target.
#[test]
fn wrong_moves_are_caught() {
    let moves: [Arc<dyn Move>; 3] =
        [Arc::new(Stretch::default()), Arc::new(Snooker::default()), Arc::new(misplaced_jumps())];
    for kernel in moves {
        let wrong = WithoutFactor(kernel);
        let targets: [&dyn Target; 2] = [&Bounded, &HeavyTailed];
        let worst = targets.iter().map(|target| largest_t(*target, &wrong, 31).0).fold(0.0, f64::max);
        println!("{}: t = {worst:.1}", wrong.name());
        assert!(worst > threshold(), "{} passed with t = {worst:.1}", wrong.name());
    }
}
