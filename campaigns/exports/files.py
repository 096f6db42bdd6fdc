#!/usr/bin/env python3
"""Writes exports of many instruments and programs, each with a record that is known, and notes how `init` reads them."""

import argparse
import datetime
import json
import pathlib
import shutil
import subprocess

import h5py
import numpy as np
import openpyxl
import scipy.io

BEAD = ["--robot-diameter-mm", "0.55", "--vitreous-diameter-mm", "20", "--poisson-ratio", "0.48"]
RHEOMETER = ["--poisson-ratio", "0.5"]
# Largest difference from the truth, as a part of the truth: the digits of the files.
DIFFERENCE = 1e-5


class Exports:
    """Files in a folder, each with what `init` has to say of it."""

    def __init__(self, folder, seed):
        self.folder, self.files = folder, []
        random = np.random.default_rng(seed)
        creep = lambda s: np.where(s > 0, (1 - np.exp(-3.0 * np.maximum(s, 0) / 1.4)) / 3.0 + np.maximum(s, 0) / 47.0, 0)
        # A bead: time (s), force (µN), position (µm).
        self.t = np.arange(800) * 0.05
        self.f = np.where(self.t % 10 < 5, 4.6, 0.0)
        steps = np.diff(np.r_[0.0, self.f])
        self.x = sum(steps[i] * 100 * creep(self.t - self.t[i]) for i in np.nonzero(steps)[0]) + random.normal(0, 2, 800)
        self.bead = (self.t, self.f, self.x)
        # A rheometer's creep: time (s), stress (Pa), strain (%).
        time = np.geomspace(0.05, 300, 120)
        self.creep = (time, np.full(120, 10.0), 3 * (1 - np.exp(-time / 3)) + time / 300 + random.normal(0, 2e-3, 120))

    def expect(self, name, record=None, options=BEAD, kind="creep"):
        """Notes a file: the record it holds, or None if it has to be refused."""
        truth = None
        if record is not None:
            per_unit = [1e-6, 1e-6] if options is BEAD else [1.0, 0.01]
            highest = [None if values is None else float(np.max(values) * unit) for values, unit in zip(record[1:], per_unit)]
            truth = {"seconds": float(record[0][-1] - record[0][0]), "highest": highest, "kind": kind}
        self.files.append({"name": name, "options": options, "truth": truth})

    def raw(self, name, data, **expected):
        (self.folder / name).write_bytes(data)
        self.expect(name, **expected)

    def text(self, name, head, row, record, encoding="utf-8", foot="", **expected):
        """A table: lines above it, and a function that makes a row from its number and its values."""
        rows = "".join(row(number, *values) + "\n" for number, values in enumerate(zip(*record)))
        readable = expected.pop("readable", True)
        self.raw(name, (head + rows + foot).encode(encoding), record=record if readable else None, **expected)


def comma(value, digits=4):
    return f"{value:.{digits}f}".replace(".", ",")


