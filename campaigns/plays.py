"""Counts over the documents of `challenge run`."""

import json


def documents(raw):
    """Every document of a campaign, by label."""
    return {path.stem: json.loads(path.read_text(encoding="utf-8")) for path in sorted(raw.glob("*.json"))}


def plays(raw):
    """All plays, of all documents."""
    return [play for document in documents(raw).values() for play in document["plays"]]


def of(part, whole):
    """`3 of 1,600`."""
    return f"{part:,} of {whole:,}"


def count(plays, is_so):
    """How many of some plays are so, in words."""
    return of(sum(map(bool, map(is_so, plays))), len(plays))


def effects(play):
    """The hidden effects."""
    return [effect["slug"] for effect in play["truth"]["effects"]]


def in_class(play):
    """Whether every hidden effect is in the reported class."""
    return set(effects(play)) <= set(play["class"])


def is_claim(play):
    """Whether an effect was claimed."""
    return play["said"] not in ("none", "unexplained", "failed")


def mean(values):
    """Mean, with one digit after the point; a dash for nothing."""
    values = list(values)
    return f"{sum(values) / len(values):.1f}" if values else "–"


def said(plays):
    """What was said how often, for the record."""
    counts = {}
    for play in plays:
        key = f"{play['label']} -> {play['said']}"
        counts[key] = counts.get(key, 0) + 1
    return dict(sorted(counts.items()))
