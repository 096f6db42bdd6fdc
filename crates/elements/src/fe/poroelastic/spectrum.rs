//! The pore spectrum: the robot's compliance Φ(τ) = Φ(0) (1 + Σ wₖ τ/(τ + τₖ)) with a few terms,
//! for every drained Poisson ratio ν_d of a range. The drainage area τ (m²) is mobility × modulus /
//! Laplace variable.
//!
//! At a few ratios (Chebyshev points) a Galerkin projection on pressures at fixed τ/S computes the
//! terms. S is the storage of irrotational fields. These τ are chosen greedily at the middle ratio.
//! Ritz values of such a space never cross. Therefore ln(wₖ/(ν − ν_d)) and ln(τₖ/S) are smooth in
//! ν_d, with the undrained ratio ν. Polynomials through the Chebyshev points interpolate them and
//! have exact derivatives.
//!
//! Errors stated here are those of Φ at real τ. After a change of the force the error in time may
//! be twenty times as large, up to 3e-6 of the position with the default settings.
//!
//! Let G be the law's modulus at the Laplace variable s, and k the mobility. A term then adds
//! wₖ/(G + (τₖ/k) s) to the response. This is the law in parallel with a dashpot of viscosity
//! τₖ/k, both divided by wₖ.

use std::f64::consts::PI;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::PoreModel;
use super::drained::{DrainedModel, Moduli, dot};
use super::terms::{Direction, Terms};
use base::error::{Error, Result};
use base::number::{Dual, Scalar};

/// Shortest length for the choice of terms, divided by the robot's smallest radius. Drainage areas,
/// divided by the storage, range from the square of this length to the square of the mesh's largest
/// radius.
const NEAREST: f64 = 0.01;
/// Number of drainage areas per decade whose pressures represent all pressures while the terms are
/// chosen.
const PER_DECADE: f64 = 4.0;
/// Number of drainage areas per decade at which the error is evaluated.
const CANDIDATES_PER_DECADE: f64 = 20.0;

/// Accuracy and range of a pore spectrum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpectrumSettings {
    /// Lowest and highest drained Poisson ratio. The highest must lie below the undrained one.
    pub drained_poisson_ratio: [f64; 2],
    /// Error of the compliance, relative to the undrained compliance, below which no further terms
    /// are added.
    pub tolerance: f64,
    /// Largest permitted number of terms, at least 2.
    pub most_terms: usize,
    /// Number of drained Poisson ratios at which the terms are computed, at least 2.
    pub n_ratios: usize,
}

impl Default for SpectrumSettings {
    /// Settings that give at most ten terms for an error of 1e-6, with drained Poisson ratios from
    /// 0 to 0.45.
    fn default() -> Self {
        Self { drained_poisson_ratio: [0.0, 0.45], tolerance: 1e-6, most_terms: 10, n_ratios: 10 }
    }
}

/// One term of a pore spectrum. It adds w τ/(τ + τₖ) to the relative compliance at the drainage
/// area τ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoreTerm {
    /// Weight w > 0: the term's contribution to the drained compliance, relative to the undrained
    /// compliance.
    pub weight: Dual,
    /// Area τₖ > 0 of the term, in m².
    pub area_m2: Dual,
}

/// The pore spectrum of a mesh, for any drained Poisson ratio of a range.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PoreSpectrum {
    /// Undrained Poisson ratio.
    pub poisson_ratio: f64,
    /// Lowest and highest drained Poisson ratio at which the terms are valid.
    pub drained_poisson_ratio: [f64; 2],
    /// Undrained compliance at unit Young's modulus in 1/m, at the middle drained ratio, from the
    /// porous elements. The base model's compliance comes from another discretisation.
    pub undrained_compliance_per_m: f64,
    /// Largest error indicator of the terms, relative to the undrained compliance, over all
    /// drainage areas and the computed ratios. The indicator is the squared norm of the residual.
    /// It is at least half of the error and at most the error.
    pub error_indicator: f64,
    /// Error due to the interpolation in the drained Poisson ratio, relative to the undrained
    /// compliance. It is the largest over all drainage areas, at a ratio between the computed ones.
    pub interpolation_error: f64,
    /// Chebyshev coefficients of ln(w/(ν − ν_d)), one list per term, with the weight w and the
    /// undrained and drained Poisson ratios ν and ν_d.
    log_weights: Vec<Vec<f64>>,
    /// Chebyshev coefficients of ln(τ/S), one list per term, with the area τ (m²) of the term and
    /// the storage S of irrotational fields.
    log_areas: Vec<Vec<f64>>,
}