def bead_tables(all):
    """Text of trackers, testing machines and programs."""
    point = lambda i, t, f, x: f"{t:.3f},{f:.3f},{x:.4f}"
    tabs = lambda i, t, f, x: f"{t:.4f}\t{f:.4f}\t{x:.5f}"
    german = lambda i, t, f, x: f"{comma(t, 2)};{comma(f, 2)};{comma(x)}"
    table = lambda name, head, row, **more: all.text(name, head, row, all.bead, **more)
    preamble = "LabVIEW Measurement\t\nSeparator\tTab\n***End_of_Header***\t\nChannels\t2\nX_Dimension\tTime\tTime\nX0\t0\t0\n***End_of_Header***\t\n"
    table("labview.lvm", preamble + "X_Value\tForce (uN)\tPosition (um)\tComment\n", tabs)
    table("testxpert.csv", '"Prüfzeit";"Standardweg";"Standardkraft"\n"s";"µm";"µN"\n', lambda i, t, f, x: f"{comma(t, 2)};{comma(x)};{comma(f, 2)}", encoding="cp1252")
    table("testxpert.txt", "Prüfzeit s;Weg µm;Kraft µN\n", lambda i, t, f, x: f"{comma(t, 2)};{comma(x)};{comma(f, 2)}")
    results = '"Results Table 1"\n"","Maximum Load"\n"","(N)"\n"1","0.0000046"\n\n'
    table("bluehill.csv", results + '"Time","Extension","Load"\n"(s)","(mm)","(N)"\n', lambda i, t, f, x: f'"{t:.4f}","{x / 1000:.7f}","{f * 1e-6:.9f}"')
    table("bluehill-raw.csv", '"Geometry","Circular"\n\n"Time (s)","Displacement (mm)","Force (mN)"\n', lambda i, t, f, x: f'"{t:.4f}","{x / 1000:.7f}","{f * 1e-3:.7f}"')
    table("mts.txt", "MTS793|MPT|ENU|1|2|.|/|:|1|0|0|A\n\nStation Name: rig.cfg\nTime \tAxial Displacement \tAxial Force \nSec\tmm\tN\n", lambda i, t, f, x: f"{t:.4f}\t{x / 1000:.8f}\t{f * 1e-6:.9f}")
    table("wintest.csv", "Bose ElectroForce\nPoints,Elapsed Time,Disp,Load\n,Sec,mm,mN\n", lambda i, t, f, x: f"{i + 1},{t:.4f},{x / 1000:.8f},{f * 1e-3:.7f}")
    table("cellscale.csv", "SetName,Cycle,Time_S,Size_um,Displacement_um,Force_uN,Temperature_C\n", lambda i, t, f, x: f"creep,{int(t // 10) + 1},{t:.3f},{1000 + x:.4f},{x:.4f},{f:.4f},37.0")
    table("origin.txt", "Time\tForce\tPosition\ns\tuN\tum\n\tcoil\ttracked\n", tabs)
    table("r.txt", '"time_s" "force_uN" "position_um"\n', lambda i, t, f, x: f'"{i + 1}" {t:.3f} {f:.3f} {x:.4f}')
    table("pandas.csv", ",time (s),force (uN),position (um)\n", lambda i, *row: f"{i}," + point(i, *row))
    table("writetable.csv", '"time_s","force_uN","position_um"\n', lambda i, t, f, x: f"{t:.4g},{f:.4g},{x:.7g}")
    table("rheowin-bead.txt", "RheoWin 4.87\nOperator: lab\n\nt in s\tF in uN\tx in um\n", tabs)
    columns = '# springConstant: 0.03\n# segment: pause\n#\n# columns: seriesTime vDeflection height\n# fancyNames: "Series Time" "Vertical deflection" "Height"\n# units: s N m\n'
    table("jpk.txt", columns, lambda i, t, f, x: f"{t:.4f} {f * 1e-6:.6e} {x * 1e-6:.8e}")
    table("igor.itx", "IGOR\nWAVES/D\ttime_s\tforce_uN\tposition_um\nBEGIN\n", lambda i, *row: "\t" + tabs(i, *row), foot="END\n")
    all.text("pylake.csv", "# kymograph\n# time (seconds);Force 1x (pN);Distance (um)\n", lambda i, t, f, x: f"{t:.4f};{1e6 * f:.4f};{x:.4f}", all.bead)
    table("separator.csv", "sep=;\nt [s];F [µN];x [µm]\n", german, encoding="utf-8-sig")
    table("gnuplot.dat", "# t F x\n# s uN um\n", lambda i, t, f, x: f"{t:.3f} {f:.3f} {x:.4f}" + ("\n\n" if i % 200 == 199 else ""))
    table("footer.csv", "Time (sec),Force (uN),Displacement (microns)\n", point, foot="\nEnd of data\nOperator: lab\n")
    table("fortran.txt", " TIME(S)  FORCE(N)  DISP(M)\n", lambda i, t, f, x: f" {t:.8E}  {f * 1e-6:.6E}  {x * 1e-6:.8E}")
    table("fortran-double.txt", " time_s force_N position_m\n", lambda i, t, f, x: f" {t:.8E}  {f * 1e-6:.6E}  {x * 1e-6:.8E}".replace("E", "D"))
    table("clock.csv", "Clock;Force (uN);Position (um)\n", lambda i, t, f, x: f"10:{int(t // 60):02d}:{t % 60:06.3f};{f:.2f};{x:.4f}".replace(".", ","))
    table("thousands.csv", "Time (ms),Force (nN),Position (nm)\n", lambda i, t, f, x: f'"{1000 * t:,.0f}","{1000 * f:,.0f}","{1000 * x:,.1f}"')
    for name, head, encoding in [
        ("french", "Temps (s);Force (µN);Déplacement (µm)", "cp1252"),
        ("spanish", "Tiempo (s);Fuerza (µN);Desplazamiento (µm)", "utf-8"),
        ("italian", "Tempo [s];Forza [µN];Spostamento [µm]", "utf-8"),
        ("dutch", "Tijd (s);Kracht (µN);Verplaatsing (µm)", "utf-8"),
        ("portuguese", "Tempo (s);Força (µN);Deslocamento (µm)", "utf-8"),
        ("norwegian", "Tid (s);Kraft (µN);Forskyvning (µm)", "cp1252"),
        ("polish", "Czas [s];Siła [µN];Przemieszczenie [µm]", "cp1250"),
        ("greek", "Χρόνος (s);Δύναμη (µN);Μετατόπιση (µm)", "utf-8"),
        ("russian", "Время (с);Сила (мкН);Перемещение (мкм)", "cp1251"),
        ("japanese", "試験;時間 [s];力 [uN];変位 [um]", "shift_jis"),
        ("chinese", "时间(s);力(uN);位移(um)", "gbk"),
    ]:
        row = (lambda i, *values: "クリープ;" + german(i, *values)) if name == "japanese" else german
        table(f"{name}.csv", head + "\n", row, encoding=encoding)
    table("tracker.txt", "#Tracker export\nmass A\nt\tx\ty\n", lambda i, t, f, x: f"{t:.3f}\t{x:.4f}\t0", readable=False)
    both = lambda i, t, f, x: f"{t:.3f},force_uN,{f:.3f}\n{t:.3f},position_um,{x:.4f}"
    table("long.csv", "time_s,variable,value\n", both, readable=False)


