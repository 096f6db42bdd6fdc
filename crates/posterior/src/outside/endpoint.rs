//! Endpoints of the UM-Bridge protocol, which client and server share.

/// Endpoint of UM-Bridge to which a request is sent.
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
    /// Output vectors at given input vectors.
    Evaluate,
    /// Product of a sensitivity vector of the outputs and the Jacobian.
    Gradient,
    /// Product of the Jacobian and a direction of the inputs.
    ApplyJacobian,
    /// Product of the Hessian, weighted by a sensitivity, and a direction of the inputs.
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

    /// URL path of the endpoint.
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
