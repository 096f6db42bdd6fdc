//! What convergence diagnostics must see, on draws made for it.

use vitreo_uq::sampling::diagnostics::{Chains, rhat};
use vitreo_uq::sampling::ensemble::RandomStream;

/// Four chains of 1,000 normal draws that drift alike, by three standard deviations each: at every step they agree, and only their halves differ. With d the drift, halves' means
/// lie d/4 from the whole's, and within a half the variance is 1 + d²/48: R̂ = √(1 + (8/7)(d/4)²/(1 + d²/48)) = 1.24. Without the drift it is below 1.01.
#[test]
fn a_drift_that_all_chains_share_is_seen() {
    let chains = |drift: f64| {
        let chain = |number: u64| {
            let mut stream = RandomStream::new(3, number);
            (0..1_000).map(|step| stream.normal() + drift * f64::from(step) / 1e3).collect::<Vec<f64>>()
        };
        Chains::new((0..4).map(chain).collect())
    };
    assert!(rhat(&chains(0.0)) < 1.01);
    let found = rhat(&chains(3.0));
    assert!((found - 1.24).abs() < 0.05, "{found}");
}
