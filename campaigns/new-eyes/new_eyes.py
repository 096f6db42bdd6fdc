#!/usr/bin/env python3
"""Counts how often the motion of a robot in a new eye lies inside the band that a comparison of groups predicts: eyes of a synthetic species scatter about its mean.

The truth is the closed form of the law, so that no solver of the program makes the data.
"""

import math
import pathlib
import random
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "designs"))
import hidden

# Standard deviation of the logarithm of each parameter within the species.
SCATTER = {"young_modulus_pa": 0.25, "viscosity_1_pa_s": 0.3, "viscosity_2_pa_s": 0.35}
N_EYES = 12
N_NEW = 10
SCENARIO = """[[scenario]]
name = "bead"
force = { steps_un = [[0, 3], [4, -1.5]] }
[scenario.robot]
shape = "sphere"
diameter_mm = 0.55
[scenario.vitreous]
diameter_mm = 20
poisson_ratio = 0.48
[[scenario.quantity]]
kind = "position_at"
at_s = 4
[[scenario.quantity]]
kind = "position_at"
at_s = 8
"""


def species(stream):
    """Mean of a species and its eyes' parameters."""
    mean = {name: value * hidden.FACTOR ** stream.uniform(-1, 1) for name, value in hidden.MEANS.items()}

    def eye():
        # The parameters are those of the mean times a log-normal factor each.
        return {name: value * math.exp(SCATTER[name] * stream.gauss(0, 1)) for name, value in mean.items()}

    return eye


def case(program, number, seed):
    stream = random.Random(f"{seed} {number}")
    eye = species(stream)
    with tempfile.TemporaryDirectory() as place:
        folder = pathlib.Path(place)
        for k in range(N_EYES):
            own = folder / f"cohort/eye-{k}"
            own.mkdir(parents=True)
            text = hidden.DESCRIPTION.replace('id = "hidden"', f'id = "eye-{k}"\nspecies = "synthetic"')
            (own / "experiment.toml").write_text(text, encoding="utf-8")
            rows = hidden.first_protocol()
            truth = eye()
            clean = hidden.positions_um(truth, [row[0] for row in rows], [row[1] for row in rows])
            hidden.write_table(own / "trajectory.csv", rows, clean, stream)
        (folder / "bead.toml").write_text(SCENARIO, encoding="utf-8")
        vitreo = hidden.runner(program, folder, number)
        vitreo("groups", "cohort", "--by", "species", "--out", "eyes")
        where = "eyes/species" if (folder / "eyes/species").is_dir() else "eyes"
        found = vitreo("predict", where, "--new-eye", "synthetic", "--scenario", "bead.toml")
    bands = [[quantity["q05"], quantity["q95"]] for quantity in found["scenarios"][0]["quantities"]]
    inside = []
    for _ in range(N_NEW):
        truth = eye()
        moved = hidden.positions_um(truth, [0.0, 4.0, 8.0], [3.0, -1.5, -1.5])
        inside.append([low <= x <= high for (low, high), x in zip(bands, moved[1:])])
    return {"inside": inside, "bands_um": bands}


if __name__ == "__main__":
    hidden.main(case, __doc__)