/// Terms at one drained Poisson ratio.
struct Computed {
    weights: Vec<f64>,
    areas_m2: Vec<f64>,
    undrained: f64,
    indicator: f64,
}

impl Computed {
    fn relative_compliance(&self, area_m2: f64) -> f64 {
        let terms = self.weights.iter().zip(&self.areas_m2);
        1.0 + terms.map(|(weight, area)| weight / (1.0 + area / area_m2)).sum::<f64>()
    }
}

impl PoreSpectrum {
    /// Computes the pore spectrum of a mesh.
    ///
    /// # Errors
    /// [`Error::Numerical`] for invalid settings, or if the iteration for the pressures does not
    /// converge.
    pub fn build(model: &PoreModel, settings: &SpectrumSettings) -> Result<Self> {
        let [lowest, highest] = settings.drained_poisson_ratio;
        let [smallest_m, largest_m] = model.lengths_m;
        let is_sound = lowest < highest
            && highest < model.poisson_ratio
            && settings.n_ratios >= 2
            && settings.most_terms >= 2
            && smallest_m > 0.0
            && largest_m > smallest_m;
        if !is_sound {
            return Err(Error::numerical(
                format!(
                    "a pore spectrum cannot be built with {settings:?} around a robot of radius {smallest_m} m in a mesh of radius {largest_m} m, at the undrained Poisson ratio {}",
                    model.poisson_ratio
                ),
                "give a rising range of drained Poisson ratios below the undrained one, at least two ratios and two terms, and a robot at the mesh's centre",
            ));
        }
        let (scaled_areas_m2, undrained_compliance_per_m) = chosen_areas_m2(model, settings)?;
        let ratio = |x: f64| 0.5 * (lowest + highest) + 0.5 * (highest - lowest) * x;
        let mut ratios: Vec<f64> = chebyshev_points(settings.n_ratios).map(ratio).collect();
        // The interpolation error is evaluated where the first omitted Chebyshev polynomial is
        // largest, at a quarter of the range.
        let n_quarter = (settings.n_ratios / 4).max(1) as f64;
        ratios.push(ratio((PI * n_quarter / settings.n_ratios as f64).cos()));
        let compute = |&ratio: &f64| computed(&model.drained(ratio)?, &scaled_areas_m2);
        let mut computed: Vec<Computed> = ratios.par_iter().map(compute).collect::<Result<_>>()?;
        let n_terms = computed[0].weights.len();
        if computed.iter().any(|at| at.weights.len() != n_terms) {
            return Err(Error::numerical(
                "the number of terms of the pore spectrum differs between drained Poisson ratios",
                "request fewer terms",
            ));
        }
        let (Some(checked), Some(checked_ratio)) = (computed.pop(), ratios.pop()) else {
            return Err(Error::numerical("no drained Poisson ratio was computed", "request at least two ratios"));
        };
        let fitted = |value: &dyn Fn(usize, usize) -> f64| -> Vec<Vec<f64>> {
            (0..n_terms)
                .map(|k| chebyshev_coefficients(&(0..ratios.len()).map(|i| value(i, k)).collect::<Vec<_>>()))
                .collect()
        };
        let storage = |i: usize| Moduli::new(model.poisson_ratio, ratios[i]).storage;
        let mut spectrum = Self {
            poisson_ratio: model.poisson_ratio,
            drained_poisson_ratio: settings.drained_poisson_ratio,
            undrained_compliance_per_m,
            error_indicator: computed.iter().map(|at| at.indicator / at.undrained).fold(0.0, f64::max),
            interpolation_error: 0.0,
            log_weights: fitted(&|i, k| (computed[i].weights[k] / (model.poisson_ratio - ratios[i])).ln()),
            log_areas: fitted(&|i, k| (computed[i].areas_m2[k] / storage(i)).ln()),
        };
        let scale = Moduli::new(model.poisson_ratio, checked_ratio).storage;
        for area_m2 in areas_m2(model, CANDIDATES_PER_DECADE).into_iter().map(|t| t * scale).chain([f64::INFINITY]) {
            let error = spectrum.relative_compliance(checked_ratio, area_m2)? - checked.relative_compliance(area_m2);
            spectrum.interpolation_error = spectrum.interpolation_error.max(error.abs());
        }
        Ok(spectrum)
    }

    /// Number of terms. It is equal for every drained Poisson ratio.
    pub fn n_terms(&self) -> usize {
        self.log_weights.len()
    }

