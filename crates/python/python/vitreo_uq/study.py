"""Draws of a study for ArviZ."""

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vitreo_uq.errors import Error, InputError

if TYPE_CHECKING:
    import arviz
    import xarray

GROUPS = ("posterior", "sample_stats", "log_likelihood", "observed_data")


def read_study(path: str | os.PathLike[str], revision: str | None = None) -> "arviz.InferenceData | xarray.DataTree":
    """Returns the draws of a study's revision (by default the last) from ``posterior.nc``.

    ``posterior`` has one variable per parameter, shape (chain, draw), in the unit of its name; a chain is an independent ensemble. ``observed_data`` and
    ``posterior_predictive`` are positions in µm, one per row. ArviZ 0.x returns its ``InferenceData``, ArviZ 1 an ``xarray.DataTree`` of the same groups. Raises `InputError` if there is no such revision, `Error` without ArviZ.
    """
    study = Path(path)
    if not (study / "inputs.sha256").is_file():
        raise InputError(f"{study}: this is not a study: it holds no inputs.sha256\n  what to do: give the directory that `sample` made")
    numbers = sorted(int(own.name[1:]) for own in study.iterdir() if re.fullmatch(r"m\d+", own.name) and own.is_dir())
    known = [f"m{number}" for number in numbers]
    if not known:
        raise InputError(f"{study}: the study has no revision yet\n  what to do: run `sample` first")
    name = known[-1] if revision is None else revision
    if name not in known:
        raise InputError(f"{study}: the study has no revision {name!r}\n  what to do: use one of {', '.join(known)}")
    file = study / name / "posterior.nc"
    if not file.is_file():
        raise InputError(f"{file}: there are no draws\n  what to do: sample again; records over frequency have none")
    try:
        import arviz
    except ImportError:
        raise Error("ArviZ is not installed\n  what to do: pip install 'vitreo-uq[arviz]'") from None
    data: Any = arviz.from_netcdf(str(file))  # type: ignore[no-untyped-call, unused-ignore]
    missing = [group for group in GROUPS if not hasattr(data, group)]
    if missing:
        raise InputError(f"{file}: the groups {', '.join(missing)} are missing\n  what to do: sample again with this version")
    return data  # type: ignore[no-any-return, unused-ignore]
