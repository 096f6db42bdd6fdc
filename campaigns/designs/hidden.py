#!/usr/bin/env python3
"""Plays the loop of docs/design.md for hidden gels: a first record, its posterior, a designed protocol, the designed record, and the posterior of both."""

import argparse
import csv
import json
import math
import pathlib
import random
import subprocess
import tempfile

# Displacement per force at unit creep compliance of the replica's bead in 1/m (docs/physics.md, §3).
COMPLIANCE_PER_M = 549.178
NOISE_UM = 4.0
# Range of each parameter: the porcine means of the paper, and factors about them.
MEANS = {"young_modulus_pa": 3.5, "viscosity_1_pa_s": 1.4, "viscosity_2_pa_s": 47.0}
FACTOR = 1.5
DESCRIPTION = """[specimen]
id = "hidden"
[robot]
shape = "sphere"
diameter_mm = 0.55
[vitreous]
diameter_mm = 20
poisson_ratio = 0.48
[measurement]
file = "trajectory.csv"
noise_um = 4
calibration_cycles = [1, 2, 3]
heldout_cycles = [4]
source = "synthetic: closed form of the law"
"""


def creep_um_per_un(truth, time_s):
    """Displacement in µm under 1 µN since time 0."""
    modulus, first, second = truth.values()
    return COMPLIANCE_PER_M * (-math.expm1(-modulus * time_s / first) / modulus + time_s / second)


def positions_um(truth, time_s, force_un):
    """Positions under a force that holds from row to row."""
    before = [0.0, *force_un[:-1]]
    changes = [(t, f - old) for t, f, old in zip(time_s, force_un, before) if f != old]
    return [sum(step * creep_um_per_un(truth, t - since) for since, step in changes if t > since) for t in time_s]


def ramps_um(truth, time_s, force_un, parts=20):
    """Positions under a force that is linear between rows, as many small steps."""
    fine_t, fine_f = [], []
    for k in range(len(time_s) - 1):
        for part in range(parts):
            share = (part + 0.5) / parts
            fine_t.append(time_s[k] + part / parts * (time_s[k + 1] - time_s[k]))
            fine_f.append(force_un[k] + share * (force_un[k + 1] - force_un[k]))
    before = [0.0, *fine_f[:-1]]
    changes = [(t, f - old) for t, f, old in zip(fine_t, fine_f, before) if f != old]
    return [sum(step * creep_um_per_un(truth, t - since) for since, step in changes if t > since) for t in time_s]


def first_protocol():
    """Rows of time (s), force (µN) and cycle: four cycles of 5 s in each direction, as in the paper."""
    return [(0.05 * k, 4.6 if 0.05 * k % 10 < 5 - 1e-9 else -4.6, 1 + min(3, k // 200)) for k in range(801)]


def write_table(path, rows, clean_um, stream):
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file)
        table.writerow(["time_s", "force_uN", "position_um", "cycle"])
        for (time_s, force_un, cycle), x in zip(rows, clean_um):
            table.writerow([f"{time_s:.6f}", f"{force_un:.6f}", f"{x + NOISE_UM * stream.gauss(0, 1):.4f}", cycle])


def runner(program, folder, number):
    """A function that runs a command in a folder and returns its document. Exit code 1 (not to be trusted) is a result."""

    def vitreo(*arguments):
        command = [program, *map(str, arguments), "--seed", str(number + 1), "--quiet", "--json", "-"]
        done = subprocess.run(command, cwd=folder, check=False, capture_output=True, text=True)
        if done.returncode not in (0, 1):
            raise SystemExit(f"{' '.join(command)}: {done.stderr}")
        return json.loads(done.stdout)

    return vitreo


def case(program, number, seed):
    stream = random.Random(f"{seed} {number}")
    truth = {name: mean * FACTOR ** stream.uniform(-1, 1) for name, mean in MEANS.items()}
    with tempfile.TemporaryDirectory() as place:
        folder = pathlib.Path(place)
        vitreo = runner(program, folder, number)
        eye = folder / "eye"
        eye.mkdir()
        (eye / "experiment.toml").write_text(DESCRIPTION, encoding="utf-8")
        rows = first_protocol()
        write_table(eye / "trajectory.csv", rows, positions_um(truth, [r[0] for r in rows], [r[1] for r in rows]), stream)
        vitreo("sample", "eye", "--out", "study", "--no-report")
        design = vitreo("design", "study", "--no-report")
        following = folder / "study/next-record"
        with (following / "trajectory.csv").open(encoding="utf-8") as file:
            rows = [(float(row["time_s"]), float(row["force_uN"]), row["cycle"]) for row in csv.DictReader(file)]
        is_held = 'force = "hold"' in (following / "experiment.toml").read_text(encoding="utf-8")
        moved = positions_um if is_held else ramps_um
        write_table(following / "trajectory.csv", rows, moved(truth, [r[0] for r in rows], [r[1] for r in rows]), stream)
        both = vitreo("sample", "eye", following, "--out", "both", "--no-report")
    realised = {own["name"]: own for own in both["parameters"]}
    parameters = []
    for expected in design["recommended"]["parameters"]:
        name = expected["name"]
        if name in truth:
            found = realised[name]
            parameters.append({
                "name": name,
                "now": expected["sd_now"],
                "expected": expected["sd_expected"],
                "realised": found["sd"],
                "error_over_sd": (found["mean"] - truth[name]) / found["sd"],
            })
    return {"converged": both["converged"], "protocol": design["recommended"]["protocol"], "parameters": parameters}


def main(case, description):
    """Plays the cases that the command line asks for, and writes their results as one document."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("program")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=1)
    parser.add_argument("--json", type=pathlib.Path)
    arguments = parser.parse_args()
    cases = [case(arguments.program, number, arguments.seed) for number in range(arguments.first, arguments.first + arguments.count)]
    for found in cases:
        print(found)
    if arguments.json:
        arguments.json.write_text(json.dumps(cases, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(case, __doc__)
