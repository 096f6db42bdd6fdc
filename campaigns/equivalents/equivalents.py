#!/usr/bin/env python3
"""Counts how often `predict` names that an answer depends on which of several equivalent effects is true.

The judge is independent of the warning: every rival effect gets a study of its own (`extend`, `predict`), and its 90 % intervals are compared with those of the claimed effect.
"""

import pathlib
import shutil
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "designs"))
import hidden

# Number of rivals of a record that get a study of their own.
MOST_RIVALS = 2
BEAD = """[scenario.robot]
shape = "sphere"
diameter_mm = 0.55
[scenario.vitreous]
diameter_mm = 20
poisson_ratio = 0.48
"""
# Short alternating pulls, a long hold with a rest, three times the force, and another robot.
SCENARIOS = [
    ("pulses", "{ steps_un = [[0, 4.6], [0.4, -4.6], [0.8, 4.6], [1.2, -4.6], [1.6, 0]] }", BEAD, [0.4, 1.2, 2]),
    ("long hold", "{ steps_un = [[0, 4.6], [60, 0]] }", BEAD, [10, 60, 90]),
    ("strong force", "{ steps_un = [[0, 13.8], [5, 0]] }", BEAD, [1, 5, 10]),
    ("large bead", "{ steps_un = [[0, 9.2], [5, -9.2]] }", BEAD.replace("0.55", "1.5"), [1, 5, 10]),
]


def scenarios():
    text = ""
    for name, force, apparatus, times_s in SCENARIOS:
        text += f'[[scenario]]\nname = "{name}"\nforce = {force}\n{apparatus}'
        text += "".join(f'[[scenario.quantity]]\nkind = "position_at"\nat_s = {at_s}\n' for at_s in times_s)
    return text


def separation(quantities, others):
    """Whether 90 % intervals of a quantity lie apart, and whether all medians agree within half of the narrower half-width."""
    apart, alike = False, True
    for one, other in zip(quantities, others):
        apart |= one["q95"] < other["q05"] or other["q95"] < one["q05"]
        half = 0.5 * min(q["q95"] - q["q05"] for q in (one, other))
        alike &= abs(one["median"] - other["median"]) < 0.5 * half
    return "apart" if apart else "alike" if alike else "between"


def case(program, number, seed):
    with tempfile.TemporaryDirectory() as place:
        folder = pathlib.Path(place)
        vitreo = hidden.runner(program, folder, number)
        made = [program, "challenge", "new", "--out", "record", "--seed", str(1000 * seed + number), "--quiet"]
        subprocess.run(made, cwd=folder, check=True, capture_output=True)
        verdict = vitreo("diagnose", "record", "--out", "study", "--no-report")["verdict"]
        claimed, rivals = verdict["effects"], verdict["equivalent"]
        found = {"claimed": claimed, "rivals": rivals, "compared": [], "refused": []}
        if verdict["kind"] != "missing" or not rivals:
            return found
        (folder / "scenarios.toml").write_text(scenarios(), encoding="utf-8")

        def predicted(study, effects):
            shutil.copytree(folder / "study", folder / study)
            vitreo("extend", study, "--with", ",".join(effects), "--no-report")
            return vitreo("predict", study, "--scenario", "scenarios.toml", "--no-report")

        try:
            own = predicted("own", claimed)
        except SystemExit as refusal:
            return found | {"refused": [str(refusal)]}
        named = {(entry["scenario"], entry["effect"]): entry["disagrees"] for entry in own["equivalent"]}
        for rival in rivals[:MOST_RIVALS]:
            try:
                other = predicted(f"rival-{rival}", [rival])
            except SystemExit as refusal:
                found["refused"].append(str(refusal))
                continue
            for one, two in zip(own["scenarios"], other["scenarios"]):
                where = (one["name"], rival)
                found["compared"].append({
                    "scenario": one["name"],
                    "rival": rival,
                    "judged": separation(one["quantities"], two["quantities"]),
                    "named": named.get(where),
                })
    return found


if __name__ == "__main__":
    hidden.main(case, __doc__)
