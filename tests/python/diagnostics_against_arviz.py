"""R-hat, ESS, MCSE and autocorrelation time of this crate against ArviZ's, to 1 %, on identical arrays.

Run from the repository's root; needs numpy and arviz (0.23).
"""

import json
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path

import numpy as np

warnings.simplefilter("ignore")
import arviz as az  # noqa: E402

TOLERANCE = 0.01


def autoregressive(rng, coefficient, shape, innovations=None):
    """AR(1) chains with standard normal (or given) innovations."""
    steps = rng.standard_normal(shape) if innovations is None else innovations
    chains = np.empty(shape)
    chains[:, 0] = steps[:, 0]
    for t in range(1, shape[1]):
        chains[:, t] = coefficient * chains[:, t - 1] + np.sqrt(1 - coefficient**2) * steps[:, t]
    return chains


def arrays():
    """Named (chain, draw) arrays: slow, antithetic, heavy-tailed, shifted, scaled, tied, odd and short ones."""
    rng = np.random.default_rng(20240607)
    yield "independent", rng.standard_normal((4, 1000))
    yield "ar1_0.9", autoregressive(rng, 0.9, (4, 2000))
    yield "ar1_0.99", autoregressive(rng, 0.99, (8, 3000))
    yield "antithetic_-0.5", autoregressive(rng, -0.5, (4, 1000))
    yield "antithetic_-0.95", autoregressive(rng, -0.95, (4, 1001))
    yield "cauchy", rng.standard_cauchy((4, 1500))
    yield "heavy_ar", autoregressive(rng, 0.7, (4, 1200), rng.standard_t(3, (4, 1200)))
    yield "shifted_chain", autoregressive(rng, 0.5, (4, 800)) + np.array([0, 0, 0, 0.5])[:, None]
    yield "scaled_chain", rng.standard_normal((4, 999)) * np.array([1, 1, 1, 3])[:, None]
    yield "tied", np.round(autoregressive(rng, 0.8, (3, 1000)) * 3)
    yield "trend", autoregressive(rng, 0.3, (4, 500)) + np.linspace(0, 1, 500)
    yield "short", rng.standard_normal((4, 21))
    yield "two_chains_log_normal", np.exp(2 * autoregressive(rng, 0.6, (2, 777)))


def expected(values):
    """Values by ArviZ."""
    ess_mean = float(az.ess(values, method="mean"))
    return {
        "rhat": float(az.rhat(values)),
        "ess_bulk": float(az.ess(values, method="bulk")),
        "ess_tail": float(az.ess(values, method="tail")),
        "ess_mean": ess_mean,
        "mcse_mean": float(az.mcse(values, method="mean")),
        "autocorrelation_time": values.size / ess_mean,
    }


def main():
    named = list(arrays())
    with tempfile.TemporaryDirectory() as directory:
        paths = []
        for name, values in named:
            path = Path(directory) / f"{name}.csv"
            chain, draw = np.meshgrid(*map(np.arange, values.shape), indexing="ij")
            rows = (f"{c},{d},{float(x)!r}" for c, d, x in zip(chain.ravel(), draw.ravel(), values.ravel()))
            path.write_text("chain,draw,value\n" + "\n".join(rows) + "\n")
            paths.append(str(path))
        command = ["cargo", "run", "--quiet", "--example", "diagnose_draws", "--", *paths]
        lines = subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()
    worst, where, failures = 0.0, "", []
    for (name, values), line in zip(named, lines, strict=True):
        found = json.loads(line)
        for key, value in expected(values).items():
            difference = abs(found[key] / value - 1)
            if not difference <= worst:
                worst, where = difference, f"{key} of {name}"
            if not difference <= TOLERANCE:
                failures.append(f"{key} of {name}: {found[key]} against {value}")
    print(f"diagnostics against ArviZ {az.__version__}: {len(named)} arrays, largest difference {worst:.1e} ({where})")
    if failures:
        print("\n".join(failures))
        sys.exit(1)


if __name__ == "__main__":
    main()
