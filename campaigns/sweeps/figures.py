"""What `diagnose` said of sweeps of known truth."""

import json


def figures(raw):
    plays = [json.loads(line) for path in sorted(raw.glob("*.txt")) for line in path.read_text(encoding="utf-8").splitlines()]

    def share(kinds, is_so):
        own = [play for play in plays if play["kind"] in kinds]
        return f"{sum(map(is_so, own))} of {len(own)}"

    return {
        "nothing hidden: an effect is claimed": share(["plain", "stated"], lambda play: play["verdict"] == "missing"),
        "nothing hidden: called unexplained": share(["plain", "stated"], lambda play: play["verdict"] == "unexplained"),
        "a spring in series hidden: in the class": share(["spring"], lambda play: play["hidden"] in play["named"]),
        "a second body hidden: in the class": share(["body"], lambda play: play["hidden"] in play["named"]),
        "something hidden: called none": share(["spring", "body"], lambda play: play["verdict"] == "none"),
    }, {"plays": plays}
