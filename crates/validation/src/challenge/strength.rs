//! Strength of a hidden effect or disturbance, and a search for the size that has a given signal.

/// Largest relative difference between the signal of the size found and the requested signal.
const TOLERANCE: f64 = 0.02;
const MOST_ROUNDS: usize = 24;

/// Strength of a hidden effect or disturbance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Strength {
    /// Signal of each hidden effect or disturbance, in standard deviations.
    Sigma(f64),
    /// Size is drawn from the effect's prior.
    Prior,
    /// Distance of the single effect's first parameter from its null, in the parameter's unit. If the parameter can only lie below its null, the distance is
    /// subtracted.
    Size(f64),
}

impl Strength {
    /// Requested signal in standard deviations; `otherwise` if a size or the prior is requested. Physics outside the library and large displacements use this
    /// function, because they have no size parameter.
    pub(super) fn sigma_or(self, otherwise: f64) -> f64 {
        match self {
            Self::Sigma(sigma) => sigma,
            Self::Prior | Self::Size(_) => otherwise,
        }
    }
}

/// Scales sizes until each signal is `asked_sigma`. Returns the sizes with their signals. The function `signals` computes the signals from the sizes, and
/// returns `None` if the model fails. The result is `None` if a size reaches `largest` and its signal is still too small.
///
/// Few rounds suffice because signals are nearly proportional to sizes.
pub fn scale_to_signal(
    asked_sigma: f64,
    mut sizes: Vec<f64>,
    largest: &[f64],
    mut signals: impl FnMut(&[f64]) -> Option<Vec<f64>>,
) -> Option<(Vec<f64>, Vec<f64>)> {
    for round in 0..MOST_ROUNDS {
        let Some(found) = signals(&sizes) else {
            sizes.iter_mut().for_each(|size| *size *= 0.6);
            continue;
        };
        if found.iter().all(|signal| (signal / asked_sigma - 1.0).abs() < TOLERANCE) {
            return Some((sizes, found));
        }
        for (index, signal) in found.iter().enumerate() {
            if sizes[index] >= largest[index] && *signal < asked_sigma {
                return None;
            }
            let factor = (asked_sigma / signal.max(1e-3 * asked_sigma)).clamp(0.1, 10.0);
            // Later rounds take shorter steps, in case full steps oscillate.
            let factor = if round < 6 { factor } else { factor.sqrt() };
            sizes[index] = (sizes[index] * factor).min(largest[index]);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_scaled_to_the_signal_that_is_asked_for() {
        // Example in which each signal is a nonlinear function of the sizes, and one depends on both.
        let signals =
            |sizes: &[f64]| Some(vec![3.0 * sizes[0] + sizes[0].powi(2), (8.0 * sizes[1]).sqrt() + 0.1 * sizes[0]]);
        let (sizes, found) = scale_to_signal(10.0, vec![0.1, 0.1], &[100.0, 100.0], signals).expect("reachable");
        assert!(found.iter().all(|signal| (signal - 10.0).abs() < 0.2), "{found:?}");
        assert!((sizes[0] - 2.0).abs() < 0.05, "{sizes:?}");
    }

    #[test]
    fn a_signal_out_of_reach_is_none() {
        assert_eq!(scale_to_signal(10.0, vec![0.1], &[1.0], |sizes| Some(vec![sizes[0]])), None);
        assert_eq!(scale_to_signal(10.0, vec![0.1], &[1.0], |_| None), None);
    }
}
