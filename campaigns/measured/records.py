#!/usr/bin/env python3
"""Measured records of several instruments: laws compared on them, a diagnosis, and six functions fitted by least squares. The last part of each record is predicted."""

import argparse
import json
import pathlib
import re
import shutil
import subprocess
import sys

import numpy
from scipy.optimize import least_squares

HERE = pathlib.Path(__file__).resolve().parent
# Options of `init`, and rows of [measurement] that the files do not state.
SECONDS = ["--unit-time", "s"]
# A relative length and a stress in kPa, without units in the table.
MUSCLE = ["--time", "Time", "--force", "F", "--position", "L", *SECONDS, "--unit-force", "1000 N", "--unit-position", "m", "--kind", "relaxation"]
TIES = [*SECONDS, "--time-ties", "spread"]
# Name, instrument, file, options. The first 70 % of the rows are fitted, the others predicted.
TABLES = [
    ("gel, creep", "TA rheometer (TRIOS)", "rheojax-creep/creep_experiment.txt", []),
    ("mucus, creep", "rheometer, published table", "rheojax-creep/creep_mucus_data.csv", SECONDS),
    ("polystyrene, creep", "rheometer, published table", "rheojax-creep/creep_ps145_data.csv", TIES),
    ("Laponite, relaxation", "rheometer, published table", "rheojax-relaxation/rel_lapo_1200.csv", SECONDS),
    ("fish muscle, relaxation", "rheometer, published table", "rheojax-relaxation/stressrelaxation_fishmuscle_data.csv", SECONDS),
    ("foam, relaxation", "rheometer, published table", "rheojax-relaxation/stressrelaxation_liquidfoam_data.csv", SECONDS),
    *[(f"heart muscle, ramp of {ramp} s", "muscle stretcher", f"muscle-titin-relaxation/AvgRelaxed_{ramp}s.csv", MUSCLE) for ramp in ("0.1", "1", "10", "100")],
]
FITTED = 0.7
# Records with a description of their own: name, instrument, folder or file, and description.
TIPS = [("brain slice, hold", "brain"), ("polymer gel, hold", "polymergel")]
MOST_SECONDS = 600


def run(program, *arguments):
    """Exit code, standard output and standard error; 124 after the time limit."""
    try:
        found = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=MOST_SECONDS, check=False)
    except subprocess.TimeoutExpired:
        return 124, "", f"no end after {MOST_SECONDS} s"
    return found.returncode, found.stdout, found.stderr


def read_record(program, experiment, work):
    """Times, commanded and measured values of a record, as the program reads it."""
    code, _, said = run(program, "check", experiment, "--json", work / "check.json")
    return code, said


def columns(path, toml):
    """Times (s) and measured values of the table that `experiment.toml` describes, in the table's units."""
    text = toml.read_text(encoding="utf-8")
    key = lambda name: re.search(rf'^{name} = "?([^"\n]*?)"?(?: +#.*)?$', text, flags=re.M)
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    between = {"tab": "\t", "semicolon": ";", "comma": ",", "space": None}.get(key("delimiter")[1], key("delimiter")[1])
    names = [cell.strip() for cell in lines[int(key("header_line")[1]) - 1].split(between)]
    is_relaxation = 'kind = "relaxation"' in text
    place = lambda name: names.index(name) if name in names else int(name) - 1
    at = [place(key("time")[1]), place(key("force" if is_relaxation else "position")[1])]
    rows = []
    for line in lines[int(key("first_row_line")[1]) - 1 :]:
        cells = line.split(between)
        try:
            rows.append([float(cells[k]) for k in at])
        except (ValueError, IndexError):
            break
    scale = {"min": 60.0, "ms": 1e-3, "h": 3600.0}.get(key("time")[1] if False else re.findall(r'^time = "(\w+)"', text, flags=re.M)[-1], 1.0)
    found = numpy.array(rows)
    return scale * found[:, 0], found[:, 1]


def split(toml, starts_s, fitted, scored):
    text = re.sub(r"^# calibration_cycles.*\n", "", toml.read_text(encoding="utf-8"), flags=re.M)
    rows = f"cycle_starts_s = {starts_s}\ncalibration_cycles = {fitted}\nheldout_cycles = {scored}\n"
    toml.write_text(text.replace("[measurement]\n", f"[measurement]\n{rows}", 1), encoding="utf-8")


