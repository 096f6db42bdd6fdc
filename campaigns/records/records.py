#!/usr/bin/env python3
"""Compares the program's base laws on measured records with six closed forms that least squares fits: both predict the last part of each record.

Records are read from ../shared/data beside the project and are not part of it. Needs NumPy.
"""

import argparse
import csv
import json
import pathlib
import re
import shutil
import subprocess

import numpy

HERE = pathlib.Path(__file__).resolve().parent
# Share of the rows of an unbroken hold that are fitted; the others are predicted.
FITTED = 0.7
# Largest number of rows of a fit by least squares.
MOST_ROWS = 1500


def table(path, columns, skip=1, delimiter="\t"):
    """Numbers of some columns, counted from 0, of the rows that have all of them."""
    rows = []
    with path.open(encoding="utf-8", errors="replace") as file:
        for line in list(file)[skip:]:
            cells = next(csv.reader([line], delimiter=delimiter), [])
            try:
                rows.append([float(cells[column]) for column in columns])
            except (ValueError, IndexError):
                continue
    return numpy.array(rows).T


def published(path, is_relaxation):
    """A table of a compliance or a modulus: the step is at time 0. Strains are shown in %."""
    time, value = table(path, [0, 1])
    return {"init": ["--unit-time", "s"], "time": time, "value": value * (1 if is_relaxation else 100), "drive": [(0.0, 1.0)], "is_relaxation": is_relaxation}


def muscle(path):
    """Stretch and stress (kPa) during a ramp and a hold."""
    time, stretch, stress = table(path, [0, 1, 2], delimiter=",")
    drive = list(zip(0.5 * (time[1:] + time[:-1]), numpy.diff(stretch)))
    told = ["--position", "L", "--force", "F", "--unit-time", "s", "--unit-force", "kPa", "--unit-position", "1", "--kind", "relaxation"]
    return {"init": told, "time": time, "value": 1000 * stress, "drive": drive, "is_relaxation": True}


def rheometer(path):
    """A creep in minutes and % of a TRIOS export, at 500 Pa."""
    text = path.read_text(encoding="utf-8", errors="replace").split("\n")
    head = next(k for k, line in enumerate(text) if line.split("\t")[:1] and "Strain" in line.split("\t") and "Time" in line.split("\t"))
    names = text[head].split("\t")
    time, strain = table(path, [names.index("Time"), names.index("Strain")], skip=head + 2)
    return {"init": [], "time": 60 * time, "value": strain, "drive": [(0.0, 500.0)], "is_relaxation": False}


def chromatin(folder):
    time, force, position = table(folder / "trajectory.csv", [0, 1, 2], delimiter=",")
    cycle = table(folder / "trajectory.csv", [0, 3], delimiter=",")
    at = dict(zip(cycle[0], cycle[1]))
    steps = [(time[0], force[0])] + [(time[k], force[k] - force[k - 1]) for k in range(1, len(time)) if abs(force[k] - force[k - 1]) > 0.1]
    return {"folder": folder, "time": time, "value": position, "drive": steps, "is_relaxation": False, "is_fitted": numpy.array([at[t] < 10 for t in time])}


def hold(path):
    """Two seconds of a hold of a force microscope are fitted, the third is predicted. The contact before the hold is a free offset."""
    time, height, segment = table(path, [0, 2, 3], delimiter=",")
    inside = (time >= 3.05) & (time < 6)
    return {"tip": path, "time": time[inside], "value": -height[inside], "drive": [(3.0, 1.0)], "is_relaxation": False, "is_fitted": time[inside] < 5, "has_offset": True}


