//! What a model says about one of its parameters: the only place where its name, unit and support stand.

/// A parameter of a law, an effect or a noise term.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParameterSpec {
    /// Name that ends in the unit, or `slug.name` for an effect's.
    pub name: &'static str,
    /// Unit in which priors and results give it.
    pub unit: &'static str,
    /// Where the parameter may lie.
    pub support: Support,
}

impl ParameterSpec {
    /// A parameter.
    pub const fn new(name: &'static str, unit: &'static str, support: Support) -> Self {
        Self { name, unit, support }
    }
}

/// An interval; infinite ends are open.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Support {
    /// Lower end.
    pub lower: f64,
    /// Upper end.
    pub upper: f64,
}

impl Support {
    /// Everything above zero.
    pub const POSITIVE: Self = Self { lower: 0.0, upper: f64::INFINITY };
    /// Every number.
    pub const REAL: Self = Self { lower: f64::NEG_INFINITY, upper: f64::INFINITY };

    /// Whether a value lies in it, finite ends included.
    pub fn contains(&self, value: f64) -> bool {
        value >= self.lower && value <= self.upper
    }
}

impl Default for Support {
    fn default() -> Self {
        Self::REAL
    }
}

impl std::fmt::Display for Support {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match (self.lower.is_finite(), self.upper.is_finite()) {
            (true, true) => write!(f, "[{}, {}]", self.lower, self.upper),
            (true, false) => write!(f, "[{}, ∞)", self.lower),
            (false, true) => write!(f, "(−∞, {}]", self.upper),
            (false, false) => write!(f, "(−∞, ∞)"),
        }
    }
}
