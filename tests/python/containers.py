"""Workbooks, HDF5, MATLAB and NumPy files that Python libraries write are read by `init` with every number; damaged ones are refused."""

import os
import pathlib
import random
import subprocess
import tempfile

import h5py
import numpy
import openpyxl
import scipy.io

PROGRAM = os.environ["VITREO_UQ"]
NAMES = ["time_s", "force_uN", "position_um"]
SIZES = ["--robot-diameter-mm", "0.55", "--vitreous-diameter-mm", "20", "--poisson-ratio", "0.48", "--quiet"]
# Damaged copies of each file, and the seed of the damage.
DAMAGED, SEED = 12, 4802


def record():
    """A creep record that no text was made of: time, force and position."""
    time = numpy.arange(400) * 0.05
    force = numpy.where(time % 10 < 5, 4.6, 0.0)
    position = numpy.cumsum(force) / 3.0 + numpy.random.default_rng(SEED).normal(size=400) / 7.0
    return [time, force, position]


def workbook(path, columns):
    book = openpyxl.Workbook()
    book.active.append(["operator", "A"])
    sheet = book.create_sheet("creep")
    sheet.append([])
    sheet.append(NAMES)
    for row in zip(*columns):
        sheet.append([float(value) for value in row])
    book.save(path)


def hdf5(path, columns, **options):
    with h5py.File(path, "w", **options) as file:
        group = file.create_group("run")
        for name, values in zip(NAMES, columns):
            stem, unit = name.split("_")
            group.create_dataset(stem, data=values.astype(">f8"), chunks=(64,), compression="gzip", shuffle=True).attrs["units"] = unit


def matlab_7_3(path, columns):
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in zip(NAMES, columns):
            file.create_dataset(name, data=values[None, :])
        file.create_group("#refs#")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(128))


def structured(path, columns):
    rows = numpy.zeros(len(columns[0]), dtype=[(name, "f8") for name in NAMES])
    for name, values in zip(NAMES, columns):
        rows[name] = values
    numpy.save(path, rows)


named = lambda columns: dict(zip(NAMES, columns))
WRITERS = {
    "book.xlsx": workbook,
    "old.h5": hdf5,
    "new.h5": lambda path, columns: hdf5(path, columns, libver="latest"),
    "v7_3.mat": matlab_7_3,
    "vectors.mat": lambda path, columns: scipy.io.savemat(path, {**named(columns), "rate": 20.0, "note": "no number"}),
    "structure.mat": lambda path, columns: scipy.io.savemat(path, {"data": named(columns)}, do_compression=True),
    "structured.npy": structured,
    "archive.npz": lambda path, columns: numpy.savez_compressed(path, **named(columns)),
}


def init(file, out):
    command = [PROGRAM, "init", str(file), "--out", str(out), *SIZES]
    return subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60, check=False)


def table(text):
    """Columns of the table in the order of NAMES. HDF5 lists its datasets by name, without their units."""
    lines = text.splitlines()
    header = next(number for number, line in enumerate(lines) if "time" in line and "\t" in line)
    rows = numpy.array([[float(cell) for cell in line.split("\t")] for line in lines[header + 1 :]])
    names = [cell.split(" ")[0].split("_")[0] for cell in lines[header].split("\t")]
    return [rows[:, names.index(name.split("_")[0])] for name in NAMES]


def damaged(content, stream):
    copy = bytearray(content)
    if stream.random() < 0.3:
        return bytes(copy[: stream.randrange(len(copy))])
    for _ in range(stream.choice([1, 4, 16])):
        copy[stream.randrange(len(copy))] = stream.randrange(256)
    return bytes(copy)


def main():
    columns, stream = record(), random.Random(SEED)
    n_refused = 0
    with tempfile.TemporaryDirectory() as place:
        place = pathlib.Path(place)
        for name, write in WRITERS.items():
            file, out = place / name, place / f"{name}-read"
            write(file, columns)
            run = init(file, out)
            assert run.returncode == 0, f"{name}: {run.stderr}"
            found = table((out / f"{file.stem}.tsv").read_text(encoding="utf-8"))
            # openpyxl writes 16 digits; all other files hold the numbers themselves.
            digits = 1e-15 if name == "book.xlsx" else 0.0
            assert numpy.allclose(found, columns, rtol=digits, atol=0.0), f"{name}: other numbers were read"
            content = file.read_bytes()
            for number in range(DAMAGED):
                file.write_bytes(damaged(content, stream))
                run = init(file, place / f"{name}-damaged-{number}")
                assert run.returncode in (0, 2), f"{name}, damage {number}: {run.stderr}"
                n_refused += run.returncode == 2
    assert n_refused > 0
    print(f"{len(WRITERS)} files read with all numbers; {n_refused} of {DAMAGED * len(WRITERS)} damaged ones refused")


main()