def rheometer_tables(all):
    """Text of rheometers and of published curves."""
    table = lambda name, head, row, **more: all.text(name, head, row, all.creep, options=RHEOMETER, **more)
    table("malvern.csv", "Action Name,Time (action)(s),Time (sequence)(s),Temperature(°C),Shear stress(Pa),Shear strain(%),Compliance(1/Pa)\n", lambda i, t, s, g: f"creep,{t:.5f},{t + 10:.5f},25.0,{s:.4f},{g:.6f},{g / 100 / s:.6e}")
    table("kinexus.txt", "Time (action) (s)\tShear stress (Pa)\tShear strain (%)\n", lambda i, t, s, g: f"{t:.5f}\t{s:.4f}\t{g:.6f}")
    german = "Projekt:\tGlaskörper\nErgebnis:\tKriechen 1\n\nIntervall und Messpunkte:\t1\t120\nIntervalldaten:\tMesspkt.\tZeit\tIntervallzeit\tSchubspannung\tScherdeformation\tStatus\n\t\t[s]\t[s]\t[Pa]\t[%]\t\n"
    table("rheocompass-german.txt", german, lambda i, t, s, g: f"\t{i + 1}\t{comma(t)}\t{comma(t)}\t{comma(s, 3)}\t{comma(g, 6)}\tDSO", encoding="utf-16")
    french = "Projet:\tgel\nIntervalles et points de mesure:\t1\t120\nDonnées d'intervalle:\tPt n°\tTemps\tContrainte de cisaillement\tDéformation de cisaillement\tÉtat\n\t\t[s]\t[Pa]\t[%]\t\n"
    table("rheocompass-french.txt", french, lambda i, t, s, g: f"\t{i + 1}\t{comma(t)}\t{comma(s, 3)}\t{comma(g, 6)}\tDSO", encoding="utf-16")
    table("rheoplus.csv", "Data Series Information\nName:;Creep\n\nInterval:;1\nMeas. Pts.;Time;Shear Stress;Strain;Torque\n;[s];[Pa];[%];[µNm]\n", lambda i, t, s, g: f"{i + 1};{t:.5f};{s:.4f};{g:.6f};{s / 10:.4f}")
    table("trios.csv", "Filename,gel.tri\nInstrument name,HR-20\n\n[step]\nStep name,Creep - 1\nStep time,Stress,Strain,Temperature\ns,Pa,%,°C\n", lambda i, t, s, g: f"{t:.5f},{s:.4f},{g:.6f},25.0")
    table("rheology-advantage.txt", "Rheology Advantage Data\nfile name\tcreep\n\ntime\tstrain\tshear stress\ttemperature\ns\t%\tPa\t°C\n", lambda i, t, s, g: f"{t:.4f}\t{g:.6f}\t{s:.3f}\t25.0")
    table("orchestrator.txt", "Time\tStrain\tStress\ns\t%\tdyn/cm^2\n", lambda i, t, s, g: f"{t:.4f}\t{g:.6f}\t{10 * s:.3f}")
    table("haake.csv", "Time t [s];Shear stress τ [Pa];Shear strain γ [-];Status\n", lambda i, t, s, g: f"{comma(t)};{comma(s)};{comma(g / 100, 8)};OK")
    table("q800.txt", "Version\tV7.5\nInstrument\tDMA Q800\nNsig\t4\nSig1\tTime (min)\nSig2\tTemperature (°C)\nSig3\tStrain (%)\nSig4\tStress (MPa)\nStartOfData\n", lambda i, t, s, g: f"{t / 60:.6E}\t25.0\t{g:.6E}\t{s * 1e-6:.6E}")
    time, stress, strain = all.creep
    curves = lambda scale, values: "".join(f"{t:.5f},{scale * value:.8e}\n" for t, value in zip(time, values)).encode()
    compliance = 0.01 * strain / stress
    for name, head, scale in [("compliance.csv", b"t (s),J (1/Pa)\n", 1.0), ("compliance-kpa.csv", b"time [s],Creep compliance [1/kPa]\n", 1e3)]:
        all.raw(name, head + curves(scale, compliance), record=(time, None, 100 * compliance), options=RHEOMETER)
    modulus = 500 * np.exp(-time / 20) + 100
    for name, head, scale in [("modulus.csv", b"time [s],G [kPa]\n", 1e-3), ("modulus.txt", b"time,relaxation modulus\ns,Pa\n", 1.0)]:
        all.raw(name, head + curves(scale, modulus), record=(time, modulus, None), options=RHEOMETER, kind="relaxation")
    mixed = "".join(f"{t:.4f},{value:.5f},1.0\n" for t, value in zip(time, modulus))
    all.raw("modulus-and-strain.csv", ("Time (action)(s),Shear modulus(Pa),Shear strain(%)\n" + mixed).encode(), options=RHEOMETER)