# Six functions of the time since the step, each with starts for its nonlinear parameters.
def linear_part(columns_of, y):
    matrix = numpy.stack(columns_of, axis=1)
    return matrix @ numpy.linalg.lstsq(matrix, y, rcond=None)[0], numpy.linalg.lstsq(matrix, y, rcond=None)[0]


FUNCTIONS = {
    "last value": None,
    "line in ln t": (lambda t, p: [numpy.ones_like(t), numpy.log(t)], [[]]),
    "one exponential": (lambda t, p: [numpy.ones_like(t), numpy.exp(-t / numpy.exp(p[0]))], None),
    "two exponentials": (lambda t, p: [numpy.ones_like(t), numpy.exp(-t / numpy.exp(p[0])), numpy.exp(-t / numpy.exp(p[1]))], None),
    "power law": (lambda t, p: [t ** p[0]], [[-0.5], [-0.1], [0.3], [0.8]]),
    "constant and power law": (lambda t, p: [numpy.ones_like(t), t ** p[0]], [[-1.0], [-0.3], [0.3], [0.8]]),
    "line and exponential": (lambda t, p: [numpy.ones_like(t), t, numpy.exp(-t / numpy.exp(p[0]))], None),
}


def predict(name, t, y, later):
    """The function's values at later times, fitted by least squares; the nonlinear parameters from several starts."""
    if FUNCTIONS[name] is None:
        return numpy.full_like(later, y[-1])
    shape, starts = FUNCTIONS[name]
    if starts is None:
        decades = numpy.log(t[-1] * numpy.array([0.003, 0.03, 0.3, 2.0]))
        n = 2 if name == "two exponentials" else 1
        starts = [[a] for a in decades] if n == 1 else [[a, b] for i, a in enumerate(decades) for b in decades[i + 1 :]]
    best = None
    for start in starts:
        residual = lambda p: linear_part(shape(t, p), y)[0] - y
        try:
            p = least_squares(residual, start, method="trf").x if start else []
            cost = float(numpy.sum(residual(p) ** 2))
        except (ValueError, numpy.linalg.LinAlgError):
            continue
        if best is None or cost < best[0]:
            best = cost, p
    _, coefficients = linear_part(shape(t, best[1]), y)
    return numpy.stack(shape(later, best[1]), axis=1) @ coefficients


def baselines(t, y, n_fitted):
    """Errors of the six functions on the later rows, and of the last value."""
    rmse = lambda x: float(numpy.sqrt(numpy.mean((x - y[n_fitted:]) ** 2)))
    return {name: rmse(predict(name, t[:n_fitted], y[:n_fitted], t[n_fitted:])) for name in FUNCTIONS}


def judged(program, work, experiment, noun):
    """Documents of `compare --laws` and `diagnose` of a record, the latter with the likeliest law."""
    found = {"record": noun}
    code, _, said = run(program, "compare", experiment, "--laws", "--prior", "generic", "--out", work / "laws", "--json", work / "laws.json", "--quiet")
    if code not in (0, 1):
        return {**found, "refused": said.strip().splitlines()[0] if said.strip() else f"exit code {code}"}
    document = json.loads((work / "laws.json").read_text(encoding="utf-8"))
    unit = next(key for key in document["laws"][0] if key.startswith("rmse_heldout_") and document["laws"][0][key] is not None)
    noise = next((document[key] for key in document if key.startswith("noise_") and document[key] is not None), None)
    errors = {law["law"]: law[unit] for law in document["laws"] if law[unit] is not None}
    likeliest = document["laws"][0]["law"]
    found |= {"unit": unit.removeprefix("rmse_heldout_"), "noise": noise, "likeliest": likeliest, "error": errors[likeliest], "errors": errors, "laws_say": document["sentence"]}
    code, _, said = run(program, "diagnose", experiment, "--base", likeliest, "--prior", "generic", "--out", work / "diagnosis", "--json", work / "diagnosis.json", "--quiet", "--no-report")
    if code in (0, 1):
        diagnosis = json.loads((work / "diagnosis.json").read_text(encoding="utf-8"))
        found |= {"verdict": diagnosis["verdict"]["kind"], "effects": diagnosis["verdict"]["effects"], "says": diagnosis["verdict"]["sentence"]}
        extended = diagnosis["extended"] or {}
        found["with_effect"] = next((extended[key] for key in extended if key.startswith("rmse_heldout_") and extended[key] is not None), None)
    else:
        found["verdict"] = said.strip().splitlines()[0] if said.strip() else f"exit code {code}"
    return found


