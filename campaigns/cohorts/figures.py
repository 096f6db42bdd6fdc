"""What was said of hidden cohorts. Their documents are LABEL.NUMBER.json, what was hidden in each record LABEL.NUMBER.truth."""

import json
from statistics import median

from plays import count, of


def cohorts(raw, label):
    """Documents of a sort, each with the truths of its records."""
    found = []
    for path in sorted(raw.glob(f"{label}.*.json")):
        truths = json.loads(path.with_suffix(".truth").read_text(encoding="utf-8"))
        found.append((json.loads(path.read_text(encoding="utf-8")), truths))
    return found


def hidden(truths):
    """Slugs that are hidden in any record."""
    return {effect["slug"] for truth in truths for effect in truth["effects"]}


def in_class(cohort):
    """Whether what is hidden is claimed, or called equivalent to the claim."""
    document, truths = cohort
    verdict = document["verdict"]
    return bool(hidden(truths)) and hidden(truths) <= set(verdict["effects"]) | set(verdict["equivalent"])


def is_itself(cohort):
    """Whether what is hidden is claimed by its own name."""
    document, truths = cohort
    return hidden(truths) == set(document["verdict"]["effects"])


def n_in_class(cohort):
    """Effects that are claimed or called equivalent to the claim."""
    verdict = cohort[0]["verdict"]
    return len(verdict["effects"]) + len(verdict["equivalent"])


def is_claim(cohort):
    """Whether an effect was claimed."""
    return cohort[0]["verdict"]["kind"] == "missing"


def share_is_near(cohort):
    """Whether the share of the claim is within 0.2 of a half."""
    groups = cohort[0]["groups"]
    return bool(groups) and all(abs(group["share"] - 0.5) <= 0.2 for group in groups)


def is_stated(cohort):
    """Whether the two species are said to differ."""
    return any(contrast["is_declared"] for contrast in cohort[0]["contrasts"])


def figures(raw):
    """Figures and counts of the campaign."""
    sorts = {label: cohorts(raw, label) for label in ("each", "half", "twice", "alike", "none", "field")}
    each, half, twice, alike, none, field = sorts.values()
    found = [cohort for cohort in half if in_class(cohort)]
    with_class = [cohort for cohort in each if in_class(cohort)]
    words = {
        "2 σ in each of 20 records: in class": count(each, in_class),
        "and claimed by its own name": count(each, is_itself),
        "effects of such a class, the median": f"{median(n_in_class(cohort) for cohort in with_class):.0f}",
        "in class, without softening": count([cohort for cohort in each if hidden(cohort[1]) != {"softening"}], in_class),
        "4 σ in half of them: in class": count(half, in_class),
        "share within 0.2 where it was found": count(found, share_is_near),
        "twice as large in one species: stated": count(twice, is_stated),
        "as large in both: stated": count(alike, is_stated),
        "nothing hidden: claims": count(none, is_claim),
        "an effect that changes the field, 4 σ in one of two species: in class": count(field, in_class),
        "and the species said to differ": count(field, is_stated),
    }
    said = {}
    for label, found_of in sorts.items():
        for document, truths in found_of:
            key = f"{label}: {'+'.join(sorted(hidden(truths))) or 'none'} -> {'+'.join(document['verdict']['effects']) or document['verdict']['kind']}"
            said[key] = said.get(key, 0) + 1
    return words, dict(sorted(said.items())) | {"cohorts": of(len(each), len(each))}
