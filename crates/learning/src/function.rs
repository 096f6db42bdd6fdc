//! A learnt function with its band, averaged over priors by their evidence.
//!
//! A search fits each pair with one decay of the cosines (see [`Basis`]) and the likeliest prior standard deviation of their weights. That suffices to compare pairs. But
//! a band under a single prior is too narrow, and eight cosines cannot resolve a kink. So the reported pair is refitted with twice as many cosines under several decays
//! and standard deviations, and with every formula. Each fit is weighted by its evidence.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::distil::{as_effect, with_effect};
use super::fit::{PairFit, fit_own_priors, fit_spread, weights};
use super::formulas::{FormulaText, formulas};
use super::pairs::{Pair, StateKind, finer_functions, state_range};
use super::smooth::{Basis, Smooth};
use super::truncated;
use base::error::Result;
use base::number::Dual;
use criticism::{Candidate, Coordinate, Fitted, Free, Subject, Tangent};
use models::effects::StateEffect;

/// Prior standard deviations of the weights, in the order of their fits.
const SPREADS: [f64; 5] = [0.3, 1.0, 3.0, 0.1, 0.03];
/// Distance (nats) below the best evidence at which a fit is left out of the average over priors.
const LEAST_SHARE_NATS: f64 = 7.0;

/// Form in which a function is fitted.
#[derive(Clone, Copy)]
enum FunctionShape {
    /// A weighted sum of smooth functions.
    Smooth(&'static Smooth),
    /// A formula in the state.
    Formula(&'static StateEffect),
}

/// Function fitted under one prior; `share` is its weight in the average.
struct FunctionFit {
    share: f64,
    shape: FunctionShape,
    candidate: Candidate,
    fitted: Fitted,
    /// Mean and covariance of the coordinates; `None` if the data do not determine them.
    moments: Option<(Vec<f64>, DMatrix<f64>)>,
}

/// Learnt factor of a quantity as a function of a state, with its standard deviation, averaged over priors.
pub struct Function {
    quantity: &'static str,
    /// Function under each prior, the likeliest first.
    members: Vec<FunctionFit>,
}

impl Function {
    /// Returns the function of a pair as the search found it; `None` for a free memory.
    ///
    /// # Errors
    /// Errors of computing derivatives at the fit.
    pub fn of_search(subject: &Subject, learnt: &PairFit, pair: &Pair) -> Result<Option<Self>> {
        let StateKind::Function { smooth, .. } = &pair.kind else { return Ok(None) };
        let only =
            FunctionFit::at(subject, FunctionShape::Smooth(smooth), learnt.candidate.clone(), learnt.fitted.clone())?;
        Ok(Some(Self { quantity: pair.quantity, members: vec![only] }))
    }

    /// Returns the function of a pair with all cosines and every formula, averaged over priors. Returns the search's function if no other can be fitted, and `None` for a
    /// free memory.
    ///
    /// # Errors
    /// Errors of computing derivatives at the fit.
    pub fn averaged(subject: &Subject, learnt: &PairFit, pair: &Pair) -> Result<Option<Self>> {
        let finer = finer_functions(pair);
        let library = subject.library().clone().with_all(finer.iter().map(|(effect, _)| *effect));
        let subject = subject.with_library(&library)?;
        let of_basis = |(effect, smooth): &(&'static dyn models::effects::Effect, &'static Smooth)| {
            let candidate = subject.extended(&[effect.slug()]).ok()?;
            Some(members(&subject, learnt, &candidate, smooth))
        };
        let mut members: Vec<(FunctionFit, f64)> = finer.par_iter().filter_map(of_basis).flatten().collect();
        members.extend(by_formulas(&subject, learnt, pair));
        members.sort_by(|a, b| b.1.total_cmp(&a.1));
        let Some(best) = members.first().map(|(_, ln_evidence)| *ln_evidence) else {
            return Self::of_search(&subject, learnt, pair);
        };
        members.retain(|(_, ln_evidence)| best - ln_evidence < LEAST_SHARE_NATS);
        let whole: f64 = members.iter().map(|(_, ln_evidence)| (ln_evidence - best).exp()).sum();
        let members = members.into_iter().map(|(member, ln_evidence)| {
            let share = (ln_evidence - best).exp() / whole;
            FunctionFit { share, ..member }
        });
        Ok(Some(Self { quantity: pair.quantity, members: members.collect() }))
    }

    /// Returns the model with the function under the likeliest prior.
    pub fn best(&self) -> (&Candidate, &Fitted) {
        (&self.members[0].candidate, &self.members[0].fitted)
    }

    /// Returns the function at some states relative to its value at `reference`: the ln factor and its standard deviation for each state.
    ///
    /// A factor that all states share is a change of the quantity itself, so only ratios describe the function. [`Self::best_known`] finds the best reference for them.
    pub fn curve(&self, states: &[f64], reference: f64) -> Vec<[f64; 2]> {
        let of = |member: &FunctionFit| {
            let (at_reference, slopes_there) = member.ln_factor(reference);
            let at = |state: &f64| {
                let (value, slopes) = member.ln_factor(*state);
                let apart = slopes.into_iter().zip(&slopes_there).map(|((k, slope), (_, other))| (k, slope - other));
                [value - at_reference, member.spread(&apart.collect::<Vec<_>>())]
            };
            states.iter().map(at).collect::<Vec<_>>()
        };
        let curves: Vec<Vec<[f64; 2]>> = self.members.iter().map(of).collect();
        (0..states.len()).map(|place| self.mixed(curves.iter().map(|curve| curve[place]))).collect()
    }

    /// Returns the reference state, among some states, for which the ratios have the least mean variance. At states where the quantity has no influence, such as a force
    /// of 0, the data determine no value.
    pub fn best_known(&self, states: &[f64]) -> Option<f64> {
        let with_variance =
            |reference: &f64| (self.curve(states, *reference).iter().map(|[_, sd]| sd * sd).sum::<f64>(), *reference);
        states.iter().map(with_variance).min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, reference)| reference)
    }