    /// Terms at a drained Poisson ratio, slowest first. Their derivatives follow from the
    /// derivative that the ratio carries.
    ///
    /// # Errors
    /// [`Error::OutsideTrainedRange`] for a ratio outside the range.
    pub fn terms(&self, drained_poisson_ratio: Dual) -> Result<Vec<PoreTerm>> {
        let [lower, upper] = self.drained_poisson_ratio;
        if !(lower..=upper).contains(&drained_poisson_ratio.value) {
            return Err(Error::OutsideTrainedRange {
                parameter: "drained_poisson_ratio".into(),
                value: drained_poisson_ratio.value,
                lower,
                upper,
            });
        }
        let x = (drained_poisson_ratio - 0.5 * (lower + upper)) * (2.0 / (upper - lower));
        let below = Dual::constant(self.poisson_ratio) - drained_poisson_ratio;
        let storage = storage(self.poisson_ratio, drained_poisson_ratio);
        let term = |(weight, area): (&Vec<f64>, &Vec<f64>)| PoreTerm {
            weight: below * clenshaw(weight, x).exp(),
            area_m2: storage * clenshaw(area, x).exp(),
        };
        Ok(self.log_weights.iter().zip(&self.log_areas).map(term).collect())
    }

    /// Compliance relative to the undrained compliance, at a drained Poisson ratio and a drainage
    /// area τ ≥ 0 (m²). An infinite area is the drained body.
    ///
    /// # Errors
    /// [`Error::OutsideTrainedRange`] for a ratio outside the range.
    pub fn relative_compliance(&self, drained_poisson_ratio: f64, area_m2: f64) -> Result<f64> {
        let terms = self.terms(Dual::constant(drained_poisson_ratio))?;
        Ok(1.0 + terms.iter().map(|term| term.weight.value / (1.0 + term.area_m2.value / area_m2)).sum::<f64>())
    }

    /// Largest error of [`Self::relative_compliance`] over all drainage areas at one drained
    /// Poisson ratio. The reference values are exactly solved pressures.
    ///
    /// # Errors
    /// Those of [`Self::relative_compliance`], and [`Error::Numerical`] if the iteration for the
    /// pressures does not converge.
    pub fn largest_error(&self, model: &PoreModel, drained_poisson_ratio: f64) -> Result<f64> {
        let body = model.drained(drained_poisson_ratio)?;
        let areas_m2: Vec<f64> = areas_m2(model, PER_DECADE).iter().map(|t| t * body.moduli.storage).collect();
        let exact = body.compliances_per_m(&areas_m2)?;
        let mut largest = 0.0_f64;
        let whole = areas_m2.iter().zip(&exact).map(|(area, phi)| (*area, *phi));
        for (area_m2, phi) in whole.chain([(f64::INFINITY, body.drained_compliance_per_m())]) {
            let relative = self.relative_compliance(drained_poisson_ratio, area_m2)?;
            largest = largest.max((relative - phi / exact[0]).abs());
        }
        Ok(largest)
    }
}

/// Drainage areas divided by the storage (m²): 0, and the squares of lengths from the shortest to
/// the longest, `per_decade` per decade.
fn areas_m2(model: &PoreModel, per_decade: f64) -> Vec<f64> {
    let [smallest_m, largest_m] = model.lengths_m;
    let (first, last) = (2.0 * (NEAREST * smallest_m).log10(), 2.0 * largest_m.log10());
    let n = ((last - first) * per_decade).ceil();
    let area = |i: usize| 10.0_f64.powf(first + (last - first) * i as f64 / n);
    [0.0].into_iter().chain((0..=n as usize).map(area)).collect()
}

/// Chooses the drainage areas of the terms, divided by the storage, greedily: each next area is
/// where the error at the middle ratio is largest. Also returns the undrained compliance of the
/// whole body at that ratio.
fn chosen_areas_m2(model: &PoreModel, settings: &SpectrumSettings) -> Result<(Vec<f64>, f64)> {
    let [lowest, highest] = settings.drained_poisson_ratio;
    let body = model.drained(0.5 * (lowest + highest))?;
    let storage = body.moduli.storage;
    let many: Vec<f64> = areas_m2(model, PER_DECADE).iter().map(|t| t * storage).collect();
    let directions: Vec<Direction> =
        body.pressures(&many)?.into_iter().map(|pressure| Direction::of(&body, pressure)).collect();
    // The following steps work in the span of these pressures, in a basis in which the storage
    // matrix is the identity and the diffusion matrix is diagonal.
    let all = Terms::galerkin(&directions, &body.load)?;
    let undrained = body.drained() - all.at(0.0);
    let direction = |area_m2: f64| {
        let share = |(b, rate): (&f64, &f64)| b / (1.0 + area_m2 * rate);
        let values: Vec<f64> = all.shares.iter().zip(&all.rates_per_m2).map(share).collect();
        let diffused = values.iter().zip(&all.rates_per_m2).map(|(v, rate)| v * rate).collect();
        Direction { stored: values.clone(), values, diffused }
    };
    let candidates: Vec<f64> = areas_m2(model, CANDIDATES_PER_DECADE).iter().map(|t| t * storage).collect();
    let (mut chosen, mut directions) = (vec![0.0], vec![direction(0.0)]);
    while chosen.len() < settings.most_terms {
        let terms = Terms::galerkin(&directions, &all.shares)?;
        if terms.shares.len() < chosen.len() {
            // The new pressures depend linearly on the others: the mesh permits no more terms.
            chosen.pop();
            break;
        }
        let error = |area: f64| (all.at(area) - terms.at(area)) / undrained;
        let worst = candidates.iter().copied().max_by(|a, b| error(*a).total_cmp(&error(*b))).unwrap_or(0.0);
        if error(worst) <= settings.tolerance {
            break;
        }
        chosen.push(worst);
        directions.push(direction(worst));
    }
    Ok((chosen.iter().map(|area| area / storage).collect(), body.share() * undrained))
}

