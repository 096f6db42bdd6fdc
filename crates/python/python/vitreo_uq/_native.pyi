import os
from collections.abc import Mapping, Sequence
from typing import TypedDict

import numpy as np
import numpy.typing as npt

__version__: str

class Parameter(TypedDict):
    """A sampled parameter; the density is 0 outside `lower` to `upper`, in `unit`."""

    name: str
    unit: str
    prior: str
    lower: float
    upper: float

class Experiment:
    """Measured force and position over time, in SI units. Arrays have one entry per row; each access makes a new array."""

    @staticmethod
    def read(path: str | os.PathLike[str]) -> Experiment:
        """Reads a directory with `experiment.toml`, the path of the TOML, or a study. Raises `InputError`."""
    @staticmethod
    def replica() -> Experiment:
        """The synthetic experiment that is embedded in the program."""
    @property
    def path(self) -> str | os.PathLike[str] | None:
        """Path of the experiment; None for the replica."""
    @property
    def label(self) -> str:
        """The specimen's identifier."""
    @property
    def species(self) -> str | None: ...
    @property
    def region(self) -> str | None: ...
    @property
    def source(self) -> str:
        """Origin of the data, as the experiment states it."""
    @property
    def time_s(self) -> npt.NDArray[np.float64]:
        """Times in s, shape (rows,)."""
    @property
    def force_n(self) -> npt.NDArray[np.float64]:
        """Commanded force in N, shape (rows,)."""
    @property
    def position_m(self) -> npt.NDArray[np.float64]:
        """Position in m, shape (rows,); NaN if it is missing."""
    @property
    def cycle(self) -> npt.NDArray[np.uint32]:
        """Cycle of each row, from 1, shape (rows,)."""
    @property
    def calibration_cycles(self) -> list[int]:
        """Cycles that the base model is fitted to."""
    @property
    def heldout_cycles(self) -> list[int]:
        """Held-out cycles, which no fit of the base model uses."""
    @property
    def noise_um(self) -> float | None:
        """Known noise standard deviation of the tracker in µm, if it is stated."""
    @property
    def notes(self) -> list[str]:
        """Remarks from reading the files, for example on how cycles were found or which positions are missing."""
    def __len__(self) -> int: ...

class ReducedModel:
    """Reduced model of an experiment or of a study's revision (by default the last).

    `base`, `effects`, `noise`, `prior` and `fixed` are the program's `--base`, `--with`, `--noise`, `--prior` and `--set`; a value None in
    `fixed` frees a fixed parameter. `fixed` values are in the parameter's unit.
    """

    def __init__(
        self,
        target: Experiment | str | os.PathLike[str],
        *,
        base: str | None = None,
        effects: Sequence[str] = (),
        noise: Sequence[str] = (),
        prior: str | os.PathLike[str] | None = None,
        fixed: Mapping[str, float | None] = ...,
        revision: str | None = None,
    ) -> None: ...
    @property
    def parameters(self) -> list[Parameter]:
        """The sampled parameters, in order: first those of the model, then those of the noise. Fixed parameters are omitted."""
    @property
    def names(self) -> list[str]:
        """Names of the sampled parameters, in order."""
    @property
    def prior_median(self) -> npt.NDArray[np.float64]:
        """Medians of the priors, shape (parameters,). They lie inside the parameters' ranges, so they can serve as a start point."""
    @property
    def n_trajectory_parameters(self) -> int:
        """Number of parameters that `trajectory` takes: the first names in `names`, without the parameters of the noise."""
    @property
    def max_relative_error(self) -> float | None:
        """Largest distance from full finite elements, relative to the amplitude; None for an instrument."""
    def trajectory(self, points: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Positions in µm at the record's rows: (n, d) gives (n, rows), (d,) gives (rows,). Raises `InputError` outside a parameter's range."""
    def log_density(self, points: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """ln(prior × likelihood) over the untransformed parameters: (n, d) gives (n,), (d,) gives (). The value is −inf outside a parameter's range."""
    def log_density_gradient(self, points: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Gradient of `log_density`, per unit of each parameter: (n, d) gives (n, d), (d,) gives (d,); 0 if the density is 0."""
