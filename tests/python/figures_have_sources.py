"""Every measured figure of README.md and docs/ names the campaign or the test that it comes from, and agrees with it.

A block is a paragraph, list item or table row. A block with a figure (a number with a unit, a count out of many, a power of ten) names `campaigns/NAME` or a test file.
A block that names a campaign uses only numbers among the figures of its result.json.
docs/given.txt lists the passages whose figures are no measurements: definitions, settings, figures of others.
A line holds a file, a tab and the exact words of a passage with its figure.
A passage that matches no text, or has no number, is a fault.
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
GIVEN = "docs/given.txt"


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


def given(lines):
    """Passages of the side file, by the file that they stand in."""
    passages = {}
    for line in lines:
        name, _, passage = line.partition("\t")
        passages.setdefault(name, []).append(passage)
    return passages


def occurrence(passage):
    """Pattern of a passage that does not begin or end inside a number or a word."""
    return re.compile(r"(?<![\w.,])" + re.escape(passage) + r"(?!\w)")


def unused(name, passages, text):
    """Faults of the side file: passages without a number, or that a text lacks."""
    whole = [block for _, block in blocks(text)]
    for passage in passages:
        if not NUMBER.search(passage):
            yield f"{GIVEN}: the passage for {name} has no number: {passage!r}"
        elif not any(occurrence(passage).search(block) for block in whole):
            yield f"{GIVEN}: {name} has no such passage; correct or remove the line: {passage!r}"


def complaints(name, number, block, passages=()):
    """Faults of a block."""
    place = f"{name}:{number}"
    for passage in passages:
        block = occurrence(passage).sub("", block)
    if not FIGURE.search(shown(block)):
        return
    campaigns, tests = CAMPAIGN.findall(block), TEST.findall(block)
    if not campaigns and not tests:
        yield f"{place}: names neither campaign nor test, and {GIVEN} does not list it: {block[:120]}"
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
        stated = " | ".join(block.split("|")[2:-2]) if block.startswith("|") else block
        for figure in NUMBER.findall(shown(stated)):
            if figure not in known:
                yield f"{place}: {figure} is not among the figures of {', '.join(campaigns)}: {block[:120]}"


def main():
    paths = [root / "README.md", *sorted((root / "docs").glob("*.md"))]
    texts = {path.relative_to(root).as_posix(): path.read_text(encoding="utf-8") for path in paths}
    passages = given((root / GIVEN).read_text(encoding="utf-8").splitlines())
    found = [
        complaint
        for name, text in texts.items()
        for number, block in blocks(text)
        for complaint in complaints(name, number, block, passages.get(name, ()))
    ]
    found += [complaint for name, listed in passages.items() for complaint in unused(name, listed, texts.get(name, ""))]
    print("\n".join(found) or "every figure names its source")
    return bool(found)


# The rules, on a text with one fault each.
assert [b for _, b in blocks("a 3 s\nb\n\n- c\n- d\n\n```\n5 s\n```\n| x | 4 µm |\n| y | 5 µm |")] == [
    "a 3 s b", "- c", "- d", "| x | 4 µm |", "| y | 5 µm |",
]
assert list(complaints("here", 1, "It takes 5 s.")) and list(complaints("here", 1, "errors of 9·10⁻⁵"))
assert not list(complaints("here", 1, "It takes 5 s.", ["takes 5 s"])) and not list(complaints("here", 1, "Three cycles of `5 s`."))
assert list(complaints("here", 1, "It takes 15 s.", ["5 s"])) and list(complaints("here", 1, "It takes 5 s, not 6 s.", ["takes 5 s"]))
assert given(["a.md\tfor 5 s"]) == {"a.md": ["for 5 s"]}
assert not list(unused("a.md", ["takes 5 s"], "It\ntakes 5 s.")) and len(list(unused("a.md", ["takes 6 s", "It takes"], "It takes 5 s."))) == 2
assert list(complaints("here", 1, "It takes 5 s (tests/no_such_test.rs)."))
sys.exit(main())
