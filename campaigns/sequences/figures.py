import statistics

from plays import documents, of


def figures(raw):
    cases = [case for document in documents(raw).values() for case in document]
    several = [case for case in cases if case["records"]]
    decided = [case for case in several if case["decided"]]
    right = [case for case in decided if case["records"][-1]["likeliest"] == case["hidden"]]
    sure = [case for case in several if case["records"][-1]["likeliest"] == case["hidden"] and case["records"][-1]["probability"] >= 0.95]
    needed = [len(case["records"]) - 1 for case in decided]
    found = {
        "records with several equivalent effects": of(len(several), len([case for case in cases if case["hidden"]])),
        "decided within ten designed records": of(len(decided), len(several)),
        "decided for the true effect": of(len(right), len(decided)),
        "true effect with a probability of at least 95 %": of(len(sure), len(several)),
        "designed records until the decision, median and most": f"{statistics.median(needed):g} and {max(needed)}" if needed else "none",
    }
    return found, {"classes": [[case["hidden"], case["class"], len(case["records"]) - 1] for case in several]}
