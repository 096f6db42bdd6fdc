import re


def figures(raw):
    text = {path.stem: path.read_text(encoding="utf-8") for path in sorted(raw.glob("*.txt")) if path.stem != "commands"}
    spheres = re.findall(r"^(\d+) unknowns, ν = ([\d.]+): (\S+)$", text["fe_exact"], re.M)
    reduced = re.findall(r"^(\S+)\s+reduced against full: (\S+) of the amplitude$", text["effects_kernels"], re.M)
    passed = sum(int(n) for own in text.values() for n in re.findall(r"test result: ok\. (\d+) passed", own))
    return {
        **{f"sphere, {unknowns} unknowns, ν = {ratio}": error for unknowns, ratio, error in spheres},
        **{f"{slug}, reduced against full": error for slug, error in reduced},
    }, {"tests passed": passed}
