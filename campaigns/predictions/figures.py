from plays import documents, of


def figures(raw):
    cases = [case for document in documents(raw).values() for case in document]
    plans = [case for case in cases if case["promised"] >= 0.95]
    rows = sum(case["share_covered"] for case in cases) / len(cases)
    near = sum(0.90 <= case["checked"] <= 0.99 for case in plans)
    found = {
        "converged": of(sum(case["converged"] for case in cases), len(cases)),
        "position at the end inside the 90 % band": of(sum(case["end_is_covered"] for case in cases), len(cases)),
        "mean share of the times inside the 90 % band": f"{100 * rows:.1f} %",
        "plans with a force within the limits": of(len(plans), len(cases)),
        "plans of 95 % that the truth follows to the target": of(sum(case["truth_arrives"] for case in plans), len(plans)),
        "plans of 95 % whose frequency among 128 unused draws is 90 to 99 %": of(near, len(plans)),
        "mean frequency among unused draws": f"{100 * sum(case['checked'] for case in plans) / len(plans):.1f} %",
    }
    return found, {"cases": len(cases)}
