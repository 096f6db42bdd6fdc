from statistics import median

from plays import documents, of


def figures(raw):
    cases = [case for document in documents(raw).values() for case in document]
    found = {"converged": of(sum(case["converged"] for case in cases), len(cases))}
    for name, symbol in [("young_modulus_pa", "E"), ("viscosity_1_pa_s", "c1"), ("viscosity_2_pa_s", "c2")]:
        own = [p for case in cases for p in case["parameters"] if p["name"] == name]
        ratios = sorted(p["realised"] / p["expected"] for p in own)
        found[f"{symbol}: realised over expected standard deviation, median"] = f"{median(ratios):.3f}"
        found[f"{symbol}: realised within 10 % of the expected"] = of(sum(abs(r - 1) <= 0.1 for r in ratios), len(ratios))
        gains = [p["realised"] / p["now"] for p in own]
        found[f"{symbol}: realised standard deviation over that of the first record, median"] = f"{median(gains):.2f}"
        found[f"{symbol}: truth within 1.645 realised standard deviations"] = of(sum(abs(p["error_over_sd"]) < 1.645 for p in own), len(own))
    return found, {"cases": len(cases)}
