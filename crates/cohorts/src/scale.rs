//! Unbounded coordinate in which a parameter varies over the population: the logarithm, or the log-odds if the parameter has two bounds.

use documents::groups::ScaleName;

use base::parameter::Support;

/// Largest log-odds. Beyond this limit, a value equals a bound to the last bit.
const LARGEST_LOG_ODDS: f64 = 36.0;

/// Transformation of a positive parameter to an unbounded coordinate, in which the parameter varies over the population.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SizeScale {
    /// Logarithm: the coordinate is ln x, for a parameter x above 0.
    Logarithm,
    /// Log-odds: the coordinate is ln((x − a)/(b − x)), for a parameter x between the bounds a ≥ 0 and b.
    LogOdds {
        /// Lower bound a.
        lower: f64,
        /// Upper bound b.
        upper: f64,
    },
}

impl SizeScale {
    /// Chooses the scale for a parameter with this support.
    pub fn of(support: Support) -> Self {
        if support.upper.is_finite() {
            Self::LogOdds { lower: support.lower, upper: support.upper }
        } else {
            Self::Logarithm
        }
    }

    /// Name of the scale in documents.
    pub fn name(self) -> ScaleName {
        match self {
            Self::Logarithm => ScaleName::Logarithm,
            Self::LogOdds { .. } => ScaleName::LogOdds,
        }
    }

    /// Coordinate of a parameter value. The coordinate is finite at the bounds of the parameter, too.
    pub fn coordinate(self, value: f64) -> f64 {
        match self {
            Self::Logarithm => value.max(f64::MIN_POSITIVE).ln(),
            Self::LogOdds { lower, upper } => {
                ((value - lower) / (upper - value)).ln().clamp(-LARGEST_LOG_ODDS, LARGEST_LOG_ODDS)
            }
        }
    }

    /// Parameter value at a coordinate. The value is inside the parameter's support.
    pub fn value(self, coordinate: f64) -> f64 {
        match self {
            Self::Logarithm => coordinate.exp(),
            Self::LogOdds { lower, upper } => {
                // The value is computed from the nearer bound, so that values close to a bound keep their significant digits.
                let share = |t: f64| t.exp() / (1.0 + t.exp());
                let width = upper - lower;
                if coordinate < 0.0 { lower + width * share(coordinate) } else { upper - width * share(-coordinate) }
            }
        }
    }

    /// Logarithm of the parameter value at a coordinate.
    pub fn ln_value(self, coordinate: f64) -> f64 {
        match self {
            Self::Logarithm => coordinate,
            Self::LogOdds { .. } => self.value(coordinate).ln(),
        }
    }

    /// Logarithm of the slope dx/dφ of the parameter value x with the coordinate φ, at `coordinate`.
    pub fn ln_slope(self, coordinate: f64) -> f64 {
        match self {
            Self::Logarithm => coordinate,
            Self::LogOdds { lower, upper } => {
                (upper - lower).ln() - coordinate.abs() - 2.0 * (-coordinate.abs()).exp().ln_1p()
            }
        }
    }

    /// Slope d ln x/dφ of the logarithm of the parameter value x with the coordinate φ. The slope converts a small standard deviation of the coordinate
    /// into a standard deviation of the logarithm.
    pub fn relative_slope(self, coordinate: f64) -> f64 {
        (self.ln_slope(coordinate) - self.ln_value(coordinate)).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use laws::rheology::{BaseLaw, Network};

    const ORDER: SizeScale = SizeScale::LogOdds { lower: 0.0, upper: 1.0 };
    const BETWEEN: SizeScale = SizeScale::LogOdds { lower: 0.5, upper: 3.0 };

    #[test]
    fn values_come_back_and_stay_inside() {
        for scale in [SizeScale::Logarithm, ORDER, BETWEEN] {
            for coordinate in [-30.0, -2.0, -1e-3, 0.0, 0.7, 12.0] {
                let value = scale.value(coordinate);
                let ends = 1e-15 * coordinate.abs().exp();
                assert!((scale.coordinate(value) - coordinate).abs() < 1e-12 + ends, "{scale:?} {coordinate}");
            }
        }
        for coordinate in [-800.0, -40.0, 40.0, 800.0] {
            assert!((0.0..=1.0).contains(&ORDER.value(coordinate)) && (0.5..=3.0).contains(&BETWEEN.value(coordinate)));
        }
        for end in [0.0, 1.0] {
            assert!(ORDER.coordinate(end).is_finite());
        }
        assert!(SizeScale::Logarithm.coordinate(0.0).is_finite());
    }

    /// Compares slopes with difference quotients of the value.
    #[test]
    fn slopes_are_derivatives() {
        for scale in [SizeScale::Logarithm, ORDER, BETWEEN] {
            for coordinate in [-4.0, -0.3, 0.0, 2.5] {
                let step = 1e-5;
                let change = |of: &dyn Fn(f64) -> f64| (of(coordinate + step) - of(coordinate - step)) / (2.0 * step);
                let slope = change(&|z| scale.value(z));
                assert!((scale.ln_slope(coordinate).exp() / slope - 1.0).abs() < 1e-8, "{scale:?} {coordinate}");
                let relative = change(&|z| scale.ln_value(z));
                assert!((scale.relative_slope(coordinate) / relative - 1.0).abs() < 1e-8, "{scale:?} {coordinate}");
            }
        }
    }

    /// Every parameter of a law is positive, because groups are compared by ratios.
    #[test]
    fn no_parameter_of_a_law_is_negative() {
        let text = "series = [{ spring = \"e\" }, { dashpot = \"c\" }, { springpot = \"p\" }]";
        let network = BaseLaw::Network(Network::from_text("n.toml".as_ref(), text).unwrap());
        for law in BaseLaw::NAMED.into_iter().chain([network]) {
            assert!(law.parameters().iter().all(|spec| spec.support.lower >= 0.0), "{law:?}");
        }
    }
}
