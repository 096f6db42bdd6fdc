import json


def read(raw, kind):
    """Documents of a kind, each with its truth."""
    pairs = []
    for path in sorted(raw.glob(f"{kind}-*.truth.json")):
        document = json.loads(path.with_name(path.name.replace(".truth", "")).read_text(encoding="utf-8"))
        pairs.append((document, json.loads(path.read_text(encoding="utf-8"))))
    return pairs


def of(part, whole):
    return f"{part:,} of {whole:,}"


def is_learned(document):
    return document["verdict"]["kind"] == "learned"


def in_class(document, truth):
    verdict = document["verdict"]
    named = [verdict, *verdict["equivalent"]]
    return is_learned(document) and (truth["quantity"], truth["state"]) in [(own["quantity"], own["state"]) for own in named]


def between(points, state, key):
    """A column of the function's points at a state, by lines."""
    for one, other in zip(points, points[1:]):
        if one["state"] <= state <= other["state"]:
            share = (state - one["state"]) / (other["state"] - one["state"])
            return one[key] * (1 - share) + other[key] * share
    return None


def nearest(factors, state):
    """The true factor at a state, by lines between those that are listed."""
    return between([{"state": s, "factor": f} for s, f in sorted(dict(factors).items())], state, "factor")


def held(document, truth):
    """What the function errs by over the range of its factors, the share of states whose factor the band holds, and what the formula errs by, where there is one; None where the pair is another.

    Both are over their values at the function's reference state: a factor that all states share is a change of the quantity itself."""
    verdict, function = document["verdict"], document["function"]
    if function is None or (verdict["quantity"], verdict["state"]) != (truth["quantity"], truth["state"]):
        return None
    low, high = function["visited"]
    # A record's file has ten digits, the truth has more: the two ends of what was visited are ends in both.
    rounding = 1e-9 * max(abs(low), abs(high))
    seen = [(min(max(state, low), high), factor) for state, factor in truth["factors"] if low - rounding <= state <= high + rounding]
    at_reference = nearest(truth["factors"], function["reference_state"])
    if not seen or at_reference is None:
        return None
    seen = [(state, factor / at_reference) for state, factor in seen]
    factors = [factor for _, factor in seen]
    points = function["points"]

    def error(key):
        # Nine states of ten: at the ends a state is visited by a row or two.
        errors = sorted(abs(between(points, state, key) - factor) for state, factor in seen)
        return errors[len(errors) * 9 // 10] / (max(factors) - min(factors))

    if document["formula"] is not None:
        points = [{**point, "formula": factor} for point, factor in zip(points, document["formula"]["factors"])]
    inside = sum(between(points, s, "q05") <= factor <= between(points, s, "q95") for s, factor in seen) / len(seen)
    return error("factor"), inside, error("formula") if document["formula"] is not None else None


def preferred(raw):
    """Of records with one effect of the library hidden and something learnt: whether the library's effect, or one that the experiment cannot tell from it, is preferred; and how many such records there are."""
    told, hiding = [], 0
    for path in sorted(raw.glob("library-*.answer.json")):
        document = json.loads(path.with_name(path.name.replace(".answer", "")).read_text(encoding="utf-8"))
        truth = json.loads(path.read_text(encoding="utf-8"))["truth"]
        # `challenge new` also draws records with nothing hidden, and with effects that the library has not.
        hiding += bool(truth["effects"])
        if is_learned(document) and truth["effects"]:
            same = {own["slug"] for own in truth["effects"]} | set(truth["ideal_class"])
            told.append(bool(same & set(document["verdict"]["library"])))
    return told, hiding


def figures(raw):
    hidden, none = read(raw, "hidden"), read(raw, "none")
    strong = [(document, truth) for document, truth in hidden if truth["signal_sigma"] >= 20]
    # Slow noise and gains, which the stated size leaves out, hide much of some signals.
    seen = [own for own in hidden if own[1].get("seen_sigma", 0) >= 20]
    named = [own for own in strong if in_class(*own)]
    found = [own for own in (held(*own) for own in strong) if own is not None]
    functions = [own[:2] for own in found]
    formulas = [own[2] for own in found if own[2] is not None]
    learned = [(document, truth) for document, truth in hidden if is_learned(document)]
    returning = [own for own in learned if own[1]["state"] not in ("path", "time")]
    told, hiding = preferred(raw)

    def over_noise(document, truth, which):
        errors = document[which]
        return errors is not None and errors["rmse_heldout_um"] <= 1.15 * truth["true_noise_um"]

    return {
        "in class at 20 σ and more": of(len(named), len(strong)),
        "in class at 20 σ and more of all its noise": of(sum(in_class(*own) for own in seen), len(seen)),
        "learnt at all": of(len(learned), len(hidden)),
        "function within 10 % of its range, where the pair is right": of(sum(error <= 0.1 for error, _ in functions), len(functions)),
        "the formula, where there is one, within 10 % of the function's range": of(sum(error <= 0.1 for error in formulas), len(formulas)),
        "states whose factor the 90 % band holds": f"{100 * sum(inside for _, inside in functions) / max(1, len(functions)):.0f} %",
        "held-out error at most 1.15 × the true noise, of those learnt": of(sum(over_noise(*own, "learned") for own in learned), len(learned)),
        "the same by the formula, where there is one": of(
            sum(over_noise(*own, "with_formula") for own in learned), sum(document["with_formula"] is not None for document, _ in learned)
        ),
        "held-out error at most 1.15 × the true noise of what is written, the formula or else the function": of(
            sum(over_noise(*own, "with_formula" if own[0]["with_formula"] else "learned") for own in learned), len(learned)
        ),
        "the same, where the state comes back in the held-out cycle, as path and time do not": of(
            sum(over_noise(*own, "with_formula" if own[0]["with_formula"] else "learned") for own in returning), len(returning)
        ),
        "library effect hidden and something learnt: that effect preferred": of(sum(told), len(told)),
        "library effects hidden": f"{hiding:,}",
        "anything learnt where nothing is hidden": of(sum(is_learned(document) for document, _ in none), len(none)),
    }, {
        f"{truth['quantity']} by {truth['state']}, {truth['shape']}, {truth['noise']}, {truth['signal_sigma']:.0f} σ": document["verdict"]["sentence"]
        for document, truth in hidden
    }
