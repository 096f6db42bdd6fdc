from plays import documents

NM_PER_UM = 1e3


def nm(um):
    """`12 nm`; two digits."""
    return "–" if um is None else f"{NM_PER_UM * um:.2g} nm"


def figures(raw):
    each = documents(raw)
    found, counts = {}, {}
    for label, document in each.items():
        # A posterior's document, or that of a fit.
        heldout = document.get("heldout")
        fitted, last = (heldout["rmse_fitted_um"], heldout["rmse_um"]) if heldout else (document["rmse_um"], document["rmse_heldout_um"])
        found[f"{label}: fitted"] = nm(fitted)
        found[f"{label}: last second"] = nm(last)
        values = {own["name"]: own["median"] if heldout else own["value"] for own in document["parameters"]}
        counts[label] = values | {"converged": document["converged"]}
    return found, counts
