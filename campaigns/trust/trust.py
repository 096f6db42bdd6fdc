#!/usr/bin/env python3
"""Counts trusted posteriors whose law is wrong by a misfit below the noise, and clean records that are told of a pattern.

The truths are closed forms. The size of a misfit is its distance, in standard deviations of the noise, from the nearest position that the law can take.
"""

import math
import pathlib
import random
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "designs"))
import hidden

DESCRIPTION = """[specimen]
id = "hidden"
[instrument]
compliance_per_m = 549.178
[measurement]
file = "trajectory.csv"
noise_um = 4
source = "synthetic: closed form"
"""
# Noise beside or in place of the white noise of 4 µm: its terms in `sample`.
CLEAN = {"white": "white", "slow": "white,ou", "gains": "white,gain", "rounded": "white"}
SLOW_UM, SLOW_S, GAIN, OFFSET_UM, STEP_UM = 3.0, 1.0, 0.01, 8.0, 4.0
SIGMAS = (5, 10)
# Relative change of a parameter in a difference quotient.
DIFFERENCE = 1e-4


def retarded(truth, rows, clean_um):
    """Motion of a second retarded body of 4 s."""
    second = truth | {"viscosity_1_pa_s": 4.0 * truth["young_modulus_pa"], "viscosity_2_pa_s": math.inf}
    return positions_um(second, rows)


def jumped(truth, rows, clean_um):
    """An answer at once, in proportion to the force before each row."""
    return [0.0, *[force for _, force, _ in rows[:-1]]]


def delayed(truth, rows, clean_um):
    """Change of the position by a small delay of the force."""
    moved = [(rows[k][0], rows[k][1], rows[k][2]) for k in range(len(rows))]
    late = hidden.positions_um(truth, [max(0.0, t - 1e-3) for t, _, _ in moved], [force for _, force, _ in moved])
    return [a - b for a, b in zip(late, clean_um)]


def saturated(truth, rows, clean_um):
    """A scale that shrinks with the square of the position."""
    return [-(x**3) for x in clean_um]


MISFITS = {"second-retardation": retarded, "instantaneous": jumped, "delay": delayed, "saturation": saturated}
KINDS = [(kind, 0) for kind in CLEAN] + [(kind, sigma) for sigma in SIGMAS for kind in MISFITS]


def positions_um(truth, rows):
    return hidden.positions_um(truth, [t for t, _, _ in rows], [force for _, force, _ in rows])


def beside_law(change_um, truth, rows, clean_um):
    """The part of a change that no small change of the law's parameters makes."""
    left, basis = change_um, []
    for name in truth:
        moved = positions_um(truth | {name: truth[name] * (1 + DIFFERENCE)}, rows)
        column = [a - b for a, b in zip(moved, clean_um)]
        for direction in basis:
            column = without(column, direction)
        length = math.hypot(*column)
        basis.append([x / length for x in column])
    for direction in basis:
        left = without(left, direction)
    return left


def without(values, direction):
    along = sum(a * b for a, b in zip(values, direction))
    return [a - along * b for a, b in zip(values, direction)]


def noisy_um(kind, rows, clean_um, stream):
    """Positions with the noise that is added to the white noise of the table; rounding is that of the whole."""
    gains = {cycle: (1 + GAIN * stream.gauss(0, 1), OFFSET_UM * stream.gauss(0, 1)) for _, _, cycle in rows}
    slow, found = stream.gauss(0, 1), []
    for k, ((time_s, _, cycle), x) in enumerate(zip(rows, clean_um)):
        kept = math.exp(-(time_s - rows[max(k - 1, 0)][0]) / SLOW_S)
        slow = kept * slow + math.sqrt(1 - kept * kept) * stream.gauss(0, 1)
        if kind == "slow":
            x += SLOW_UM * slow
        if kind == "gains":
            x = gains[cycle][0] * x + gains[cycle][1]
        found.append(x)
    return found


def case(program, number, seed):
    kind, sigma = KINDS[number % len(KINDS)]
    stream = random.Random(f"{seed} {number}")
    truth = {name: mean * hidden.FACTOR ** stream.uniform(-1, 1) for name, mean in hidden.MEANS.items()}
    rows = hidden.first_protocol()
    clean_um = positions_um(truth, rows)
    if sigma:
        change_um = MISFITS[kind](truth, rows, clean_um)
        size = sigma * hidden.NOISE_UM / math.hypot(*beside_law(change_um, truth, rows, clean_um))
        clean_um = [x + size * change for x, change in zip(clean_um, change_um)]
    written_um = noisy_um(kind, rows, clean_um, stream)
    with tempfile.TemporaryDirectory() as place:
        folder = pathlib.Path(place)
        (folder / "record").mkdir()
        text = DESCRIPTION + ("calibration_cycles = [1, 2, 3]\n" if kind == "gains" else "")
        (folder / "record/experiment.toml").write_text(text, encoding="utf-8")
        table = folder / "record/trajectory.csv"
        hidden.write_table(table, rows, written_um, stream)
        if kind == "rounded":
            lines = [line.split(",") for line in table.read_text(encoding="utf-8").splitlines()]
            for line in lines[1:]:
                line[2] = f"{STEP_UM * round(float(line[2]) / STEP_UM):g}"
            table.write_text("".join(",".join(line) + "\n" for line in lines), encoding="utf-8")
        vitreo = hidden.runner(program, folder, number)
        found = vitreo("sample", "record", "--noise", CLEAN.get(kind, "white"), "--out", "study", "--no-report")
    off = [abs(own["mean"] - truth[own["name"]]) / own["sd"] for own in found["parameters"] if own["name"] in truth]
    pattern = any(warning["kind"] == "residual_pattern" for warning in found["warnings"])
    return {"kind": kind, "sigma": sigma, "level": found["trust"]["level"], "pattern": pattern, "bias": max(off)}


if __name__ == "__main__":
    hidden.main(case, __doc__)