fn computed(body: &DrainedModel, scaled_areas_m2: &[f64]) -> Result<Computed> {
    let storage = body.moduli.storage;
    let areas_m2: Vec<f64> = scaled_areas_m2.iter().map(|t| t * storage).collect();
    let directions: Vec<Direction> =
        body.pressures(&areas_m2)?.into_iter().map(|pressure| Direction::of(body, pressure)).collect();
    let terms = Terms::galerkin(&directions, &body.load)?;
    let undrained = body.drained() - terms.at(0.0);
    let candidates = self::areas_m2(body.model, PER_DECADE);
    let indicators: Vec<f64> =
        candidates.iter().map(|t| indicator(body, &terms, t * storage)).collect::<Result<_>>()?;
    Ok(Computed {
        weights: terms.shares.iter().map(|b| b * b / undrained).collect(),
        areas_m2: terms.rates_per_m2.iter().map(|rate| rate.recip()).collect(),
        undrained,
        indicator: indicators.into_iter().fold(0.0, f64::max),
    })
}

/// Indicator for the error of the compliance at a drainage area τ (m²). The error is the squared
/// norm of the residual, in the norm of (A + τH)⁻¹, with the storage matrix A and the diffusion
/// matrix H. The indicator uses the preconditioner's inverse instead. It is a lower bound that
/// equals the error on irrotational fields.
pub(super) fn indicator(body: &DrainedModel, terms: &Terms, area_m2: f64) -> Result<f64> {
    let residual = terms.residual(area_m2, &body.load);
    let mut solved = residual.clone();
    body.model.pressures.factor(body.moduli.storage, area_m2)?.solve_in_place(&mut solved);
    Ok(dot(&residual, &solved))
}

/// Storage of irrotational fields, as in [`Moduli`], with its derivative with respect to the
/// drained ratio.
fn storage(poisson_ratio: f64, drained_poisson_ratio: Dual) -> Dual {
    let two_mu = 1.0 / (1.0 + poisson_ratio);
    let kappa = |nu: Dual| (nu + 1.0) * two_mu / ((Dual::ONE - nu * 2.0) * 3.0);
    let (undrained, drained) = (kappa(Dual::constant(poisson_ratio)), kappa(drained_poisson_ratio));
    Dual::ONE / (undrained - drained) + Dual::ONE / (drained + 2.0 * two_mu / 3.0)
}

/// The n zeros of the Chebyshev polynomial of degree n, in [−1, 1].
fn chebyshev_points(n: usize) -> impl Iterator<Item = f64> {
    (0..n).map(move |j| (PI * (j as f64 + 0.5) / n as f64).cos())
}

/// Chebyshev coefficients of the polynomial through `values` at the Chebyshev points.
fn chebyshev_coefficients(values: &[f64]) -> Vec<f64> {
    let n = values.len();
    let coefficient = |k: usize| {
        let angle = |j: usize| PI * k as f64 * (j as f64 + 0.5) / n as f64;
        let sum: f64 = values.iter().enumerate().map(|(j, value)| value * angle(j).cos()).sum();
        sum * if k == 0 { 1.0 } else { 2.0 } / n as f64
    };
    (0..n).map(coefficient).collect()
}

/// Value at x of the Chebyshev series Σ cₖ Tₖ(x), by Clenshaw's recurrence.
fn clenshaw(coefficients: &[f64], x: Dual) -> Dual {
    let (mut next, mut after) = (Dual::ZERO, Dual::ZERO);
    for &c in coefficients.iter().skip(1).rev() {
        (next, after) = (x * next * 2.0 - after + c, next);
    }
    x * next - after + coefficients.first().copied().unwrap_or(0.0)
}
