"""Writes a campaign's result.json: what ran, where, how long, and the figures its own figures.py reads from the raw output."""

import importlib.util
import json
import pathlib
import platform
import sys

sys.dont_write_bytecode = True
campaigns = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(campaigns))


def processor():
    """The processor's name and the number of cores, as the system gives them."""
    try:
        lines = pathlib.Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return f"{names[0]}, {len(names)} cores" if names else platform.machine()


def ran(raw):
    """Command lines, commits and seconds of what was run, in the order of their ends."""
    notes = sorted(raw.glob("*.done"), key=lambda path: path.stat().st_mtime)
    lines = [path.read_text(encoding="utf-8").splitlines() for path in notes]
    commands, commits, seconds = zip(*lines, strict=True)
    return list(commands), sorted(set(commits)), sum(map(int, seconds))


def main():
    name, raw = sys.argv[1], pathlib.Path(sys.argv[2])
    commands, commits, seconds = ran(raw)
    specification = importlib.util.spec_from_file_location("figures", campaigns / name / "figures.py")
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    figures, counts = module.figures(raw)
    result = {
        "campaign": name,
        "commit": ", ".join(commits),
        "processor": processor(),
        "seconds": seconds,
        "commands": commands,
        "figures": figures,
        "counts": counts,
    }
    path = campaigns / name / "result.json"
    path.write_text(json.dumps(result, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    print(f"{path.relative_to(campaigns.parent)}:")
    for key, text in figures.items():
        print(f"  {key}: {text}")


main()
