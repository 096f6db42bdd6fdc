//! Grouped score tests: whether whitened residuals lie along columns that a model's parameters cannot absorb.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::Tangent;
use sampling::ensemble::RandomStream;

/// Columns (m, one value a row of the record) that are tested together.
#[derive(Debug, Clone, PartialEq)]
pub struct Group {
    /// What it is called.
    pub name: String,
    /// Its columns.
    pub columns_m: Vec<Vec<f64>>,
}

/// What a group's test says.
#[derive(Debug, Clone, PartialEq)]
pub struct GroupScore {
    /// Gain in log likelihood, nats, of the best amplitudes: ½‖Qᵀr‖² with Q an orthonormal basis of the visible columns.
    pub gain_nats: f64,
    /// Independent visible columns.
    pub degrees: usize,
    /// p of the group alone, by χ².
    pub p: f64,
    /// p corrected for all groups, by simulation.
    pub p_familywise: f64,
    /// Best amplitude of each column with the others of its group; least squares of smallest norm.
    pub amplitudes: Vec<f64>,
}

/// Directions whose visible part is below this fraction of the group's largest are not independent.
const RANK_TOLERANCE: f64 = 1e-5;
/// Visible columns below this fraction of their whole are rounding and curvature.
const LEAST_VISIBLE: f64 = 1e-6;

/// Basis of the visible columns of a group: an orthonormal one, and what turns coordinates in it into amplitudes.
struct Basis {
    q: DMatrix<f64>,
    to_amplitudes: DMatrix<f64>,
}

fn basis(tangent: &Tangent, group: &Group) -> Basis {
    let whole = tangent.whiten(&group.columns_m);
    let visible: Vec<DVector<f64>> = whole.iter().map(|g| tangent.project(g.clone())).collect();
    let n = tangent.n_rows();
    // Scaled to unit length, so that no column is lost for its unit.
    let scale: Vec<f64> = whole
        .iter()
        .zip(&visible)
        .map(|(g, v)| if v.norm() > LEAST_VISIBLE * g.norm() { v.norm().recip() } else { 0.0 })
        .collect();
    let columns = DMatrix::from_fn(n, visible.len(), |i, j| visible[j][i] * scale[j]);
    let eigen = (columns.transpose() * &columns).symmetric_eigen();
    let largest = eigen.eigenvalues.iter().fold(0.0_f64, |a, b| a.max(*b));
    let kept: Vec<usize> =
        (0..visible.len()).filter(|k| largest > 0.0 && eigen.eigenvalues[*k] > RANK_TOLERANCE * largest).collect();
    let direction = |j: usize, k: usize| eigen.eigenvectors[(j, kept[k])] / eigen.eigenvalues[kept[k]].sqrt();
    let combine = DMatrix::from_fn(visible.len(), kept.len(), direction);
    let to_amplitudes = DMatrix::from_fn(visible.len(), kept.len(), |j, k| combine[(j, k)] * scale[j]);
    Basis { q: columns * combine, to_amplitudes }
}

/// Upper tail of χ² with `degrees` degrees of freedom at 2 × gain.
pub fn p_of_gain(gain_nats: f64, degrees: usize) -> f64 {
    match ChiSquared::new(degrees as f64) {
        Ok(distribution) if degrees > 0 => distribution.sf(2.0 * gain_nats),
        _ => 1.0,
    }
}

