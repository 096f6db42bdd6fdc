//! Posterior on which the benchmarks compare samplers. The record has one cycle (+4.6 µN and −4.6 µN, 5 s each) with 200 rows at 20 Hz and a noise standard
//! deviation of 5 µm. The model is the base law with the program's log-normal priors of the law's parameters and of the noise.
#![allow(dead_code, reason = "each benchmark uses a part")]

use std::collections::BTreeMap;

use vitreo_uq::laws::rheology::CreepCompliance;
use vitreo_uq::models::model::{Compliance, Model, TrainedRange, convolve_m};
use vitreo_uq::posterior::likelihood::{FittedRecord, PosteriorParts, ReducedPosterior};
use vitreo_uq::posterior::noise::NoiseModel;
use vitreo_uq::posterior::prior::PriorSet;
use vitreo_uq::sampling::ensemble::RandomStream;

/// Displacement per force at unit creep compliance, in 1/m: the reciprocal of the stiffness in physics §4.10.
pub const COMPLIANCE_PER_M: f64 = 1.0 / 1.820902396e-3;
/// True parameters: Young's modulus E (Pa), viscosities c₁ and c₂ (Pa s), noise standard deviation σ (µm).
pub const REFERENCE: [f64; 4] = [3.527, 1.402, 47.370, 5.0];

/// A simulated record with its priors.
pub struct Creep {
    pub time_s: Vec<f64>,
    pub force_n: Vec<f64>,
    pub position_m: Vec<f64>,
    pub priors: PriorSet,
    pub trained: Vec<TrainedRange>,
    pub model: Model,
    pub fixed: BTreeMap<String, f64>,
}

impl Creep {
    pub fn new(seed: u64) -> Self {
        let time_s: Vec<f64> = (0..200).map(|row| 0.05 * f64::from(row)).collect();
        let force_n: Vec<f64> = (0..200).map(|row| if row < 100 { 4.6e-6 } else { -4.6e-6 }).collect();
        let law = CreepCompliance::lethersich(&REFERENCE[..3]);
        let mut position_m = convolve_m(COMPLIANCE_PER_M, &law, &time_s, &force_n);
        let mut noise = RandomStream::new(seed, 0);
        position_m.iter_mut().for_each(|x| *x += 1e-6 * REFERENCE[3] * noise.normal());
        let priors = PriorSet::named("porcine").expect("an embedded prior");
        let ranges = priors.names().map(str::to_string).zip(priors.box_quantiles(1e-9)).take(3);
        let trained = ranges.map(|(name, (lower, upper))| TrainedRange { name, lower, upper }).collect();
        let (model, fixed) = (Model::lethersich(), BTreeMap::new());
        Self { time_s, force_n, position_m, priors, trained, model, fixed }
    }

    pub fn posterior(&self) -> ReducedPosterior<'_> {
        let observed: Vec<Option<f64>> = self.position_m.iter().copied().map(Some).collect();
        let parts = PosteriorParts {
            model: &self.model,
            noise: NoiseModel::default(),
            compliance: Compliance::fixed(COMPLIANCE_PER_M),
            trained: &self.trained,
            priors: &self.priors,
            fixed: &self.fixed,
        };
        let cycle = vec![1; observed.len()];
        let Self { time_s, force_n, .. } = self;
        ReducedPosterior::new(
            parts,
            FittedRecord { time_s, force: force_n.into(), recording: &cycle, observed_m: &observed },
        )
    }

    /// Returns `n` points around [`REFERENCE`]. Coordinate d of point i is at index `d * n + i`.
    pub fn batch(&self, n: usize) -> Vec<f64> {
        let mut stream = RandomStream::new(7, 0);
        let centre = self.priors.to_unconstrained(&REFERENCE);
        centre.iter().flat_map(|z| (0..n).map(|_| z + 0.01 * stream.normal()).collect::<Vec<_>>()).collect()
    }

    /// Returns `n` start points drawn from the prior, in the sampler's coordinates.
    pub fn starts(&self, n: usize) -> Vec<Vec<f64>> {
        let mut stream = RandomStream::new(8, 0);
        let start =
            |_| self.priors.priors().iter().map(|p| p.distribution.quantile(stream.unit())).collect::<Vec<f64>>();
        (0..n).map(start).map(|natural| self.priors.to_unconstrained(&natural)).collect()
    }
}
