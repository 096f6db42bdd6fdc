"""emcee on the posterior that `peers prepare DIR` wrote there: stretch, and 0.8 differential evolution + 0.2 snooker, vectorised over walkers."""

import csv
import sys
import time
from pathlib import Path

import emcee
import numpy as np


def table(path):
    with open(path, newline="") as file:
        rows = list(csv.reader(file))
    return np.array(rows[1:], dtype=float)


def main(folder):
    record, priors, starts = (table(folder / name) for name in ("record.csv", "priors.csv", "starts.csv"))
    (compliance_per_m, n_steps), = table(folder / "constants.csv")
    time_s, force_n, position_m = record.T
    log_median, log_sd = np.log(priors[:, 0]), priors[:, 1]
    # Times since the force steps, where they are past: one column a step.
    steps = np.flatnonzero(np.diff(force_n, prepend=0.0))
    changes_n = np.diff(force_n, prepend=0.0)[steps]
    since_s = np.maximum(time_s[:, None] - time_s[steps][None, :], 0.0)
    flow = since_s @ changes_n

    def log_density(z):
        young, viscosity_1, viscosity_2, noise_um = np.exp(z).T
        noise_m = 1e-6 * noise_um
        decay = np.exp(-(young / viscosity_1)[:, None, None] * since_s[None])
        retarded = (1.0 - decay) @ changes_n
        position = compliance_per_m * (retarded / young[:, None] + flow[None, :] / viscosity_2[:, None])
        squares = ((position_m - position) ** 2).sum(axis=1)
        prior = (((z - log_median) / log_sd) ** 2).sum(axis=1)
        return -0.5 * (squares / noise_m**2 + prior) - len(time_s) * np.log(noise_m)

    points, expected = starts[:, :4], starts[:, 4]
    found = log_density(points)
    found += expected[0] - found[0]
    np.testing.assert_allclose(found, expected, rtol=1e-8, err_msg="not the same posterior")

    moves = {
        "emcee-stretch": emcee.moves.StretchMove(),
        "emcee-de-snooker": [(emcee.moves.DEMove(), 0.8), (emcee.moves.DESnookerMove(), 0.2)],
    }
    for name, move in moves.items():
        np.random.seed(1)
        sampler = emcee.EnsembleSampler(len(points), 4, log_density, moves=move, vectorize=True)
        began = time.perf_counter()
        sampler.run_mcmc(points, int(n_steps))
        wall_s = time.perf_counter() - began
        chain = sampler.get_chain()
        (folder / f"{name}.csv").write_text(f"wall_s,n_evaluations\n{wall_s},{chain.shape[0] * chain.shape[1]}\n")
        chain.astype("<f8").tofile(folder / f"{name}.f64")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
