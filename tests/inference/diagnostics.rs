//! Convergence diagnostics on made-up draws with known problems.

use vitreo_uq::sampling::diagnostics::{Chains, rhat};
use vitreo_uq::sampling::ensemble::RandomStream;

/// Four chains of 1,000 normal draws share a drift of three standard deviations: they agree at every step, and only their halves differ. With the drift d, the halves' means
/// are d/4 away from the whole's, and the variance within a half is 1 + d²/48: R̂ = √(1 + (8/7)(d/4)²/(1 + d²/48)) = 1.24. Without the drift it is below 1.01.
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
