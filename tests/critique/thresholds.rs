//! Thresholds of the largest score by chance.

use nalgebra::{DMatrix, DVector};
use vitreo_uq::criticism::rank::{Score, largest_score_threshold};

fn score(is_one_sided: bool) -> Score {
    Score {
        z: 0.0,
        expected_parameter: 0.0,
        visible_fraction: 1.0,
        signature_per_unit: 1.0,
        direction: Some(DVector::from_element(1, 1.0)),
        is_one_sided,
    }
}

/// For one effect: the 95 % quantile of |z|, 1.960, and of a one-sided z, 1.645. For two independent ones the square roots of these probabilities give 2.236 and 1.955. Quantiles of some thousands of draws
/// have errors of about 0.03; each may deviate by a fifth of the distance between the two.
#[test]
fn the_largest_score_by_chance_knows_which_way_effects_may_go() {
    for (n, two_sided, one_sided) in [(1, 1.960, 1.645), (2, 2.236, 1.955)] {
        let cosines = DMatrix::identity(n, n);
        for (is_one_sided, expected) in [(false, two_sided), (true, one_sided)] {
            let scores: Vec<Score> = (0..n).map(|_| score(is_one_sided)).collect();
            let found = largest_score_threshold(&scores, &cosines, 3);
            assert!((found - expected).abs() < 0.12, "{n} {is_one_sided}: {found} for {expected}");
        }
    }
}
