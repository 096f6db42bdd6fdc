"""What work on many machines costs."""

import json
import math
import statistics


def median(runs):
    """Of each figure the middle one."""
    return {key: statistics.median(run[key] for run in runs) for key in runs[0]}


def figures(raw):
    def read(label):
        return json.loads((raw / f"{label}.txt").read_text(encoding="utf-8"))

    n = len((raw / "tasks-1/tasks.jsonl").read_text(encoding="utf-8").splitlines())
    n_eyes = len((raw / "eyes/tasks.jsonl").read_text(encoding="utf-8").splitlines())
    n_cases = sum(json.loads(line)["arguments"]["count"] for line in open(raw / "challenges/tasks.jsonl", encoding="utf-8"))
    runs = {label: [read(f"{label}-{k}") for k in (1, 2, 3)] for label in ("one-worker", "two-workers", "in-one-task")}
    one, two = (median(runs[label]) for label in ("one-worker", "two-workers"))
    # Runs that followed each other are compared: the machine's clock wanders more than what is measured.
    gains = sorted(alone["wall_s"] / both["wall_s"] for alone, both in zip(runs["one-worker"], runs["two-workers"]))
    many, eyes, cases = read("gather-many"), read("eyes"), read("challenge-tasks")
    overheads_s = (alone["wall_s"] - whole["wall_s"] for alone, whole in zip(runs["one-worker"], runs["in-one-task"]))
    overheads_ms = sorted(1e3 * own / (n - 1) for own in overheads_s)
    levels = sorted((json.loads(path.read_text(encoding="utf-8")) for path in raw.glob("level-*.txt")), key=lambda own: own["level"])
    first, last = levels[0], levels[-1]
    growth = lambda key: math.log(last[key] / first[key]) / math.log(last["unknowns"] / first["unknowns"])
    told = {
        "specimens": f"{n:,}",
        "a specimen": f"{1e3 * one['processor_s'] / n:.0f} ms of processor",
        "one worker": f"{one['wall_s']:.0f} s",
        "two workers": f"{two['wall_s']:.0f} s",
        "two workers over one": f"{gains[1]:.2f} × ({gains[0]:.2f} to {gains[2]:.2f})",
        "overhead of a task in a worker": f"{overheads_ms[1]:.1f} ms ({overheads_ms[0]:.1f} to {overheads_ms[2]:.1f})",
        "overhead of a task in a process of its own": f"{1e3 * read('there-already')['wall_s']:.0f} ms",
        "an eye with a robot": f"{1e3 * eyes['processor_s'] / n_eyes:.0f} ms of processor",
        "a case": f"{cases['processor_s'] / n_cases:.1f} s of processor",
        "parts against one machine": "the same bytes" if (raw / "same.txt").exists() else "other bytes",
        "gathering 100,000 results": f"{many['wall_s']:.1f} s, {many['peak_mib'] / 1024:.2f} GB",
    }
    for own in levels:
        total = own["assembly_and_analysis_s"] + own["factorisation_s"]
        told[f"direct solver, {own['unknowns']:,} unknowns"] = f"{total:.1f} s, {own['peak_mib'] / 1024:.2f} GB, a solve {own['solve_s']:.2f} s"
    told["growth of the factorisation's time"] = f"unknowns to the power {growth('factorisation_s'):.2f}"
    told["growth of its memory"] = f"unknowns to the power {growth('peak_mib'):.2f}"
    iterative = sorted((json.loads(path.read_text(encoding="utf-8")) for path in raw.glob("iterative-*.txt")), key=lambda own: own["level"])
    for own in iterative:
        told[f"iterative solver, {own['unknowns']:,} unknowns"] = (
            f"{own['assembly_s'] + own['coarse_grid_s']:.1f} s, {own['peak_mib'] / 1024:.2f} GB, a solve {own['solve_s']:.1f} s in {own['iterations']} iterations"
        )
    both = [(direct, own) for direct in levels for own in iterative if direct["level"] == own["level"]]
    apart = max(abs(own["robot_m"] / direct["robot_m"] - 1) for direct, own in both)
    told["largest distance of the two solvers' displacements of the robot"] = f"{apart:.0e}"
    ahead = [own["unknowns"] for direct, own in both if direct["factorisation_s"] > own["coarse_grid_s"] + own["solve_s"]]
    told["smallest mesh at which one iterative solve is faster than a factorisation"] = f"{min(ahead):,} unknowns" if ahead else "none"
    last_both = both[-1]
    solves = (last_both[0]["factorisation_s"] - last_both[1]["coarse_grid_s"]) / (last_both[1]["solve_s"] - last_both[0]["solve_s"])
    told[f"solves from which the direct solver pays at {last_both[0]['unknowns']:,} unknowns"] = f"{math.ceil(solves)}"
    return told, {"levels": levels, "iterative": iterative, "list": read("list"), "gather_specimens": read("gather-specimens"), "challenges_at_once": read("challenges")}