def records(data):
    creep, relaxation, titin = data / "rheojax-creep", data / "rheojax-relaxation", data / "muscle-titin-relaxation"
    return {
        "gel, creep (TA rheometer)": (creep / "creep_experiment.txt", rheometer),
        "mucus, creep compliance": (creep / "creep_mucus_data.csv", lambda path: published(path, False)),
        "polystyrene melt, creep compliance": (creep / "creep_ps145_data.csv", lambda path: published(path, False)),
        "Laponite, relaxation modulus": (relaxation / "rel_lapo_1200.csv", lambda path: published(path, True)),
        "fish muscle, relaxation modulus": (relaxation / "stressrelaxation_fishmuscle_data.csv", lambda path: published(path, True)),
        "foam, relaxation modulus": (relaxation / "stressrelaxation_liquidfoam_data.csv", lambda path: published(path, True)),
        "heart muscle, ramp of 0.1 s": (titin / "AvgRelaxed_0.1s.csv", muscle),
        "heart muscle, ramp of 1 s": (titin / "AvgRelaxed_1s.csv", muscle),
        "heart muscle, ramp of 10 s": (titin / "AvgRelaxed_10s.csv", muscle),
        "heart muscle, ramp of 100 s": (titin / "AvgRelaxed_100s.csv", muscle),
        "chromatin, bead pulled (Keizer)": (data / "keizer-2022-cycles", chromatin),
        "polymer gel, hold (JPK)": (data / "afm-force-clamp/polymergel.csv", hold),
        "brain, hold (JPK)": (data / "afm-force-clamp/brain.csv", hold),
    }


def kernels(times, is_relaxation):
    """Closed forms of the response to a unit step: name and columns whose amplitudes are free, for every value of the other parameters on a grid."""
    low, high = max(times[times > 0].min(), 1e-6 * times.max()), times.max()
    taus = numpy.geomspace(low / 3, 10 * high, 40)
    decay = lambda tau: lambda t: numpy.exp(-t / tau)
    rise = lambda tau: lambda t: -numpy.expm1(-t / tau)
    one = lambda t: numpy.ones_like(t)
    powers = numpy.linspace(0.01, 1.0, 60)
    exponential, sign = (decay, -1) if is_relaxation else (rise, 1)
    power = lambda n: lambda t: numpy.maximum(t, 1e-3 * low) ** (sign * n)
    yield "power law", [[power(n)] for n in powers]
    yield "power law and a constant", [[one, power(n)] for n in powers]
    yield "logarithm", [[one, lambda t, tau=tau: numpy.log1p(t / tau)] for tau in taus]
    yield "one exponential", [[one, exponential(tau)] for tau in taus]
    yield "two exponentials", [[one, exponential(a), exponential(b)] for k, a in enumerate(taus[::2]) for b in taus[::2][k + 1 :]]
    yield "stretched exponential", [[one, lambda t, tau=tau, b=b: numpy.exp(-((t / tau) ** b))] for tau in taus for b in (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8)]


def baselines(record):
    """Error of each closed form on the rows that it has not seen. Amplitudes by least squares, the other parameters on a grid."""
    time, value, fitted = record["time"], record["value"], record["is_fitted"]
    begin = record["drive"][0][0]
    lags = time - begin
    errors = {}
    for name, choices in kernels(lags, record["is_relaxation"]):
        best = (numpy.inf, None)
        for choice in choices:
            columns = []
            for function in choice:
                column = numpy.zeros_like(time)
                for at, step in record["drive"]:
                    since = time - at
                    column += numpy.where(since > 0, step * function(numpy.maximum(since, 0)), 0)
                columns.append(column)
            if record.get("has_offset"):
                columns.append(numpy.ones_like(time))
            matrix = numpy.stack(columns, axis=1)
            if not numpy.isfinite(matrix).all():
                continue
            amplitudes = numpy.linalg.lstsq(matrix[fitted], value[fitted], rcond=None)[0]
            left = value - matrix @ amplitudes
            square = float((left[fitted] ** 2).mean())
            if square < best[0]:
                best = (square, float(numpy.sqrt((left[~fitted] ** 2).mean())))
        errors[name] = best[1]
    return errors


