import re
import statistics


def seconds(path):
    """Median wall clock and processor seconds of the runs of one command."""
    runs = [[float(x) for x in line.split()] for line in path.read_text(encoding="utf-8").splitlines()]
    return statistics.median(run[0] for run in runs), statistics.median(run[1] + run[2] for run in runs)


def words(value):
    """Two digits, with the unit."""
    return f"{value:.1f} s" if value < 10 else f"{value:.0f} s"


def figures(raw):
    measured = {path.stem: seconds(path) for path in sorted(raw.glob("*.seconds"))}
    hidden = {name: both for name, both in measured.items() if re.fullmatch(r"diagnose-[a-z].*-\d\d", name)}
    def of(prefix):
        return {name.removeprefix(prefix): both for name, both in measured.items() if name.startswith(prefix)}

    def worst(found):
        slowest = max(found, key=lambda name: found[name][0])
        return f"{words(found[slowest][0])} ({slowest})"

    new, effects, extensions, cold = of("challenge-new-"), of("challenge-effect-"), of("extend-"), of("cold-diagnose-")
    several = ("challenge-", "extend-", "cold-")
    commands = {name: words(both[0]) for name, both in measured.items() if name not in hidden and not name.startswith(several)}
    benches = {}
    for path in sorted(raw.glob("bench-*.txt")):
        for name, time in re.findall(r"^(\S.*?)\s+time:\s+\[\S+ \S+ (\S+ \S+) ", path.read_text(encoding="utf-8"), re.M):
            benches[name] = time
    return commands | benches | {
        "challenge new, nothing kept, worst of three seeds": words(max(both[0] for both in new.values())),
        "challenge new, nothing kept, worst of all effects": worst(effects),
        "extend, worst of effects that change the field": worst(extensions),
        "diagnose, median": words(statistics.median(both[0] for both in hidden.values())),
        "diagnose, worst": worst({name.removeprefix("diagnose-"): both for name, both in hidden.items()}),
        "diagnose, empty cache, worst": worst(cold),
    }, {name: {"wall_s": both[0], "processor_s": round(both[1], 2)} for name, both in measured.items()}