    /// Returns the logarithm of the quantity at a state, and its standard deviation. `None` if the quantity is no free parameter of the law, such as the force or the
    /// observed position.
    pub fn ln_quantity(&self, state: f64) -> Option<[f64; 2]> {
        let is_quantity = |free: &Free| free.name == self.quantity && matches!(free.coordinate, Coordinate::Logarithm);
        let of = |member: &FunctionFit| {
            let (ln_factor, mut all) = member.ln_factor(state);
            let place = member.candidate.free.iter().position(is_quantity)?;
            all.push((place, 1.0));
            Some([ln_factor + member.mean(place), member.spread(&all)])
        };
        let all: Option<Vec<[f64; 2]>> = self.members.iter().map(of).collect();
        all.map(|all| self.mixed(all.into_iter()))
    }

    /// Mean and standard deviation over all priors, from the mean and standard deviation under each prior.
    fn mixed(&self, of_members: impl Iterator<Item = [f64; 2]>) -> [f64; 2] {
        let [mut mean, mut square] = [0.0; 2];
        for (member, [value, sd]) in self.members.iter().zip(of_members) {
            mean += member.share * value;
            square += member.share * (value * value + sd * sd);
        }
        [mean, (square - mean * mean).max(0.0).sqrt()]
    }
}

/// Fits a sum of functions under every prior standard deviation of its weights. The first fit starts from the law and the noise of the search. Returns the fits with
/// their ln evidence.
fn members(
    subject: &Subject,
    learnt: &PairFit,
    candidate: &Candidate,
    smooth: &'static Smooth,
) -> Vec<(FunctionFit, f64)> {
    let mut start = (candidate.embed(&learnt.candidate, &learnt.fitted.theta), learnt.fitted.noise);
    let mut all = Vec::new();
    for spread in SPREADS {
        let Some((candidate, fitted, ln_evidence)) = fit_spread(subject, candidate, spread, start.clone()) else {
            continue;
        };
        start = (fitted.theta.clone(), fitted.noise);
        let Ok(member) = FunctionFit::at(subject, FunctionShape::Smooth(smooth), candidate, fitted) else { continue };
        all.push((member, ln_evidence));
    }
    all
}

