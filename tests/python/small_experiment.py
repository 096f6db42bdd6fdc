"""A small experiment on an instrument, which needs no finite elements, and a function that runs the program. The checks beside it import this file."""

import math
import os
import pathlib
import random
import subprocess

ROOT = pathlib.Path(__file__).resolve().parents[2]
COMPLIANCE_PER_M = 549.178
FORCE_N = 4.6e-6


def creep(time_s, factor):
    """Creep of the Lethersich law, in 1/Pa."""
    return ((1 - math.exp(-3.527 * time_s / 1.402)) / 3.527 + time_s / 47.37) / factor if time_s > 0 else 0.0


def write(folder, name, species="porcine", factor=1.0, seed=1, cycles=4, rows_a_hold=25):
    """Cycles of 5 s at +F and 5 s at -F with 4 µm of noise."""
    rng = random.Random(seed)
    interval = 5.0 / rows_a_hold
    lines = ["time_s,force_uN,position_um,cycle"]
    for row in range(2 * cycles * rows_a_hold):
        time, hold = interval * row, row // rows_a_hold
        steps = ((5.0 * h, 1.0 if h == 0 else 2.0 * (-1) ** h) for h in range(hold + 1))
        position = sum(step * FORCE_N * COMPLIANCE_PER_M * creep(time - start, factor) for start, step in steps)
        lines.append(f"{time:.6f},{1e6 * FORCE_N * (-1) ** hold:.1f},{1e6 * position + rng.gauss(0, 4):.4f},{1 + hold // 2}")
    place = pathlib.Path(folder) / name
    place.mkdir(parents=True)
    (place / "trajectory.csv").write_text("\n".join(lines) + "\n")
    (place / "experiment.toml").write_text(
        f'[specimen]\nid = "{name}"\nspecies = "{species}"\n[instrument]\ncompliance_per_m = {COMPLIANCE_PER_M}\n'
        '[measurement]\nfile = "trajectory.csv"\nnoise_um = 4.0\nsource = "synthetic: closed form"\n'
    )
    return place


def write_sweep(folder, name, seed=1):
    """Storage and loss modulus of the same law at 25 frequencies with errors of 2 %."""
    rng = random.Random(seed)
    lines = ["frequency_hz,storage_pa,loss_pa"]
    for k in range(25):
        frequency = 0.02 * 1000 ** (k / 24)
        omega = 2 * math.pi * frequency
        modulus = 1 / (1 / (3.527 + 1j * omega * 1.402) + 1 / (1j * omega * 47.37)) / 3
        parts = (part + 0.02 * abs(modulus) * rng.gauss(0, 1) for part in (modulus.real, modulus.imag))
        lines.append(",".join(f"{number:.6g}" for number in (frequency, *parts)))
    place = pathlib.Path(folder) / name
    place.mkdir(parents=True)
    (place / "sweep.csv").write_text("\n".join(lines) + "\n")
    (place / "experiment.toml").write_text(f'[specimen]\nid = "{name}"\n[measurement]\nkind = "oscillation"\nfile = "sweep.csv"\n')


def run(folder, *arguments):
    """Runs the program in a folder; exit codes 0 and 1 both mean that it wrote its documents."""
    program = os.environ.get("VITREO_UQ")
    command = [program] if program else ["cargo", "run", "--quiet", "--manifest-path", str(ROOT / "Cargo.toml"), "--bin", "vitreo-uq", "--"]
    done = subprocess.run([*command, *map(str, arguments)], cwd=folder, capture_output=True, text=True)
    assert done.returncode in (0, 1), f"{arguments}: exit code {done.returncode}\n{done.stderr}"
    return done.stdout
