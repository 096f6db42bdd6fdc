"""What became of mutated files."""

import json


def figures(raw):
    document = json.loads((raw / "mutated.txt").read_text(encoding="utf-8"))
    wrong = document["panicked"] + document["hung"] + document["wrongly_ended_through_the_program"]
    told = {
        "inputs": f"{document['count']:,}",
        "wrong": f"{wrong} of {document['count']:,} panicked, hung or left something half-written",
        "slowest": f"{document['slowest_input_s']:.1f} s",
    }
    return told, {"seed": document["seed"], "readers": document["outcomes"]}
