"""Every measured figure of README.md and docs/ names the campaign or the test that it comes from, and says what that found.

A block (paragraph, list item, table row) that states a figure with a unit, a count out of many, or a power of ten has to name `campaigns/NAME` or a test file,
or to be marked as no measurement: a definition, a setting, a number of somebody else's (<!-- given -->, at its end). What names a campaign may use only numbers
that stand among the figures of its result.json.
"""

import json
import pathlib
import re
import sys

root = pathlib.Path(__file__).resolve().parents[2]
FIGURE = re.compile(
    r"\d\s?(?:%|×|µs|ms|s|min|h|µm|mm|nm|nats|GB|MB|Pa)(?![\w·/])|\d of [\d,]+|10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+(?!\w)"
)
CAMPAIGN = re.compile(r"campaigns/([a-z][a-z-]*)")
TEST = re.compile(r"\b((?:crates/\w+/(?:src|tests)|(?<!/)tests|(?<!/)src)/[\w/]+\.(?:rs|py))")
NUMBER = re.compile(r"\d[\d,]*(?:\.\d+)?(?:·10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)?")
GIVEN = "<!-- given -->"


def blocks(text):
    """Paragraphs, list items and table rows outside code, with the number of their first line."""
    block, first, fenced = [], 0, False
    for number, line in enumerate([*text.splitlines(), ""], 1):
        if line.startswith("```"):
            fenced = not fenced
            line = ""
        if fenced or line.startswith("#"):
            line = ""
        starts = re.match(r"\s*(?:[-*|]|\d+\.) ?", line)
        if block and (not line.strip() or starts):
            yield first, " ".join(block)
            block = []
        if line.strip():
            if not block:
                first = number
            block.append(line.strip())


def shown(block):
    """What a reader sees: without targets of links, code and comments."""
    block = re.sub(r"<!--.*?-->", "", block)
    block = re.sub(r"\]\([^)]*\)", "]", block)
    return re.sub(r"`[^`]*`", "", block)


def complaints(name, number, block):
    """What is wrong with a block."""
    place = f"{name}:{number}"
    if GIVEN in block or not FIGURE.search(shown(block)):
        return
    campaigns, tests = CAMPAIGN.findall(block), TEST.findall(block)
    if not campaigns and not tests:
        yield f"{place}: names neither campaign nor test: {block[:120]}"
    for test in tests:
        path = root / test
        if not path.is_file():
            yield f"{place}: there is no {test}"
        elif path.suffix == ".rs" and "#[test]" not in path.read_text(encoding="utf-8"):
            yield f"{place}: {test} has no test"
    known = set()
    for campaign in campaigns:
        path = root / "campaigns" / campaign / "result.json"
        if not path.is_file():
            yield f"{place}: campaign {campaign} has no result.json"
            continue
        result = json.loads(path.read_text(encoding="utf-8"))
        known.update(*(NUMBER.findall(text) for text in result["figures"].values()))
    if campaigns and not tests:
        stated = block.strip("| ").split(" | ")[1] if block.startswith("|") else shown(block)
        for figure in NUMBER.findall(shown(stated)):
            if figure not in known:
                yield f"{place}: {figure} is not among the figures of {', '.join(campaigns)}: {block[:120]}"


def main():
    paths = [root / "README.md", *sorted((root / "docs").glob("*.md"))]
    found = [
        complaint
        for path in paths
        for number, block in blocks(path.read_text(encoding="utf-8"))
        for complaint in complaints(path.relative_to(root), number, block)
    ]
    print("\n".join(found) or "every figure names its source")
    return bool(found)


# The rules, on a text with one fault each.
assert [b for _, b in blocks("a 3 s\nb\n\n- c\n- d\n\n```\n5 s\n```\n| x | 4 µm |\n| y | 5 µm |")] == [
    "a 3 s b", "- c", "- d", "| x | 4 µm |", "| y | 5 µm |",
]
assert list(complaints("here", 1, "It takes 5 s.")) and list(complaints("here", 1, "errors of 9·10⁻⁵"))
assert not list(complaints("here", 1, f"It takes 5 s. {GIVEN}")) and not list(complaints("here", 1, "Three cycles of `5 s`."))
assert list(complaints("here", 1, "It takes 5 s (tests/no_such_test.rs)."))
sys.exit(main())
