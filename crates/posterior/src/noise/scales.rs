//! Noise parameters in the form that the filter uses, and the scales of their default priors.

/// Largest allowed ratio of a noise term's variance to the variance of the white noise. Products of larger ratios could overflow.
const LARGEST_RATIO: f64 = 1e100;

/// Properties of a record that scale the default priors of the noise parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoiseScales {
    /// Median of the prior of the white noise's standard deviation, in µm.
    pub noise_sd_um: f64,
    /// Median time between rows in s.
    pub sample_interval_s: f64,
    /// Duration of a cycle in s.
    pub cycle_s: f64,
}

/// Noise parameters in SI units. Variances are divided by the variance of the white noise. Terms that the model lacks have variance 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FilterScales {
    /// Standard deviation of the white noise in m; for Student-t errors, their scale.
    pub noise_sd_m: f64,
    /// Stationary variance of the Ornstein–Uhlenbeck process, divided by the variance of the white noise.
    pub ou: f64,
    /// Correlation time of the Ornstein–Uhlenbeck process in s.
    pub ou_time_s: f64,
    /// Variance of the gain, divided by the variance of the white noise, in 1/m².
    pub gain_per_m2: f64,
    /// Variance of the offset, divided by the variance of the white noise.
    pub offset: f64,
    /// Degrees of freedom of Student-t errors; infinite for normal errors.
    pub dof: f64,
}

impl FilterScales {
    /// Placeholder for a parameter point outside the support, whose result is discarded.
    pub const UNIT: Self =
        Self { noise_sd_m: 1.0, ou: 0.0, ou_time_s: 1.0, gain_per_m2: 0.0, offset: 0.0, dof: f64::INFINITY };

    /// Returns true if the filter can use the scales: the white noise is positive, and the ratios of variances are at most 10¹⁰⁰.
    pub fn is_in_range(&self) -> bool {
        let small = |ratio: f64| ratio <= LARGEST_RATIO;
        self.noise_sd_m > 0.0 && small(self.ou) && small(self.gain_per_m2) && small(self.offset)
    }

    /// Square of a noise term's standard deviation `sd`, divided by the variance of the white noise. The ratio is dimensionless for `sd` in m, and in 1/m² for a gain.
    pub fn ratio(&self, sd: f64) -> f64 {
        (sd / self.noise_sd_m).powi(2)
    }

    /// Variance of an error divided by its squared scale: 1 for normal errors, ν/(ν − 2) for Student-t errors with ν degrees of freedom (infinite at ν = 2).
    pub fn variance_factor(&self) -> f64 {
        if self.dof.is_finite() { self.dof / (self.dof - 2.0) } else { 1.0 }
    }

    /// Decay exp(−Δt/τ) of the process with correlation time τ in a time step Δt (s), and the variance that it gains, divided by the variance of the white noise. The
    /// gained variance is 1 − exp(−2Δt/τ) times the stationary variance.
    pub fn step(&self, step_s: f64) -> (f64, f64) {
        // `exp_m1` keeps the digits of short steps.
        let change = (-step_s / self.ou_time_s).exp_m1();
        (1.0 + change, -change * (2.0 + change) * self.ou)
    }
}
