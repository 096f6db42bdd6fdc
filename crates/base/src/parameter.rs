//! Description of a model's parameters ([`ParameterSpec`]), and the parameters of laws and noise. Each effect's parameters are in the effect's own file.

/// Name, symbol, unit and allowed range of one parameter of a law, an effect or a noise term.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParameterSpec {
    /// Unique name. Names of a law's or the noise's parameters end in the unit, as in `ou_time_s`. Names of an effect's parameters are
    /// `slug.name`.
    pub name: &'static str,
    /// Symbol in equations and figures. It is empty for parameters of a neural network; figures then show the name.
    pub symbol: &'static str,
    /// Unit of the parameter in priors and results.
    pub unit: &'static str,
    /// Interval of allowed values.
    pub support: Support,
    /// `true` if the model's response near the null is proportional to the parameter's square. Searches then use the square as coordinate.
    pub enters_as_square: bool,
    /// `true` if the parameter keeps its null value unless the user sets its value or lets it be fitted.
    pub is_optional: bool,
}

impl ParameterSpec {
    /// Makes the description of a parameter that is not optional and does not enter as a square.
    pub const fn new(name: &'static str, symbol: &'static str, unit: &'static str, support: Support) -> Self {
        Self { name, symbol, unit, support, enters_as_square: false, is_optional: false }
    }

    /// Returns this description with [`ParameterSpec::enters_as_square`] set to `true`.
    pub const fn squared(self) -> Self {
        Self { enters_as_square: true, ..self }
    }

    /// Returns this description with [`ParameterSpec::is_optional`] set to `true`.
    pub const fn optional(self) -> Self {
        Self { is_optional: true, ..self }
    }

    const fn positive(name: &'static str, symbol: &'static str, unit: &'static str) -> Self {
        Self::new(name, symbol, unit, Support::POSITIVE)
    }
}

/// Young's modulus E of the Kelvin–Voigt body (spring and dashpot in parallel).
pub const YOUNG_MODULUS: ParameterSpec = ParameterSpec::positive("young_modulus_pa", "E", "Pa");
/// Retardation viscosity c₁ of the Kelvin–Voigt body's dashpot.
pub const RETARDATION_VISCOSITY: ParameterSpec = ParameterSpec::positive("viscosity_1_pa_s", "c₁", "Pa s");
/// Flow viscosity c₂ of the dashpot in series with the Kelvin–Voigt body.
pub const FLOW_VISCOSITY: ParameterSpec = ParameterSpec::positive("viscosity_2_pa_s", "c₂", "Pa s");
/// Modulus E₀ of the spring in series in the Burgers law.
pub const INSTANTANEOUS_MODULUS: ParameterSpec = ParameterSpec::positive("instantaneous_modulus_pa", "E₀", "Pa");
/// Modulus E₂ of the second Kelvin–Voigt body in the two-element law.
pub const SECOND_MODULUS: ParameterSpec = ParameterSpec::positive("second_modulus_pa", "E₂", "Pa");
/// Viscosity c₃ of the second Kelvin–Voigt body in the two-element law.
pub const SECOND_VISCOSITY: ParameterSpec = ParameterSpec::positive("second_viscosity_pa_s", "c₃", "Pa s");
/// Standard deviation of white noise.
pub const NOISE_SD: ParameterSpec = ParameterSpec::positive("noise_sd_um", "σ", "um");
/// Standard deviation of slow noise, an Ornstein–Uhlenbeck (OU) process.
pub const SLOW_NOISE_SD: ParameterSpec = ParameterSpec::positive("ou_sd_um", "σ OU", "um");
/// Correlation time of slow noise, an Ornstein–Uhlenbeck (OU) process.
pub const SLOW_NOISE_TIME: ParameterSpec = ParameterSpec::positive("ou_time_s", "τ OU", "s");
/// Standard deviation of the random gain that multiplies the positions of each cycle.
pub const GAIN_SD: ParameterSpec = ParameterSpec::positive("gain_sd", "sd of gain", "1");
/// Standard deviation of the random offset that is added to the positions of each cycle.
pub const OFFSET_SD: ParameterSpec = ParameterSpec::positive("offset_sd_um", "sd of offset", "um");
/// Degrees of freedom of Student's t distribution of the measurement errors. Their lower limit is 2, below which the errors have no
/// variance.
pub const STUDENT_DOF: ParameterSpec =
    ParameterSpec::new("student_dof", "degrees of freedom", "1", Support { lower: 2.0, upper: f64::INFINITY });

/// Standard deviation of the measurement errors of an oscillation's two values per row. It is relative to the absolute complex modulus |G*|
/// for moduli, and in rad for a phase.
pub const RELATIVE_NOISE: ParameterSpec = ParameterSpec::positive("noise_relative", "relative error", "1");

/// Finds a parameter of laws or noise by its name; `None` for an unknown name.
pub fn named(name: &str) -> Option<&'static ParameterSpec> {
    const NAMED: &[ParameterSpec] = &[
        YOUNG_MODULUS,
        RETARDATION_VISCOSITY,
        FLOW_VISCOSITY,
        INSTANTANEOUS_MODULUS,
        SECOND_MODULUS,
        SECOND_VISCOSITY,
        NOISE_SD,
        SLOW_NOISE_SD,
        SLOW_NOISE_TIME,
        GAIN_SD,
        OFFSET_SD,
        STUDENT_DOF,
        RELATIVE_NOISE,
    ];
    NAMED.iter().find(|spec| spec.name == name)
}

/// Interval of allowed values. Finite ends belong to the interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Support {
    /// Lower end, or −∞.
    pub lower: f64,
    /// Upper end, or +∞.
    pub upper: f64,
}

impl Support {
    /// Interval from 0 to +∞.
    pub const POSITIVE: Self = Self { lower: 0.0, upper: f64::INFINITY };
    /// Interval from −∞ to +∞.
    pub const REAL: Self = Self { lower: f64::NEG_INFINITY, upper: f64::INFINITY };

    /// Returns `true` if a value lies in the interval, finite ends included.
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
