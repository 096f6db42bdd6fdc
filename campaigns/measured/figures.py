from plays import documents


def figures(raw):
    each = documents(raw)
    heldout, diagnosis = each["sample"]["heldout"], each["diagnose"]
    extended = diagnosis["extended"] or {}
    after = extended.get("rmse_heldout_um")
    rouse, helps = each["rouse.extend"], each["rouse.diagnose"]["verdict"]["effects"]
    named = {own["name"].split(".")[-1]: own for own in rouse["parameters"]}

    def interval(name, scale=1):
        own = named[name]
        return " ".join(f"{scale * own[key]:.3g}" for key in ("median", "q05", "q95"))

    return {
        "sample: held-out error": f"{heldout['rmse_um']:.2g} µm, {heldout['rmse_um'] / heldout['noise_um']:.0f} times the noise",
        "diagnose: before": f"{diagnosis['base']['rmse_heldout_um']:.2g} µm",
        "diagnose: with what helps": f"{after:.2g} µm" if after else "–",
        "springpot: what helps": ", ".join(helps),
        "springpot: held-out error before and after": " ".join(
            f"{rouse[which]['rmse_heldout_um']:.2f} µm" for which in ("before", "after")
        ),
        "springpot: order, with softening": interval("chromatin_order"),
        "springpot: softening's rate, 1e-4 per s": interval("rate_per_s", 1e4),
    }, {"verdict": diagnosis["verdict"], "noise_um": diagnosis["base"]["noise_um"]}
