"""The posterior for PyMC: an operation of PyTensor with its gradient. Needs PyMC (``pip install 'vitreo-uq[pymc]'``)."""

from typing import Any

import numpy as np

from vitreo_uq._native import ReducedModel
from vitreo_uq.errors import Error

try:
    import pytensor.tensor as pt
    from pytensor.graph.basic import Apply
    from pytensor.graph.op import Op
except ImportError:
    raise Error("PyTensor is not installed\n  what to do: pip install 'vitreo-uq[pymc]'") from None


class _Gradient(Op):  # type: ignore[misc, unused-ignore]
    itypes = [pt.dvector]
    otypes = [pt.dvector]

    def __init__(self, model: ReducedModel) -> None:
        self.model = model

    def perform(self, node: "Apply[Any]", inputs: Any, outputs: Any) -> None:
        outputs[0][0] = self.model.log_density_gradient(inputs[0])


class _LogDensity(Op):  # type: ignore[misc, unused-ignore]
    itypes = [pt.dvector]
    otypes = [pt.dscalar]

    def __init__(self, model: ReducedModel) -> None:
        self.model = model
        self.gradient = _Gradient(model)

    def perform(self, node: "Apply[Any]", inputs: Any, outputs: Any) -> None:
        outputs[0][0] = np.asarray(self.model.log_density(inputs[0]))

    def grad(self, inputs: Any, output_gradients: Any) -> list[Any]:
        return [output_gradients[0] * self.gradient(inputs[0])]

    # Newer name of `grad`.
    def pullback(self, inputs: Any, outputs: Any, cotangents: Any) -> list[Any]:
        return self.grad(inputs, cotangents)


def log_density_op(model: ReducedModel) -> Any:
    """ln(prior × likelihood) as an operation with a gradient. It maps a vector of the model's `names`, in their units, to a number."""
    return _LogDensity(model)
