"""Counts over the documents of `challenge run`."""

import json


def documents(raw):
    """Every document of a campaign, by label."""
    return {path.stem: json.loads(path.read_text(encoding="utf-8")) for path in sorted(raw.glob("*.json"))}


def plays_by_label(raw):
    """All plays of each label, whose parts are called LABEL.FIRST."""
    found = {}
    for name, document in documents(raw).items():
        found.setdefault(name.partition(".")[0], []).extend(document["plays"])
    return found


def plays(raw):
    """All plays, of all documents."""
    return [play for own in plays_by_label(raw).values() for play in own]


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


def of_singles(raw):
    """Figures and counts of plays with one hidden effect each."""
    every = plays(raw)
    weak = [play for play in every if round(min(effect["signal_sigma"] for effect in play["truth"]["effects"])) <= 5]
    named = [play for play in every if in_class(play) and play["heldout_over_true_noise"] is not None]
    sized = [play for play in every if play["size_covered"] is not None]
    claims = [play for play in every if is_claim(play)]
    return {
        "in class": count(every, in_class),
        "in class at 5 σ": count(weak, in_class),
        "in class at 10 σ and more": count([play for play in every if play not in weak], in_class),
        "size of the class": mean(len(play["class"]) for play in claims),
        "size by definition": mean(len(play["truth"]["ideal_class"]) for play in claims),
        "held-out error at most 1.1 × the true noise": count(named, lambda play: play["heldout_over_true_noise"] <= 1.1),
        "size inside its 90 % interval": count(sized, lambda play: play["size_covered"]),
    }, said(every) | {"effects": sorted({slug for play in every for slug in effects(play)})}