def of_table(program, data, out, entry):
    name, instrument, file, options = entry
    work = out / re.sub(r"\W+", "-", name)
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    experiment = work / "experiment"
    code, _, said = run(program, "init", data / file, *options, "--out", experiment)
    if code != 0:
        return {"record": name, "instrument": instrument, "refused": said.strip().splitlines()[0]}
    toml = experiment / "experiment.toml"
    table = next(path for path in experiment.iterdir() if path.name != "experiment.toml")
    t, y = columns(table, toml)
    n_fitted = int(FITTED * len(t))
    # Published tables and the rheometer's step begin at time 0. The muscle is stretched from 2 s on.
    begin = 0.0
    if "ramp" in name:
        begin = 2.0 + float(name.split()[-2])
        t, y = t - begin, y
        n_fitted = int(numpy.sum(t <= 0.0) + FITTED * numpy.sum(t > 0.0))
    split(toml, [float(min(0.0, t[0] + begin)), float(t[n_fitted] + begin)], [1], [2])
    is_later = t > 0.0
    found = judged(program, work, experiment, name)
    n_before = int(numpy.sum(~is_later))
    fits = baselines(t[is_later], y[is_later], n_fitted - n_before)
    scale = 1e6 if found.get("unit") == "um" else 1.0
    return {**found, "instrument": instrument, "rows": len(t), "baselines": {key: scale * value for key, value in fits.items()}}


def of_tip(program, data, out, entry):
    name, stem = entry
    work = out / stem
    shutil.rmtree(work, ignore_errors=True)
    experiment = work / "experiment"
    experiment.mkdir(parents=True)
    table = numpy.genfromtxt(data / "afm-force-clamp" / f"{stem}.csv", delimiter=",", names=True)
    shutil.copyfile(data / "afm-force-clamp" / f"{stem}.csv", experiment / "force-clamp.csv")
    text = (HERE.parent / "indentations" / "experiment.toml").read_text(encoding="utf-8").replace("RECORD", stem).replace("EXPONENT", "1.5")
    (experiment / "experiment.toml").write_text(re.sub(r"^cycle_starts_s.*$", "cycle_starts_s = [0, 3, 5]\ncalibration_cycles = [2]\nheldout_cycles = [3]", text, flags=re.M), encoding="utf-8")
    found = judged(program, work, experiment, name)
    hold = table[(table["time_s"] > 3.0) & (table["time_s"] < 6.0)]
    n_fitted = int(numpy.sum(hold["time_s"] < 5.0))
    fits = baselines(hold["time_s"] - 3.0, -hold["height_um"], n_fitted)
    return {**found, "instrument": "atomic force microscope", "rows": len(hold), "baselines": fits}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--program", required=True)
    parser.add_argument("--data", type=pathlib.Path, required=True)
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--only", default="")
    arguments = parser.parse_args()
    jobs = [(of_table, entry) for entry in TABLES] + [(of_tip, entry) for entry in TIPS]
    for job, entry in jobs:
        path = arguments.out / f"{re.sub(r'[^a-z0-9]+', '-', entry[0].lower())}.record.json"
        if path.exists() or arguments.only not in entry[0]:
            continue
        found = job(arguments.program, arguments.data, arguments.out, entry)
        path.write_text(json.dumps(found, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        best = min(found.get("baselines", {"none": float("nan")}).items(), key=lambda pair: pair[1])
        print(found["record"], found.get("refused") or (found["likeliest"], found["error"], found["unit"], "noise", found["noise"], "best baseline", best, found["verdict"], found.get("effects"), found.get("with_effect")), flush=True)


if __name__ == "__main__":
    main()
