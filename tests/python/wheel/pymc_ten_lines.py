"""Runs the PyMC example of docs/python.md, without its progress bar, and compares the posterior with that of the program's own sampler.

The two samplers share only the density. With more than 2,500 effective draws each, means differ by a fiftieth of a standard deviation, and standard deviations by a fiftieth of
their values. Fewer than 1 of 1,000 runs exceed the bounds of 0.1 sd and 8 % by chance.
"""

import os
from pathlib import Path

import numpy as np
import pymc as pm

import vitreo_uq as vu


def main():
    page = (Path(os.environ["VITREO_UQ_SOURCE"]) / "docs/python.md").read_text(encoding="utf-8")
    lines = page.partition("## PyMC in ten lines")[2].partition("```python\n")[2].partition("```")[0]
    assert len([line for line in lines.splitlines() if line.strip()]) <= 10, "more than ten lines"
    assert "cores" not in lines and "pm.sample(" in lines
    # The example starts processes and needs a guard in scripts. Here the chains run one after another, with a seed.
    quiet = lines.replace("pm.sample(", "pm.sample(cores=1, progressbar=False, random_seed=7, ")
    names = {}
    exec(compile(quiet, "docs/python.md", "exec"), names)  # noqa: S102
    draws = names["draws"].posterior["theta"].values.reshape(-1, len(names["model"].names))
    statistics = pm.stats.summary(names["draws"])
    assert float(np.max(statistics["r_hat"])) < 1.01, statistics
    document = vu.sample(out="study", seed=5)
    assert document["converged"]
    parameters = {own["name"]: own for own in document["parameters"]}
    worst_mean = worst_sd = 0.0
    for name, column in zip(names["model"].names, draws.T):
        own = parameters[name]
        worst_mean = max(worst_mean, abs(column.mean() - own["mean"]) / own["sd"])
        worst_sd = max(worst_sd, abs(column.std(ddof=1) / own["sd"] - 1))
    assert worst_mean < 0.1, worst_mean
    assert worst_sd < 0.08, worst_sd
    print(f"means to {worst_mean:.3f} sd, standard deviations to {100 * worst_sd:.1f} %")


if __name__ == "__main__":
    main()
