"""Long records for timing: the closed-form creep of the Lethersich law under ± steps, 4 µm of white noise. Writes an experiment directory each."""

import math
import pathlib
import random
import sys

E_PA, C1_PA_S, C2_PA_S, FORCE_N, PER_M = 3.527, 1.402, 47.370, 4.6e-6, 1.820902396e-3
TOML = """[specimen]
id = "{name}"
[robot]
shape = "sphere"
diameter_mm = 0.55
density_kg_m3 = 7500
[vitreous]
diameter_mm = 20.0
poisson_ratio = 0.48
density_kg_m3 = 1000
[measurement]
file = "trajectory.csv"
calibration_cycles = [1]
noise_um = 4.0
source = "synthetic, for timing"
"""


def write(folder, n_rows, n_cycles, seed=1):
    """A record of as many rows in as many cycles: each pulls for its first half and pushes for its second."""
    noise = random.Random(seed)
    per_cycle = n_rows // n_cycles
    step_s = 10.0 / per_cycle
    elastic, flow, force, lines = 0.0, 0.0, 0.0, ["time_s,force_uN,position_um,cycle"]
    decay = math.exp(-E_PA * step_s / C1_PA_S)
    for row in range(n_rows):
        position = elastic + flow
        force = FORCE_N if row % per_cycle < per_cycle // 2 else -FORCE_N
        measured = 1e6 * position + (noise.gauss(0.0, 4.0) if row else 0.0)
        lines.append(f"{row * step_s:.9g},{1e6 * force:.6g},{measured:.4f},{1 + row // per_cycle}")
        target = force / (PER_M * E_PA)
        elastic = target + (elastic - target) * decay
        flow += force / (PER_M * C2_PA_S) * step_s
    folder.mkdir(parents=True)
    (folder / "experiment.toml").write_text(TOML.format(name=folder.name), encoding="utf-8")
    (folder / "trajectory.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


place = pathlib.Path(sys.argv[1])
for rows, cycles in [(800, 4), (10_000, 4), (10_000, 200), (30_000, 100), (100_000, 100), (200_000, 4)]:
    write(place / f"rows-{rows}-cycles-{cycles}", rows, cycles)
