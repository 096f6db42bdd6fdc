"""What became of mutated files, and of valid variants."""

import json


def figures(raw):
    document = json.loads((raw / "mutated.txt").read_text(encoding="utf-8"))
    wrong = document["panicked"] + document["hung"] + document["wrongly_ended_through_the_program"]
    variants = json.loads((raw / "variants.txt").read_text(encoding="utf-8"))
    readers, count = variants["readers"], variants["count"]
    panicked = sum(len(reader["panicked"]) for reader in readers.values())
    accepted = {name: reader["outcomes"]["accepted"] for name, reader in readers.items()}
    least = min(accepted, key=accepted.get)
    told = {
        "inputs": f"{document['count']:,}",
        "wrong": f"{wrong} of {document['count']:,} panicked, hung or left something half-written",
        "slowest": f"{document['slowest_input_s']:.1f} s",
        "variants": f"{count:,} for each of {len(readers)} readers",
        "variants_wrong": f"{panicked} of {count * len(readers):,} panicked",
        "variants_slowest": f"{max(reader['slowest_s'] for reader in readers.values()):.1f} s",
        "variants_memory": f"{variants['largest_memory_mib']} MiB at most",
        "variants_accepted": f"{100 * sum(accepted.values()) / (count * len(readers)):.0f} %; "
        f"least of {least}: {100 * accepted[least] / count:.0f} %",
    }
    return told, {
        "seed": document["seed"],
        "readers": document["outcomes"],
        "seed_of_variants": variants["seed"],
        "variants": {name: reader["outcomes"] for name, reader in readers.items()},
    }
