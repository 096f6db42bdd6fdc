import re


def figures(raw):
    # A test that fails ends the campaign.
    passed = re.findall(r"^test (\S+) \.\.\. ok$", (raw / "tests.txt").read_text(encoding="utf-8"), re.M)
    return {"long tests passed": f"{len(passed)}"}, {"passed": passed}
