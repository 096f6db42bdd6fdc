//! Tests of the likelihood kernel for models with stages (load, mechanics, observation). The test model has a force gradient, a second retardation and correlated
//! noise. It cannot be evaluated at some parameter points.

use super::*;
use crate::prior::Prior;
use base::distribution::Distribution;
use base::error::InputPlace;
use models::effects::Library;
use models::model::SurrogateForward;
use record::CharacteristicSizes;

const COMPLIANCE_PER_M: f64 = 549.0;
const INTERVAL_S: f64 = 0.05;
const N_ROWS: usize = 90;
/// Parameter values in their units: three parameters of the Lethersich law, force gradient, compliance ratio and time of the second retardation, white noise, slow
/// noise and its correlation time.
const POINT: [f64; 9] = [3.5, 1.4, 47.0, 40.0, 0.3, 1.1, 4.0, 2.5, 0.4];
const GRADIENT: usize = 3;
const TIME: usize = 5;

struct Case {
    model: Model,
    noise: NoiseModel,
    priors: PriorSet,
    fixed: BTreeMap<String, f64>,
    time_s: Vec<f64>,
    force_n: Vec<f64>,
    cycle: Vec<u32>,
    observed_m: Vec<Option<f64>>,
}

impl Case {
    /// Creates the test problem. The priors of its effects include points at which the model cannot be evaluated.
    fn new() -> Self {
        let scales =
            CharacteristicSizes { sample_interval_s: INTERVAL_S, duration_s: 4.5, ..CharacteristicSizes::default() };
        let library = Library::default();
        let effects = ["force-gradient", "second-retardation"].map(|slug| library.get(slug).unwrap());
        let model = Model::new(BaseLaw::Lethersich, effects.to_vec(), scales, &InputPlace::default()).unwrap();
        let noise = NoiseModel::named(&["white".into(), "ou".into()], &InputPlace::default()).unwrap();
        let wanted: Vec<_> = model.parameters().iter().copied().chain(noise.parameters()).collect();
        let distribution = |name: &str| match name {
            "force-gradient.gradient_per_m" => Distribution::Normal { mean: 0.0, sd: 1e3 },
            "second-retardation.compliance_ratio" => Distribution::HalfNormal { sd: 0.5 },
            "second-retardation.time_s" => Distribution::LogUniform { lower: 0.01, upper: 10.0 },
            _ => Distribution::LogNormal { median: 2.0, log_sd: 1.0 },
        };
        let default = |spec: &base::parameter::ParameterSpec, _: &[Prior]| {
            let (name, unit) = (spec.name.into(), spec.unit.into());
            Some(Prior { distribution: distribution(spec.name), name, unit, source: String::new() })
        };
        let priors = PriorSet::read_for("porcine", &wanted, &[], &default).unwrap();
        let time_s: Vec<f64> = (0..N_ROWS).map(|i| INTERVAL_S * i as f64).collect();
        let force_n: Vec<f64> = (0..N_ROWS).map(|i| if i < 45 { 4.6e-6 } else { -4.6e-6 }).collect();
        let exact_m = stepped_m(&POINT, &force_n);
        let wiggle_m = |i: usize| 5e-6 * (12.9 * i as f64).sin();
        let observed_m = (0..N_ROWS).map(|i| (i % 6 != 4).then(|| exact_m[i] + wiggle_m(i))).collect();
        Self { model, noise, priors, fixed: BTreeMap::new(), time_s, force_n, cycle: vec![1; N_ROWS], observed_m }
    }

    fn parts(&self) -> PosteriorParts<'_> {
        PosteriorParts {
            model: &self.model,
            noise: self.noise,
            compliance: Compliance::fixed(COMPLIANCE_PER_M),
            trained: &[],
            priors: &self.priors,
            fixed: &self.fixed,
        }
    }

    fn record(&self) -> FittedRecord<'_> {
        let Self { time_s, force_n, cycle, observed_m, .. } = self;
        FittedRecord { time_s, force: force_n.into(), recording: cycle, observed_m }
    }

    /// Log densities of a batch of points in natural units.
    fn log_density(&self, naturals: &[Vec<f64>]) -> Vec<f64> {
        let points: Vec<Vec<f64>> = naturals.iter().map(|natural| self.priors.to_unconstrained(natural)).collect();
        let dimension = self.priors.priors().len();
        let batch: Vec<f64> = (0..dimension).flat_map(|d| points.iter().map(move |point| point[d])).collect();
        let mut values = vec![0.0; points.len()];
        ReducedPosterior::new(self.parts(), self.record()).log_density(&batch, &mut values);
        values
    }

    /// Log prior plus scalar log likelihood of one point; `None` if the forward model cannot be evaluated there.
    fn scalar(&self, natural: &[f64]) -> Option<f64> {
        let response = Response::new(&self.time_s, &self.force_n, N_ROWS);
        let compliance = Compliance::fixed(COMPLIANCE_PER_M);
        let forward = SurrogateForward { model: &self.model, compliance, response, trained: &[] };
        let noise = NoiseLikelihood::new(self.noise, &self.time_s, &self.cycle, &self.observed_m);
        let (of_model, of_noise) = natural.split_at(self.model.parameters().len());
        let likelihood = ln_likelihood(&forward, &noise, of_model, of_noise).ok()?;
        let z = self.priors.to_unconstrained(natural);
        let pairs = self.priors.priors().iter().zip(&z);
        Some(likelihood + pairs.map(|(prior, z)| prior.distribution.ln_pdf_unconstrained(*z)).sum::<f64>())
    }
}

