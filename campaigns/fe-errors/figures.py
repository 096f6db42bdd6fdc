import re

# The test harness prints a mark for a test that ended in front of the line that follows.
MARKS = r"^(?:[.i]*\.)?"


def figures(raw):
    text = {path.stem: path.read_text(encoding="utf-8") for path in sorted(raw.glob("*.txt")) if path.stem != "commands"}
    spheres = re.findall(MARKS + r"(\d+) unknowns, ν = ([\d.]+): (\S+)$", text["fe_exact"], re.M)
    # An effect is printed once for each protocol and law: the largest error counts.
    reduced = {}
    for slug, error in re.findall(MARKS + r"(\S+)\s+reduced against full: (\S+) of the amplitude$", text["effects_kernels"], re.M):
        reduced[slug] = max(reduced.get(slug, error), error, key=float)
    passed = sum(int(n) for own in text.values() for n in re.findall(r"test result: ok\. (\d+) passed", own))
    return {
        **{f"sphere, {unknowns} unknowns, ν = {ratio}": error for unknowns, ratio, error in spheres},
        **{f"{slug}, reduced against full": error for slug, error in reduced.items()},
    }, {"tests passed": passed}
