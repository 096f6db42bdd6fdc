//! Description of a model's parameters, and the parameters of laws and noise. Parameters of effects are in the effects' own files.

/// Parameter of a law, an effect or a noise term.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParameterSpec {
    /// Name that ends in the unit, or `slug.name` for a parameter of an effect.
    pub name: &'static str,
    /// Symbol in equations and figures; empty for parameters of a network, for which figures show the name.
    pub symbol: &'static str,
    /// Unit of the parameter in priors and results.
    pub unit: &'static str,
    /// Allowed range.
    pub support: Support,
    /// The response to the parameter begins with its square, so searches use the square as coordinate.
    pub enters_as_square: bool,
    /// The parameter stays at its null unless it is set or freed.
    pub is_optional: bool,
}

impl ParameterSpec {
    /// Makes a parameter.
    pub const fn new(name: &'static str, symbol: &'static str, unit: &'static str, support: Support) -> Self {
        Self { name, symbol, unit, support, enters_as_square: false, is_optional: false }
    }

    /// Marks the parameter as one whose response begins with its square.
    pub const fn squared(self) -> Self {
        Self { enters_as_square: true, ..self }
    }

    /// Keeps the parameter at its null unless it is set or freed.
    pub const fn optional(self) -> Self {
        Self { is_optional: true, ..self }
    }

    const fn positive(name: &'static str, symbol: &'static str, unit: &'static str) -> Self {
        Self::new(name, symbol, unit, Support::POSITIVE)
    }
}

/// Young's modulus E of the Kelvin–Voigt body.
pub const YOUNG_MODULUS: ParameterSpec = ParameterSpec::positive("young_modulus_pa", "E", "Pa");
/// Retardation viscosity c₁ of the Kelvin–Voigt body.
pub const RETARDATION_VISCOSITY: ParameterSpec = ParameterSpec::positive("viscosity_1_pa_s", "c₁", "Pa s");
/// Flow viscosity c₂ of the dashpot in series.
pub const FLOW_VISCOSITY: ParameterSpec = ParameterSpec::positive("viscosity_2_pa_s", "c₂", "Pa s");
/// Modulus of the Burgers law's spring in series.
pub const INSTANTANEOUS_MODULUS: ParameterSpec = ParameterSpec::positive("instantaneous_modulus_pa", "E₀", "Pa");
/// Modulus of the two-element law's second body.
pub const SECOND_MODULUS: ParameterSpec = ParameterSpec::positive("second_modulus_pa", "E₂", "Pa");
/// Viscosity of the two-element law's second body.
pub const SECOND_VISCOSITY: ParameterSpec = ParameterSpec::positive("second_viscosity_pa_s", "c₃", "Pa s");
/// Standard deviation of white noise.
pub const NOISE_SD: ParameterSpec = ParameterSpec::positive("noise_sd_um", "σ", "um");
/// Standard deviation of slow noise.
pub const SLOW_NOISE_SD: ParameterSpec = ParameterSpec::positive("ou_sd_um", "σ OU", "um");
/// Correlation time of slow noise.
pub const SLOW_NOISE_TIME: ParameterSpec = ParameterSpec::positive("ou_time_s", "τ OU", "s");
/// Standard deviation of a cycle's gain.
pub const GAIN_SD: ParameterSpec = ParameterSpec::positive("gain_sd", "sd of gain", "1");
/// Standard deviation of a cycle's offset.
pub const OFFSET_SD: ParameterSpec = ParameterSpec::positive("offset_sd_um", "sd of offset", "um");
/// Degrees of freedom of Student's t; below 2 the errors would have no variance.
pub const STUDENT_DOF: ParameterSpec =
    ParameterSpec::new("student_dof", "degrees of freedom", "1", Support { lower: 2.0, upper: f64::INFINITY });

/// Standard deviation of both numbers of an oscillation, relative to |G*|; of a phase in rad.
pub const RELATIVE_NOISE: ParameterSpec = ParameterSpec::positive("noise_relative", "relative error", "1");

/// Finds a parameter of laws or noise by its name.
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

/// Interval; infinite ends are open.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Support {
    /// Lower end.
    pub lower: f64,
    /// Upper end.
    pub upper: f64,
}

impl Support {
    /// All positive numbers.
    pub const POSITIVE: Self = Self { lower: 0.0, upper: f64::INFINITY };
    /// All numbers.
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
