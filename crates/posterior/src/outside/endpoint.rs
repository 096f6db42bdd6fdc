//! The requests of UM-Bridge, as client and server know them.

/// What a client may ask.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Endpoint {
    /// Which models there are.
    Info,
    /// What a model can do.
    ModelInfo,
    /// Lengths of its vectors of inputs.
    InputSizes,
    /// Lengths of its vectors of outputs.
    OutputSizes,
    /// Outputs at inputs.
    Evaluate,
    /// Sensitivities of outputs times the Jacobian.
    Gradient,
    /// The Jacobian times a direction of inputs.
    ApplyJacobian,
    /// Second derivatives.
    ApplyHessian,
}

impl Endpoint {
    /// All, in the protocol's order.
    pub const ALL: [Self; 8] = [
        Self::Info,
        Self::ModelInfo,
        Self::InputSizes,
        Self::OutputSizes,
        Self::Evaluate,
        Self::Gradient,
        Self::ApplyJacobian,
        Self::ApplyHessian,
    ];

    /// Its path.
    pub fn path(self) -> &'static str {
        match self {
            Self::Info => "/Info",
            Self::ModelInfo => "/ModelInfo",
            Self::InputSizes => "/InputSizes",
            Self::OutputSizes => "/OutputSizes",
            Self::Evaluate => "/Evaluate",
            Self::Gradient => "/Gradient",
            Self::ApplyJacobian => "/ApplyJacobian",
            Self::ApplyHessian => "/ApplyHessian",
        }
    }
}
