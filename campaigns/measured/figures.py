from plays import documents


def figures(raw):
    each = documents(raw)
    heldout, diagnosis = each["sample"]["heldout"], each["diagnose"]
    extended = diagnosis["extended"] or {}
    after = extended.get("rmse_heldout_um")
    rouse, helps = each["rouse.extend"], each["rouse.diagnose"]["verdict"]["effects"]
    named = {own["name"].split(".")[-1]: own for own in rouse["parameters"]}

    def errors(learned):
        each = [learned[which]["rmse_heldout_um"] for which in ("base", "learned", "with_formula") if learned[which]]
        return " ".join(f"{own:.3g}" for own in each) + " µm"

    whole, of_five, learnt = (each[name] for name in ("rouse.learn", "rouse.learn-of-five", "rouse.learnt"))

    def rate(learned):
        return learned["formula"]["parameters"][0] if learned["formula"] else dict.fromkeys(("value", "q05", "q95"), 0.0)

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
        "springpot: learnt": f"{whole['verdict']['quantity']} by {whole['verdict']['state']}, {whole['formula']['text'] if whole['formula'] else 'no formula'}",
        "springpot: the formula's first rate, per µm": " ".join(f"{1e-6 * rate(whole)[key]:.3g}" for key in ("value", "q05", "q95")),
        "springpot: held-out error without, as learnt, by the formula": errors(whole),
        "springpot: the formula added by extend": " ".join(
            f"{learnt[which]['rmse_heldout_um']:.3g} µm" for which in ("before", "after")
        ),
        "springpot: learnt from cycles 1 to 5": f"{of_five['verdict']['quantity']} by {of_five['verdict']['state']}, {of_five['formula']['text'] if of_five['formula'] else 'no formula'}",
        "springpot: cycles 6 to 10 without, as learnt, by the formula": errors(of_five),
        "springpot: order, with softening": interval("chromatin_order"),
        "springpot: softening's rate, 1e-4 per s": interval("rate_per_s", 1e4),
    }, {"verdict": diagnosis["verdict"], "noise_um": diagnosis["base"]["noise_um"]}
