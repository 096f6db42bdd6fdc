#!/usr/bin/env python3
"""Plays `design --after` for records with a hidden effect, until the records tell the equivalent effects apart."""

import json
import pathlib
import random
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "designs"))
import hidden

MOST_RECORDS = 10


def filled(table, values):
    """Lines of a table whose third column has the given values."""
    head, *rows = table.splitlines()
    rows = [row.split(",") for row in rows]
    return "\n".join([head, *(",".join([*row[:2], value, *row[3:]]) for row, value in zip(rows, values, strict=True))]) + "\n"


def case(program, number, seed):
    stream = random.Random(f"{seed} {number}")
    with tempfile.TemporaryDirectory() as place:
        folder = pathlib.Path(place)
        vitreo = hidden.runner(program, folder, number)
        made = [program, "challenge", "new", "--out", "record", "--strength", "10", "--seed", str(1000 * seed + number), "--quiet"]
        subprocess.run(made, cwd=folder, check=True, capture_output=True)
        verdict = vitreo("diagnose", "record", "--out", "study", "--no-report")["verdict"]
        opened = [program, "challenge", "reveal", "record", "--study", "study", "--quiet", "--json", "-"]
        truth = json.loads(subprocess.run(opened, cwd=folder, check=False, capture_output=True).stdout)["play"]["truth"]
        if len(truth["effects"]) != 1:
            return {"hidden": None, "class": [], "records": []}
        (effect,) = truth["effects"]
        found = {"hidden": effect["slug"], "class": [*verdict["effects"], *verdict["equivalent"]], "records": []}
        if verdict["kind"] != "missing" or len(verdict["effects"]) > 1 or effect["slug"] not in found["class"] or not verdict["equivalent"]:
            return found
        parameters = [*zip(hidden.MEANS, truth["law"], strict=True), *((own["name"], own["value"]) for own in effect["parameters"])]
        values = [word for name, value in parameters for word in ("--set", f"{name}={value!r}")]
        after = []
        while True:
            design = vitreo("design", "study", "--no-report", *after)
            models = design.get("models", [])
            likeliest = max(models, key=lambda model: model["probability"], default=None)
            found["records"].append({
                "likeliest": likeliest and likeliest["effects"],
                "probability": likeliest and likeliest["probability"],
                "separation_sigma": design["recommended"]["separation_sigma"],
                "warnings": [warning["text"] for warning in design["warnings"]],
            })
            found["decided"] = bool(after) and design["goal"] == "parameters"
            if found["decided"] or len(found["records"]) > MOST_RECORDS:
                return found
            record = folder / design["recommended"]["record_dir"]
            table = (record / "trajectory.csv").read_text(encoding="utf-8")
            n_rows = len(table.splitlines()) - 1
            (record / "trajectory.csv").write_text(filled(table, ["0"] * n_rows), encoding="utf-8")
            vitreo("simulate", record, "--out", f"truth-{len(after)}", "--with", effect["slug"], *values)
            clean = (folder / f"truth-{len(after)}/simulation/trajectory.csv").read_text(encoding="utf-8").splitlines()[1:]
            noisy = [f"{float(line.split(',')[2]) + hidden.NOISE_UM * stream.gauss(0, 1):.4f}" for line in clean]
            (record / "trajectory.csv").write_text(filled(table, noisy), encoding="utf-8")
            after += ["--after", record]


if __name__ == "__main__":
    hidden.main(case, __doc__)