/// Fits every formula and returns the fits with their ln evidence; the parameters have their own priors. Empty for monotone functions, since formulas need not be
/// monotone.
fn by_formulas(subject: &Subject, learnt: &PairFit, pair: &Pair) -> Vec<(FunctionFit, f64)> {
    let StateKind::Function { smooth, state, visited, .. } = &pair.kind else { return Vec::new() };
    if matches!(smooth.basis(), Basis::Ramps { .. }) {
        return Vec::new();
    }
    let range = state_range(visited);
    let of = |written: &FormulaText| {
        let (_, effect) = as_effect(written, pair)?;
        let subject = with_effect(subject, effect)?;
        let candidate = subject.extended(&[effect.slug]).ok()?;
        let start = (candidate.embed(&learnt.candidate, &learnt.fitted.theta), learnt.fitted.noise);
        let (candidate, fitted, ln_evidence) = fit_own_priors(&subject, &candidate, start)?;
        let member = FunctionFit::at(&subject, FunctionShape::Formula(effect), candidate, fitted).ok()?;
        Some((member, ln_evidence))
    };
    formulas(*state, range).par_iter().filter_map(of).collect()
}

impl FunctionFit {
    fn at(subject: &Subject, shape: FunctionShape, candidate: Candidate, fitted: Fitted) -> Result<Self> {
        let tangent = Tangent::new(subject, &candidate, &fitted)?;
        let is_one_way =
            matches!(&shape, FunctionShape::Smooth(smooth) if matches!(smooth.basis(), Basis::Ramps { .. }));
        let moments = if is_one_way {
            above_zero(&tangent, &candidate, &fitted)
        } else {
            tangent.covariance().map(|covariance| (fitted.theta.clone(), covariance))
        };
        Ok(Self { share: 1.0, shape, candidate, fitted, moments })
    }

    /// Returns the ln factor at a state, and its derivatives with respect to the coordinates of the effect, each with the coordinate's index.
    fn ln_factor(&self, state: f64) -> (f64, Vec<(usize, f64)>) {
        let places = weights(&self.candidate);
        let coordinate = |k: usize| self.candidate.free[k].coordinate;
        match self.shape {
            FunctionShape::Smooth(smooth) => {
                let functions = smooth.functions(state.into());
                let slope = |(k, function): (usize, &Dual)| (k, function.value * coordinate(k).unit(0.0));
                let slopes: Vec<(usize, f64)> = places.into_iter().zip(&functions).map(slope).collect();
                (slopes.iter().map(|(k, slope)| self.mean(*k) * slope).sum(), slopes)
            }
            FunctionShape::Formula(effect) => {
                let values: Vec<f64> = places.iter().map(|k| coordinate(*k).value(self.fitted.theta[*k])).collect();
                let at = |moved: Option<usize>| {
                    let map = values
                        .iter()
                        .enumerate()
                        .map(|(k, value)| Dual { value: *value, derivative: f64::from(u8::from(moved == Some(k))) });
                    effect.function.value(Dual::constant(state), &map.collect::<Vec<_>>())
                };
                // Beyond the record's states a linear factor may become negative.
                let factor = at(None).value.max(f64::MIN_POSITIVE);
                let slope = |(weight_place, k): (usize, &usize)| {
                    (*k, at(Some(weight_place)).derivative / factor * coordinate(*k).unit(self.fitted.theta[*k]))
                };
                (factor.ln(), places.iter().enumerate().map(slope).collect())
            }
        }
    }

    fn mean(&self, place: usize) -> f64 {
        self.moments.as_ref().map_or(self.fitted.theta[place], |(mean, _)| mean[place])
    }

    /// Standard deviation of a linear combination of coordinates, given as indices and coefficients; infinite if the covariance is unknown.
    fn spread(&self, parts: &[(usize, f64)]) -> f64 {
        let Some((_, covariance)) = &self.moments else { return f64::INFINITY };
        let of = |(i, a): &(usize, f64)| -> f64 { parts.iter().map(|(j, b)| a * b * covariance[(*i, *j)]).sum() };
        parts.iter().map(of).sum::<f64>().max(0.0).sqrt()
    }
}

/// Mean and covariance of the coordinates if no weight may be negative. The normal distribution of the linearised model is truncated to weights of at least 0. Its centre has
/// the coordinates at which the linearised model absorbs the residual.
fn above_zero(tangent: &Tangent, candidate: &Candidate, fitted: &Fitted) -> Option<(Vec<f64>, DMatrix<f64>)> {
    let step = tangent.absorbing_step(tangent.residual())?;
    let centre: Vec<f64> = fitted.theta.iter().zip(step).map(|(theta, step)| theta + step).collect();
    let mut least = vec![f64::NEG_INFINITY; centre.len()];
    weights(candidate).into_iter().for_each(|k| least[k] = 0.0);
    truncated::moments(&centre, &tangent.covariance()?, &least)
}

#[cfg(test)]
#[path = "function_tests.rs"]
mod tests;