/// Tests every group against the residuals of a tangent; corrected together by `n_simulations` residuals from N(0, P), with streams of `seed`.
pub fn score_groups(tangent: &Tangent, groups: &[Group], n_simulations: usize, seed: u64) -> Vec<GroupScore> {
    let bases: Vec<Basis> = groups.par_iter().map(|group| basis(tangent, group)).collect();
    let gain = |basis: &Basis, r: &DVector<f64>| 0.5 * basis.q.tr_mul(r).norm_squared();
    let r = tangent.residual();
    let own: Vec<(f64, f64)> = bases
        .iter()
        .map(|basis| {
            let gain_nats = gain(basis, r);
            (gain_nats, p_of_gain(gain_nats, basis.q.ncols()))
        })
        .collect();
    let smallest = |number: usize| {
        let mut stream = RandomStream::new(seed, number as u64);
        // Q lies in the range of P, so that Qᵀ of white numbers is Qᵀ of projected ones.
        let white = DVector::from_fn(tangent.n_rows(), |_, _| stream.normal());
        bases.iter().map(|basis| p_of_gain(gain(basis, &white), basis.q.ncols())).fold(1.0, f64::min)
    };
    let simulated: Vec<f64> = (0..n_simulations).into_par_iter().map(smallest).collect();
    let score = |(basis, (gain_nats, p)): (&Basis, &(f64, f64))| GroupScore {
        gain_nats: *gain_nats,
        degrees: basis.q.ncols(),
        p: *p,
        p_familywise: (1 + simulated.iter().filter(|s| *s <= p).count()) as f64 / (1 + n_simulations) as f64,
        amplitudes: (&basis.to_amplitudes * basis.q.tr_mul(r)).iter().copied().collect(),
    };
    bases.iter().zip(&own).map(score).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_replica::{WHITE, base_fit, simulated};
    use crate::{Fitted, Search};

    fn groups(time_s: &[f64]) -> Vec<Group> {
        let column = |f: &dyn Fn(f64) -> f64| time_s.iter().map(|t| 1e-6 * f(*t)).collect::<Vec<f64>>();
        vec![
            Group { name: "line".into(), columns_m: vec![column(&|t| t)] },
            // The third is the sum of the others.
            Group {
                name: "wave".into(),
                columns_m: vec![
                    column(&|t| (3.0 * t).sin()),
                    column(&|t| (3.0 * t).cos()),
                    column(&|t| (3.0 * t).sin() + (3.0 * t).cos()),
                ],
            },
            Group { name: "nothing".into(), columns_m: vec![column(&|_| 0.0)] },
        ]
    }

    /// 200 correct models: p below 0.05 in one of twenty; 29 or more of them have a binomial probability of 3e-7. A wave of half the noise is found with
    /// its amplitude, whose error is 4 µm √(2/600) = 0.23 µm: five of those are passed falsely below 1e-6.
    #[test]
    fn p_is_calibrated_and_structure_is_found() {
        let (base, fitted) = base_fit();
        let time_s = fitted_times();
        let groups = groups(&time_s);
        let count = (0..200_u64)
            .into_par_iter()
            .filter(|seed| {
                let data = simulated(&base, &fitted.theta, &WHITE, *seed);
                let fitted = data.fit(&base, &[(fitted.theta.clone(), WHITE)], Search::Local).expect("fits");
                let tangent = Tangent::new(&data, &base, &fitted).expect("derivatives");
                score_groups(&tangent, &groups, 199, *seed).iter().any(|score| score.p_familywise <= 0.05)
            })
            .count();
        assert!(count <= 28, "{count} of 200");
        let data = simulated(&base, &fitted.theta, &WHITE, 1);
        let both: Vec<f64> = data
            .fitted_m
            .iter()
            .zip(&data.scored_m)
            .zip(&time_s)
            .map(|((a, b), t)| a.or(*b).unwrap_or(0.0) + 2e-6 * (3.0 * t).sin())
            .collect();
        let data = data.with_positions(&both);
        let fitted = Fitted { noise: WHITE, ..data.fit(&base, &[], Search::Wide).expect("fits") };
        let scores = score_groups(&Tangent::new(&data, &base, &fitted).expect("derivatives"), &groups, 199, 1);
        assert_eq!(scores.iter().map(|s| s.degrees).collect::<Vec<_>>(), [1, 2, 0]);
        assert!(scores[1].p_familywise < 0.01 && scores[2].p == 1.0, "{scores:?}");
        // Of smallest norm: what the sum carries is shared between it and its parts.
        let [sine, _, sum] = scores[1].amplitudes[..] else { panic!("three columns") };
        assert!((sine + sum - 2.0).abs() < 1.2, "{:?}", scores[1].amplitudes);
    }

    fn fitted_times() -> Vec<f64> {
        crate::test_replica::replica().experiment().record.time_s.clone()
    }

    #[test]
    fn tails_are_those_of_chi_squared() {
        // Two degrees of freedom: exp(−gain).
        assert!((p_of_gain(3.0, 2) - (-3.0_f64).exp()).abs() < 1e-12);
        assert_eq!(p_of_gain(3.0, 0), 1.0);
    }
}