def thinned(record):
    every = max(1, len(record["time"]) // MOST_ROWS)
    keep = numpy.arange(0, len(record["time"]), every)
    return {**record, **{key: record[key][keep] for key in ("time", "value", "is_fitted")}}


def described(program, path, record, folder):
    """Directory of the record's experiment, with the predicted rows as a cycle of their own."""
    if "folder" in record:
        return record["folder"]
    if "tip" in record:
        folder.mkdir()
        shutil.copyfile(path, folder / "force-clamp.csv")
        text = (HERE.parent / "indentations/experiment.toml").read_text(encoding="utf-8")
        cycles = "cycle_starts_s = [0, 3, 5]\ncalibration_cycles = [2]\nheldout_cycles = [3]"
        text = text.replace("RECORD", path.stem).replace("EXPONENT", "2").replace("cycle_starts_s = [0, 5]", cycles)
        (folder / "experiment.toml").write_text(text, encoding="utf-8")
        return folder
    done = subprocess.run([program, "init", path, "--out", folder, *record["init"], "--quiet"], check=False, capture_output=True, text=True, stdin=subprocess.DEVNULL)
    if done.returncode:
        raise SystemExit(f"{path}: {done.stderr}")
    description = folder / "experiment.toml"
    begin, split = record["time"][0], record["time"][~record["is_fitted"]][0]
    text = description.read_text(encoding="utf-8")
    lines = f"cycle_starts_s = [{min(0.0, begin):g}, {split - 1e-9:.9g}]\ncalibration_cycles = [1]\nheldout_cycles = [2]\n"
    text = re.sub(r"^# calibration_cycles.*\n", lines, text, flags=re.M)
    description.write_text(text, encoding="utf-8")
    return folder


def in_own_unit(row, key):
    """A quantity of a document, in the unit of its record: keys end in `_um`, `_percent` or `_pa`. Returns value and unit."""
    for unit in ("um", "percent", "pa", "un"):
        if row.get(f"{key}_{unit}") is not None:
            return row[f"{key}_{unit}"], unit
    return None, None


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("program")
    parser.add_argument("data", type=pathlib.Path)
    parser.add_argument("--work", type=pathlib.Path, required=True)
    parser.add_argument("--json", type=pathlib.Path, required=True)
    arguments = parser.parse_args()
    shutil.rmtree(arguments.work, ignore_errors=True)
    arguments.work.mkdir(parents=True)
    found = []
    for number, (name, (path, read)) in enumerate(records(arguments.data).items()):
        record = read(path)
        if "is_fitted" not in record:
            order = numpy.arange(len(record["time"]))
            record["is_fitted"] = order < FITTED * len(order)
        experiment = described(arguments.program, path, record, arguments.work / f"record-{number}")
        command = [arguments.program, "compare", experiment, "--laws", "--out", arguments.work / f"study-{number}", "--json", "-", "--quiet"]
        done = subprocess.run(command, check=False, capture_output=True, text=True)
        if done.returncode not in (0, 1):
            found.append({"record": name, "refused": done.stderr.strip().split("\n")[0]})
            print(name, "refused:", done.stderr.strip())
            continue
        document = json.loads(done.stdout)
        law = document["laws"][0]
        (error, unit), (noise, _) = in_own_unit(law, "rmse_heldout"), in_own_unit(document, "noise")
        errors = baselines(thinned(record))
        best = min(errors, key=errors.get)
        found.append({
            "record": name,
            "rows": len(record["time"]),
            "noise": noise,
            "unit": unit,
            "is_explained": document["is_explained"],
            "law": law["law"],
            "error": error,
            "errors_of_laws": {row["law"]: in_own_unit(row, "rmse_heldout")[0] for row in document["laws"]},
            "best_baseline": best,
            "baselines": errors,
        })
        print(f"{name}: {law['law']} {error:.4g}, {best} {errors[best]:.4g} {unit}, noise {noise}; {document['sentence']}")
    arguments.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
