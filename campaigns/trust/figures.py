from plays import count, documents

FAR = 3


def figures(raw):
    cases = [case for document in documents(raw).values() for case in document]
    found = {}
    for kind in sorted({case["kind"] for case in cases if not case["sigma"]}):
        found[f"clean, {kind}: told of a pattern"] = count([case for case in cases if case["kind"] == kind], lambda case: case["pattern"])
    for sigma in sorted({case["sigma"] for case in cases if case["sigma"]}):
        hidden = [case for case in cases if case["sigma"] == sigma]
        far = [case for case in hidden if case["bias"] > FAR]
        found[f"misfit of {sigma} σ: a parameter off by more than {FAR} standard deviations"] = count(hidden, lambda case: case["bias"] > FAR)
        found[f"of these, trusted at {sigma} σ"] = count(far, lambda case: case["level"] == "trusted")
    return found, {"kinds": sorted({case["kind"] for case in cases})}
