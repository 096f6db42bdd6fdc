"""Writes experiments of an instrument: two cycles of ±1 µN by the closed form, each specimen's law and noise its own, from one seed."""

import math
import pathlib
import random
import sys

COMPLIANCE_PER_M, STEP_S, ROWS = 549.0, 0.04, 200
TOML = """[specimen]
id = "{id}"
species = "{species}"
[instrument]
compliance_per_m = 549.0
[measurement]
file = "trajectory.csv"
calibration_cycles = [1]
heldout_cycles = [2]
noise_um = 0.5
source = "synthetic: closed form"
"""


def trajectory(own):
    """Rows of one specimen."""
    young, viscosity_1, viscosity_2 = (mean * math.exp(own.gauss(0, 0.2)) for mean in (3.5, 1.4, 47.0))
    decay = math.exp(-STEP_S * young / viscosity_1)
    retarded, impulse = 0.0, 0.0
    for row in range(ROWS):
        force = 1.0 if row // 50 % 2 == 0 else -1.0
        position = COMPLIANCE_PER_M * (retarded / young + impulse / viscosity_2) + own.gauss(0, 0.5)
        yield f"{STEP_S * row:.2f},{force},{position:.4f},{1 + row // 100}"
        retarded = decay * retarded + (1 - decay) * force
        impulse += STEP_S * force


def main():
    count, folder = int(sys.argv[1]), pathlib.Path(sys.argv[2])
    for number in range(count):
        own = random.Random(24_000_000 + number)
        place = folder / f"specimen-{number:05}"
        place.mkdir(parents=True, exist_ok=True)
        species = ("bovine", "human", "porcine")[number % 3]
        (place / "experiment.toml").write_text(TOML.format(id=place.name, species=species), encoding="utf-8")
        rows = ["time_s,force_uN,position_um,cycle", *trajectory(own)]
        (place / "trajectory.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")


main()
