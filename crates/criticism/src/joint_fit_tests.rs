use super::*;
use crate::derivatives::columns_m;
use crate::test_replica::replica;

/// Cycles of one record, fitted as separate records, have the exact joint likelihood of one fit to all of them, which uses no expansion. Only the estimates of the noise differ: a
/// standard deviation from some 200 positions is known to 5 %, and moves the weight of a record as much.
#[test]
fn cycles_fitted_as_separate_records_agree_with_one_fit() {
    let replica = replica().clone().with_specified_noise();
    let cycles = |cycles: &[u32]| replica.with_cycles(cycles, &[]).expect("cycles of the replica");
    let candidate = replica.base();
    let whole = cycles(&[1, 2, 3]);
    let together = whole.fit(&candidate, &[], Search::Wide).expect("fits");
    let apart = JointFit::of(&[cycles(&[1]), cycles(&[2]), cycles(&[3])], &candidate).expect("fits");
    let columns_m = columns_m(&whole, &candidate, &together.theta).expect("derivatives");
    let white = whole.fitted.whiten(&columns_m, &together.position_m, &together.noise);
    let information = DMatrix::from_fn(white.len(), white.len(), |i, j| {
        white[i].iter().zip(&white[j]).map(|(a, b)| a * b).sum::<f64>()
    });
    let covariance = information.try_inverse().expect("determined");
    for (k, (a, b)) in apart.theta().iter().zip(&together.theta).enumerate() {
        let sd = covariance[(k, k)].sqrt();
        assert!((a - b).abs() < 0.15 * sd, "coordinate {k}: {a} against {b}, standard deviation {sd}");
    }
    // Every record by itself is farther off: the agreement is no matter of course.
    let first = cycles(&[1]).fit(&candidate, &[], Search::Wide).expect("fits");
    let is_far = |k: usize| (first.theta[k] - together.theta[k]).abs() > 0.3 * covariance[(k, k)].sqrt();
    assert!((0..first.theta.len()).any(is_far), "{first:?}");
    let likelihood: f64 = apart.records.iter().map(|record| record.ln_likelihood).sum();
    assert!((likelihood - together.ln_likelihood).abs() < 3.0, "{likelihood} against {}", together.ln_likelihood);
}

/// The expansion equals the exact log likelihood at its point, and its slope is the derivative there.
#[test]
fn an_expansion_has_the_value_and_the_slope_of_the_likelihood() {
    let subject = replica().clone().with_specified_noise();
    let candidate = subject.base();
    let fitted = subject.fit(&candidate, &[], Search::Wide).expect("fits");
    let theta: Vec<f64> = fitted.theta.iter().map(|theta| theta + 0.02).collect();
    let exact = |theta: &[f64]| {
        let position_m = subject.trajectory_m(&candidate, theta).expect("a solution");
        subject.fitted.ln_likelihood(&position_m, &fitted.noise)
    };
    let expansion = Elsewhere::about(&theta, &candidate, &[(&subject, &fitted.noise)]).expect("derivatives");
    assert_eq!(expansion.ln_likelihood(&theta), exact(&theta));
    for k in 0..theta.len() {
        let moved = |step: f64| {
            let mut moved = theta.clone();
            moved[k] += step;
            moved
        };
        let slope = |of: &dyn Fn(&[f64]) -> f64| (of(&moved(1e-3)) - of(&moved(-1e-3))) / 2e-3;
        let [found, expected] = [slope(&|theta| expansion.ln_likelihood(theta)), slope(&exact)];
        assert!((found / expected - 1.0).abs() < 2e-2, "coordinate {k}: {found} against {expected}");
    }
}
