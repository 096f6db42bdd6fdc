import json
import pathlib


def figures(raw):
    mutants = json.loads((raw / "mutants.json").read_text(encoding="utf-8"))["mutants"]
    reasons = json.loads((pathlib.Path(__file__).parent / "reasons.json").read_text(encoding="utf-8"))
    tested = [mutant for mutant in mutants if mutant["compiles"]]
    survivors = [mutant for mutant in tested if mutant["outcome"] == "survived"]
    for survivor in survivors:
        survivor["reason"] = reasons.get(f"{survivor['file']}: {survivor['before']} -> {survivor['after']}", "")
    equivalent = sum(bool(survivor["reason"]) for survivor in survivors)
    killed = len(tested) - len(survivors)
    found = {
        "mutants killed": f"{killed} of {len(tested)}",
        "killed or changing nothing": f"{killed + equivalent} of {len(tested)}",
    }
    for stage in ("own tests", "other tests"):
        found[f"killed by {stage}"] = str(sum(mutant.get("stage") == stage for mutant in tested))
    return found, {"tested": tested, "not compiled": len(mutants) - len(tested)}
