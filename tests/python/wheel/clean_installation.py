"""Installation of the wheel with NumPy alone: the program, the module, and errors that name missing packages."""

import subprocess
import sysconfig
from pathlib import Path

import vitreo_uq


def main():
    said = subprocess.run(["vitreo-uq", "--version"], capture_output=True, text=True, check=True).stdout.split()
    assert said[1] == vitreo_uq.__version__, said
    assert Path(vitreo_uq.program.program()).parent == Path(sysconfig.get_path("scripts"))
    replica = vitreo_uq.Experiment.replica()
    assert len(replica) == 800 == len(replica.time_s) == len(replica.cycle)
    Path("study/m0").mkdir(parents=True)
    for file in ("study/inputs.sha256", "study/m0/posterior.nc"):
        Path(file).touch()
    for ask, name in ((lambda: vitreo_uq.read_study("study"), "ArviZ"), (lambda: __import__("vitreo_uq.pymc"), "PyTensor")):
        try:
            ask()
        except vitreo_uq.Error as error:
            assert name in str(error) and "pip install" in str(error), error
        else:
            raise AssertionError(f"{name} is said to be there")
    print(f"vitreo-uq {said[1]}: program and module from the wheel alone")


if __name__ == "__main__":
    main()
