from plays import documents


def figures(raw):
    each = documents(raw)
    heldout, diagnosis = each["sample"]["heldout"], each["diagnose"]
    extended = diagnosis["extended"] or {}
    after = extended.get("rmse_heldout_um")
    return {
        "sample: held-out error": f"{heldout['rmse_um']:.2g} µm, {heldout['rmse_um'] / heldout['noise_um']:.0f} times the noise",
        "diagnose: before": f"{diagnosis['base']['rmse_heldout_um']:.2g} µm",
        "diagnose: with what helps": f"{after:.2g} µm" if after else "–",
    }, {"verdict": diagnosis["verdict"], "noise_um": diagnosis["base"]["noise_um"]}
