"""What was said of robots that move by several radii: by how strong the signal was, as the gain of the effect says."""

import json
import statistics

from plays import of

SLUG = "large-displacement"


def covered(records, name):
    """How often a parameter's 90 % interval holds the truth."""
    own = [p for record in records for p in record["parameters"] if p["name"] == name]
    return of(sum(p["q05"] <= p["truth"] <= p["q95"] for p in own), len(own))


def bias(records, key, name):
    """The median of what a posterior's mean is away from the truth by, in per cent of it, with the middle 80 %."""
    own = sorted(100 * (p["mean"] / p["truth"] - 1) for record in records for p in record[key] if p["name"] == name)
    return f"{statistics.median(own):+.2f} % ({own[len(own) // 10]:+.2f} to {own[-1 - len(own) // 10]:+.2f})" if own else "none"


def figures(raw):
    every = [record for path in sorted(raw.glob("records.*.txt")) for record in json.loads(path.read_text(encoding="utf-8"))["records"]]
    records = [record for record in every if "failure" not in record]
    named = [record for record in records if SLUG in record["effects"] + record["equivalent"]]
    shown = [record for record in records if (record["gain_nats"] or 0.0) >= 12.0]
    claims = [record for record in records if record["kind"] == "effect"]
    told = {
        "failed": of(len(every) - len(records), len(every)),
        "in class": of(len(named), len(records)),
        "in class where it gains 12 nats and more": of(sum(record in named for record in shown), len(shown)),
        "held-out error at most 1.1 × the noise where it is named": of(
            sum(record["rmse_heldout_um"] <= 1.1 * record["noise_um"] for record in named if record["rmse_heldout_um"]),
            sum(bool(record["rmse_heldout_um"]) for record in named),
        ),
        "other claims": of(sum(record not in named for record in claims), len(claims)),
        "converged": of(sum(record["converged"] for record in records), len(records)),
    }
    names = [p["name"] for p in records[0]["parameters"][:3]] + [f"{SLUG}.amplitude"]
    told |= {f"90 % interval of {name}": covered(records, name) for name in names}
    far = [record for record in records if record["radii"] == 3.6]
    told |= {f"{name} away from the gel's at 3.6 radii, small strains": bias(far, "linear", name) for name in names[:3]}
    told |= {f"{name} away from the gel's at 3.6 radii, with the effect": bias(far, "parameters", name) for name in names}
    counts = {}
    for record in records:
        key = f"{record['protocol']}, {record['radii']} radii, {record['noise_um']:g} µm"
        said = "+".join(record["effects"]) or record["kind"]
        counts.setdefault(key, {}).setdefault(said, 0)
        counts[key][said] += 1
    return told, counts
