import re


def figures(raw):
    # A test that fails ends the campaign.
    passed = [name for path in sorted(raw.glob("*.txt")) for name in re.findall(r"^test (\S+) \.\.\. ok$", path.read_text(encoding="utf-8"), re.M)]
    return {"long tests passed": f"{len(passed)}"}, {"passed": passed}
