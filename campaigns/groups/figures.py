from plays import documents


def figures(raw):
    document = documents(raw)["cohort"]
    words = {}
    for own in document["contrasts"]:
        name = f"{own['parameter']}: {own['a']} over {own['b']}"
        words[name] = f"{own['ratio_median']:.1f} × ({own['q05']:.1f}–{own['q95']:.1f})"
    return words, {"margin": document["margin"]}
