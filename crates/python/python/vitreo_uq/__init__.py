"""vitreo-uq in Python: experiments and reduced models as arrays, and the program's commands as functions.

Units are those of the documents: parameters as their names say (``young_modulus_pa``), positions of a model in µm, an experiment in SI.
"""

from vitreo_uq._native import Experiment, ReducedModel, __version__
from vitreo_uq.errors import Error, InputError, NotTrusted
from vitreo_uq.program import diagnose, run, sample
from vitreo_uq.study import read_study

__all__ = ["Error", "Experiment", "InputError", "NotTrusted", "ReducedModel", "__version__", "diagnose", "read_study", "run", "sample"]