/// Positions (m) at every row by 20 fourth-order Runge–Kutta steps per row. Two Kelvin–Voigt bodies and a dashpot in series move under the force F e^{gx}, where F is
/// the command, x the position and g the force gradient.
fn stepped_m(point: &[f64], force_n: &[f64]) -> Vec<f64> {
    let [young, c1, c2, gradient, ratio, time_2] = std::array::from_fn(|i| point[i]);
    let slope = |y: [f64; 3], command_n: f64| {
        let force = COMPLIANCE_PER_M * command_n * (gradient * y.iter().sum::<f64>()).exp();
        [(force - young * y[0]) / c1, (ratio / young * force - y[1]) / time_2, force / c2]
    };
    let step = INTERVAL_S / 20.0;
    let along = |y: [f64; 3], k: [f64; 3], h: f64| std::array::from_fn(|i| y[i] + h * k[i]);
    let mut y = [0.0; 3];
    let mut position_m = Vec::new();
    for command_n in force_n {
        position_m.push(y.iter().sum());
        for _ in 0..20 {
            let k1 = slope(y, *command_n);
            let k2 = slope(along(y, k1, 0.5 * step), *command_n);
            let k3 = slope(along(y, k2, 0.5 * step), *command_n);
            let k4 = slope(along(y, k3, step), *command_n);
            y = std::array::from_fn(|i| y[i] + step / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
        }
    }
    position_m
}

/// Values of [`POINT`] with one parameter replaced.
fn with(index: usize, value: f64) -> Vec<f64> {
    let mut natural = POINT.to_vec();
    natural[index] = value;
    natural
}

/// Finds the force gradient g at which the largest |g x| up to the last observed row is `size`, by bisection. The positions x come from `stepped_m`.
fn gradient_of_size(case: &Case, size: f64) -> f64 {
    let last = case.observed_m.iter().rposition(Option::is_some).unwrap();
    let largest = |gradient: f64| {
        let position_m = stepped_m(&with(GRADIENT, gradient), &case.force_n);
        // NaN means that the position has grown without bound.
        let size = |x: &f64| if x.is_nan() { f64::INFINITY } else { (gradient * x).abs() };
        position_m[..=last].iter().map(size).fold(0.0, f64::max)
    };
    let (mut lower, mut upper) = (0.0, 2e3);
    for _ in 0..60 {
        let middle = 0.5 * (lower + upper);
        if largest(middle) < size { lower = middle } else { upper = middle }
    }
    lower
}

/// Smallest force gradient at which force and position grow without bound before the last observed row.
fn runaway_gradient(case: &Case) -> f64 {
    gradient_of_size(case, 100.0)
}

/// Returns 17 parameter points, which take three passes: points with different model parameters, points at which the model cannot be evaluated, and points with
/// unbounded growth.
fn mixed(case: &Case) -> Vec<Vec<f64>> {
    let strong = 1.5 * runaway_gradient(case);
    (0..17)
        .map(|i| {
            let mut natural: Vec<f64> = POINT
                .iter()
                .enumerate()
                .map(|(d, x)| x * (0.2 * (1.0 + d as f64 + 2.7 * i as f64).sin()).exp())
                .collect();
            match i {
                2 | 9 | 16 => natural[TIME] = 0.099,
                4 | 8 => natural[GRADIENT] = strong,
                5 | 12 => natural[GRADIENT] = 0.0,
                7 => natural[GRADIENT] *= -1.0,
                _ => {}
            }
            natural
        })
        .collect()
}

/// Indices of the points of [`mixed`] at which the model cannot be evaluated.
const WITHOUT_MODEL: [usize; 5] = [2, 4, 8, 9, 16];

#[test]
fn the_kernel_of_stages_equals_prior_plus_scalar_likelihood() {
    let case = Case::new();
    let points = mixed(&case);
    let found = case.log_density(&points);
    for (i, (natural, found)) in points.iter().zip(found).enumerate() {
        let expected = case.scalar(natural);
        assert_eq!(expected.is_none(), WITHOUT_MODEL.contains(&i), "{i}: {expected:?}");
        match expected {
            Some(expected) => assert!((found / expected - 1.0).abs() < 1e-10, "{i}: {found} against {expected}"),
            None => assert_eq!(found, f64::NEG_INFINITY, "{i}"),
        }
    }
}

/// Neighbouring points that differ only in their noise share a trajectory. Points that differ in a model parameter have separate trajectories, even next to points
/// without a trajectory. The value of each point is bitwise the same as if it were computed alone.
#[test]
fn points_that_differ_in_their_noise_alone_share_a_trajectory() {
    let case = Case::new();
    let moved = |natural: &[f64], which: std::ops::Range<usize>, factor: f64| {
        let mut moved = natural.to_vec();
        moved[which].iter_mut().for_each(|value| *value *= factor);
        moved
    };
    let neighbours = |point: Vec<f64>| {
        let of_noise = [1.0, 1.3, 0.8].map(|factor| moved(&point, 6..point.len(), factor));
        let of_model: Vec<Vec<f64>> = (0..6).map(|d| moved(&point, d..d + 1, 1.01)).collect();
        of_model.into_iter().flat_map(move |other| [other, point.clone()]).chain(of_noise)
    };
    let points: Vec<Vec<f64>> = mixed(&case).into_iter().flat_map(neighbours).collect();
    let together: Vec<u64> = case.log_density(&points).into_iter().map(f64::to_bits).collect();
    let alone: Vec<u64> =
        points.iter().map(|point| case.log_density(std::slice::from_ref(point))[0].to_bits()).collect();
    assert_eq!(together, alone);
}

/// Compares the kernel's log density with the likelihood of the trajectory from `stepped_m`, whose relative error is below 10⁻⁸.
#[test]
fn the_kernel_of_stages_is_that_of_the_equations() {
    let case = Case::new();
    let noise = NoiseLikelihood::new(case.noise, &case.time_s, &case.cycle, &case.observed_m);
    let reference = |natural: &[f64]| {
        let z = case.priors.to_unconstrained(natural);
        let mut prior = [0.0];
        case.priors.add_ln_pdf_unconstrained(&z, &mut prior);
        prior[0] + noise.ln_likelihood(&stepped_m(natural, &case.force_n), &natural[6..])
    };
    let points = [POINT.to_vec(), with(GRADIENT, -150.0), with(TIME, 5.0)];
    for (natural, found) in points.iter().zip(case.log_density(&points)) {
        let expected = reference(natural);
        assert!((found / expected - 1.0).abs() < 1e-6, "{natural:?}: {found} against {expected}");
    }
}

#[test]
fn points_without_a_model_are_impossible_and_their_neighbours_are_not() {
    let case = Case::new();
    let runaway = runaway_gradient(&case);
    let gradients = [gradient_of_size(&case, 0.5), 0.98 * runaway, 1.02 * runaway].map(|g| with(GRADIENT, g));
    let points = [&gradients[..], &[with(TIME, 0.0999), with(TIME, 0.1001)]].concat();
    let is_possible: Vec<bool> = case.log_density(&points).iter().map(|value| value.is_finite()).collect();
    assert_eq!(is_possible, [true, true, false, false, true]);
    assert!(case.log_density(&points)[2..4].iter().all(|value| *value == f64::NEG_INFINITY));
}

/// The model cannot be evaluated at any point of the batch, because the effect, the feedback of the position on the force, or the law fails.
#[test]
fn batches_of_points_without_a_model_are_impossible() {
    let mut case = Case::new();
    let strong = with(GRADIENT, 1.2 * runaway_gradient(&case));
    for natural in [with(TIME, 0.05), strong] {
        for n in [1, 3, 8, 11] {
            assert_eq!(case.log_density(&vec![natural.clone(); n]), vec![f64::NEG_INFINITY; n]);
        }
    }
    // This viscosity is so small that its inverse is infinite.
    let name = "viscosity_2_pa_s";
    case.fixed.insert(name.into(), 1e-320);
    case.priors = case.priors.without(&[name]);
    let mut natural = POINT.to_vec();
    natural.remove(2);
    for n in [1, 8, 11] {
        assert_eq!(case.log_density(&vec![natural.clone(); n]), vec![f64::NEG_INFINITY; n]);
    }
}

#[test]
fn points_without_a_model_leave_the_bits_of_the_others() {
    let case = Case::new();
    let points = mixed(&case);
    let bits = |batch: &[Vec<f64>]| case.log_density(batch).into_iter().map(f64::to_bits).collect::<Vec<u64>>();
    let alone: Vec<u64> = points.iter().flat_map(|point| bits(std::slice::from_ref(point))).collect();
    for size in [3, 8, 9, 17] {
        let found: Vec<u64> = points.chunks(size).flat_map(bits).collect();
        assert_eq!(found, alone, "batches of {size}");
    }
}
