//! Endpoints of the UM-Bridge protocol, which client and server share.

base::named_enum! {
    /// Endpoint of UM-Bridge to which a request is sent.
    pub enum Endpoint {
        /// Names of the available models.
        Info = "/Info",
        /// Capabilities of a model.
        ModelInfo = "/ModelInfo",
        /// Lengths of the model's input vectors.
        InputSizes = "/InputSizes",
        /// Lengths of the model's output vectors.
        OutputSizes = "/OutputSizes",
        /// Output vectors at given input vectors.
        Evaluate = "/Evaluate",
        /// Product of a sensitivity vector of the outputs and the Jacobian.
        Gradient = "/Gradient",
        /// Product of the Jacobian and a direction of the inputs.
        ApplyJacobian = "/ApplyJacobian",
        /// Product of the Hessian, weighted by a sensitivity, and a direction of the inputs.
        ApplyHessian = "/ApplyHessian",
    }
    /// URL path of the endpoint.
    pub fn path
}
