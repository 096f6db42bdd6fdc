from plays import documents

NM_PER_UM = 1e3


def nm(um):
    """`12 nm`; two digits."""
    return "–" if um is None else f"{NM_PER_UM * um:.2g} nm"


def figures(raw):
    each = documents(raw)
    found, counts = {}, {}
    for label, document in each.items():
        heldout = document["heldout"]
        found[f"{label}: fitted"] = nm(heldout["rmse_fitted_um"])
        found[f"{label}: last second"] = nm(heldout["rmse_um"])
        counts[label] = {own["name"]: own["median"] for own in document["parameters"]} | {"converged": document["converged"]}
    return found, counts
