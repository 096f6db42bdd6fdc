//! Requests of UM-Bridge, for client and server.

/// Endpoint of a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Endpoint {
    /// Names of the available models.
    Info,
    /// Capabilities of a model.
    ModelInfo,
    /// Lengths of the model's input vectors.
    InputSizes,
    /// Lengths of the model's output vectors.
    OutputSizes,
    /// Outputs at given inputs.
    Evaluate,
    /// Sensitivities of outputs times the Jacobian.
    Gradient,
    /// Jacobian times a direction of inputs.
    ApplyJacobian,
    /// Second derivatives.
    ApplyHessian,
}

impl Endpoint {
    /// All endpoints, in the protocol's order.
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

    /// URL path.
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