def containers(all):
    """Files that are not text."""
    t, f, x = all.bead
    names = ["time_s", "force_uN", "position_um"]
    place = lambda name: all.folder / name
    read = lambda name: all.expect(name, record=all.bead)
    named = dict(zip(names, all.bead))

    def workbook(name, heads, rows, sheets=1):
        book = openpyxl.Workbook()
        book.remove(book.active)
        for number in range(sheets):
            sheet = book.create_sheet(f"eye {number + 1}")
            for row in [*heads, *rows]:
                sheet.append(row)
        book.save(place(name))

    plain = [[float(value) for value in row] for row in zip(*all.bead)]
    start = datetime.datetime(2026, 3, 5, 10)
    workbook("plain.xlsx", [["Time [s]", "Force [uN]", "Position [um]"]], plain)
    workbook("preamble.xlsx", [["operator", "A"], [], ["bead", 550], ["Time [s]", "Force [uN]", "Position [um]"]], plain)
    workbook("two-heads.xlsx", [["Load cell", None, "Camera"], ["Time", "Force", "Position"], ["s", "uN", "um"]], plain)
    workbook("dates.xlsx", [["Date", "Force (uN)", "x (um)"]], [[start + datetime.timedelta(seconds=row[0]), *row[1:]] for row in plain])
    workbook("text.xlsx", [["Zeit [s]", "Kraft [µN]", "Weg [µm]"]], [[comma(value) for value in row] for row in plain])
    for name in ["plain.xlsx", "preamble.xlsx", "two-heads.xlsx", "dates.xlsx", "text.xlsx"]:
        read(name)
    workbook("three-eyes.xlsx", [["t (s)", "F (uN)", "x (um)"]], plain, sheets=3)
    all.expect("three-eyes.xlsx")
    rows = np.zeros(t.size, dtype=[(name, "f8") for name in names] + [("cycle", "i4")])
    for name, values in [*named.items(), ("cycle", t // 10 + 1)]:
        rows[name] = values
    np.save(place("structured.npy"), rows)
    np.savez(place("archive.npz"), **named, fps=20.0)
    np.savez_compressed(place("lengths.npz"), **named, histogram=np.arange(50.0), bins=np.arange(51.0))
    scipy.io.savemat(place("vectors.mat"), {**named, "note": "hello"})
    scipy.io.savemat(place("structure.mat"), {"data": named}, do_compression=True)
    scipy.io.savemat(place("deep.mat"), {"study": {"bead": named, "eye": {"species": "porcine", "diameter_mm": 20.0}}})
    with h5py.File(place("version-7-3.mat"), "w", userblock_size=512) as file:
        for name, values in named.items():
            file.create_dataset(name, data=values[None, :])
    with place("version-7-3.mat").open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(128))
    with h5py.File(place("group.h5"), "w") as file:
        for name, unit, values in [("time", "s", t), ("force", "uN", f), ("position", "um", x)]:
            file.create_dataset(f"run/{name}", data=values, compression="gzip", chunks=(100,)).attrs["units"] = unit
    with h5py.File(place("big-endian.h5"), "w", libver="latest") as file:
        for name, values in named.items():
            file.create_dataset(name, data=values.astype(">f8"))
    with h5py.File(place("tweezers.h5"), "w") as file:
        for name, values in [("Force 1x (pN)", 1e6 * f), ("Distance 1 (um)", x)]:
            file.create_dataset(f"Force HF/{name}", data=values).attrs["Sample rate (Hz)"] = 20
    for name in ["structured.npy", "archive.npz", "lengths.npz", "vectors.mat", "structure.mat", "deep.mat", "version-7-3.mat", "group.h5", "big-endian.h5", "tweezers.h5"]:
        read(name)
    np.save(place("matrix.npy"), np.transpose(all.bead))
    all.expect("matrix.npy")
    detections = "".join(f'<detection t="{i}" x="{value:.4f}" y="1.0" z="0.0"/>' for i, value in enumerate(x))
    tracks = f'<?xml version="1.0"?>\n<Tracks nTracks="1" spaceUnits="micron" frameInterval="0.05" timeUnits="sec"><particle nSpots="800">{detections}</particle></Tracks>'
    # A tracker records no force.
    all.raw("tracks.xml", tracks.encode())
    all.raw("record.json", json.dumps({"time": list(t), "force": list(f), "position": list(x)}).encode())
    cells = "".join(f"<tr><td>{a:.3f}</td><td>{b:.2f}</td><td>{c:.4f}</td></tr>" for a, b, c in zip(t, f, x))
    all.raw("page.xls", f"<html><body><table>{cells}</table></body></html>".encode())
    for name, start in [("wave.ibw", b"\x05\x00"), ("video.avi", b"RIFF\x00\x00\x01\x00AVI LIST"), ("workspace.rds", b"\x1f\x8b\x08\x00"), ("labview.tdms", b"TDSm\x0e\x00\x00\x00"), ("arrays.pkl", b"\x80\x04\x95"), ("curve.jpk-force", b"PK\x03\x04"), ("old.xls", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"), ("paper.pdf", b"%PDF-1.7\n"), ("stack.tif", b"II*\x00")]:
        all.raw(name, start + bytes(300))


def outcome(program, folder, file):
    """What `init` makes of a file: read, wrong or refused; and what was found."""
    out = folder / "read"
    shutil.rmtree(out, ignore_errors=True)
    command = [program, "init", str(folder / file["name"]), *file["options"], "--out", str(out), "--quiet", "--json", "-"]
    run = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=120, check=False)
    if run.returncode == 2 and "what to do" in run.stderr:
        return "refused", run.stderr.splitlines()[0]
    if run.returncode != 0:
        return "failed", run.stderr
    truth = file["truth"]
    if truth is None:
        return "read", ""
    columns = {column["role"]: column for column in json.loads(run.stdout)["columns"]}
    kind = "relaxation" if 'kind = "relaxation"' in (out / "experiment.toml").read_text(encoding="utf-8") else "creep"
    first, last = columns["time"]["range"]
    pairs = [(last - first, truth["seconds"])]
    for roles, wanted in zip((("force", "stress"), ("position", "strain")), truth["highest"]):
        found = next((columns[role]["range"][1] * 1e-6 for role in roles if role in columns), None)
        if wanted is not None:
            pairs.append((found, wanted))
    is_right = all(found is not None and abs(found - wanted) <= DIFFERENCE * abs(wanted) for found, wanted in pairs)
    return ("read" if is_right and kind == truth["kind"] else "wrong"), f"{kind}: {pairs}"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--program", required=True)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--out", type=pathlib.Path, required=True)
    arguments = parser.parse_args()
    folder = arguments.out / "files"
    folder.mkdir(parents=True, exist_ok=True)
    exports = Exports(folder, arguments.seed)
    bead_tables(exports)
    rheometer_tables(exports)
    containers(exports)
    results = []
    for file in exports.files:
        found, words = outcome(arguments.program, folder, file)
        results.append({"name": file["name"], "expected": "refused" if file["truth"] is None else "read", "outcome": found})
        print(f"{found} {file['name']} {words}", flush=True)
    (arguments.out / "exports.json").write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")


main()
