"""Tests `vitreo-uq serve` with the official UM-Bridge client: supported features, values, gradients against differences. emcee samples `posterior` over HTTP and finds
the posterior of `vitreo-uq sample`.

Run from anywhere; needs umbridge, emcee, numpy.
"""

import csv
import json
import math
import os
import pathlib
import subprocess
import tempfile
import threading

import emcee
import numpy as np
import umbridge

import small_experiment

# Seeds of `sample` whose posteriors are pooled, so their Monte Carlo error is small compared with the tolerance.
SEEDS = range(1, 13)
WALKERS, BURN_IN, STEPS = 600, 150, 1700
# Tolerance in standard deviations. The check also prints the Monte Carlo error of the comparison, and fails if the tolerance is less than four of them.
TOLERANCE = 0.02
LAW = [3.4, 1.5, 45.0]
POINT = [*LAW, 4.2]


def start(folder, *arguments):
    """Starts a server on any free port, and yields its link."""
    program = os.environ.get("VITREO_UQ")
    root = small_experiment.ROOT
    command = [program] if program else ["cargo", "run", "--quiet", "--manifest-path", str(root / "Cargo.toml"), "--bin", "vitreo-uq", "--"]
    server = subprocess.Popen([*command, "serve", *arguments, "--port", "0", "--quiet"], cwd=folder, stdout=subprocess.PIPE, text=True)
    return server, server.stdout.readline().strip()


def closed_form_um(law):
    """The trajectory of tests/python/small_experiment.py by Lethersich's law."""
    young, viscosity_1, viscosity_2 = law

    def creep(time):
        return (1 - math.exp(-young * time / viscosity_1)) / young + time / viscosity_2 if time > 0 else 0.0

    rows = []
    for row in range(200):
        steps = ((5.0 * hold, 1.0 if hold == 0 else 2.0 * (-1) ** hold) for hold in range(row // 25 + 1))
        size = 1e6 * small_experiment.FORCE_N * small_experiment.COMPLIANCE_PER_M
        rows.append(size * sum(step * creep(0.2 * row - begin) for begin, step in steps))
    return np.array(rows)


def check_models(link):
    assert umbridge.supported_models(link) == ["trajectory", "posterior"]
    trajectory, posterior = (umbridge.HTTPModel(link, name) for name in ("trajectory", "posterior"))
    for model, inputs, outputs in ((trajectory, 3, 200), (posterior, 4, 1)):
        assert model.supports_evaluate() and model.supports_gradient() and model.supports_apply_jacobian()
        assert not model.supports_apply_hessian()
        assert model.get_input_sizes() == [inputs] and model.get_output_sizes() == [outputs]

    [position_um] = trajectory([LAW])
    worst = np.abs(np.array(position_um) - closed_form_um(LAW)).max()
    assert worst < 1e-9, worst

    # Gradients against differences of fourth order.
    sens = np.cos(np.arange(200.0)).tolist()
    worst = 0.0
    for model, point, weights in ((trajectory, LAW, sens), (posterior, POINT, [1.5])):
        gradient = np.array(model.gradient(0, 0, [point], weights))
        value = lambda x: float(np.dot(weights, model([x.tolist()])[0]))  # noqa: E731
        for d, slope in enumerate(gradient):
            step = np.zeros(len(point))
            step[d] = 1e-3 * point[d]
            at = lambda n: value(np.array(point) + n * step)  # noqa: B023, E731
            difference = (8 * (at(1) - at(-1)) - (at(2) - at(-2))) / (12 * step[d])
            worst = max(worst, abs(slope - difference) / (1 + abs(slope)))
        direction = [0.1, -0.2, 3.0, 0.3][: len(point)]
        along = np.dot(weights, model.apply_jacobian(0, 0, [point], direction))
        assert abs(along / np.dot(gradient, direction) - 1) < 1e-9
    assert worst < 1e-6, worst

    # The client's own messages for errors.
    for ask, words in (
        (lambda: trajectory([[1.0, 2.0]]), "InvalidInput"),
        (lambda: trajectory([[-1.0, 1.0, 1.0]]), "young_modulus_pa"),
        (lambda: trajectory([LAW], {"model": "full"}), "no full model"),
        (lambda: posterior.gradient(1, 0, [POINT], [1.0]), "outWrt"),
    ):
        try:
            ask()
        except Exception as error:  # the client raises nothing more special
            assert words in str(error), error
        else:
            raise AssertionError(f"{words} was not refused")
    assert posterior([[-1.0, 1.5, 45.0, 4.0]])[0][0] < -1e300, "outside the support"

    # Several clients at once.
    expected = [posterior([[2.0 + 0.1 * k, 1.5, 45.0, 4.0]]) for k in range(16)]
    found = [None] * 16

    def ask(k):
        found[k] = posterior([[2.0 + 0.1 * k, 1.5, 45.0, 4.0]])

    clients = [threading.Thread(target=ask, args=(k,)) for k in range(16)]
    [client.start() for client in clients]
    [client.join() for client in clients]
    assert found == expected
    return posterior, worst


def sampled_here(folder):
    """Means and standard deviations of logarithms by the draws of `sample`, pooled over seeds, with the standard errors of the means in standard deviations."""
    runs = []
    for seed in SEEDS:
        small_experiment.run(folder, "sample", "eye", "--out", f"study-{seed}", "--seed", seed, "--quiet", "--no-report")
        revision = pathlib.Path(folder) / f"study-{seed}/m0"
        document = json.loads((revision / "posterior.json").read_text())
        with (revision / "draws.csv").open(newline="") as file:
            draws = list(csv.DictReader(file))
        logarithms = [np.log([float(draw[p["name"]]) for draw in draws]) for p in document["parameters"]]
        errors = [p["mcse_mean"] / p["sd"] for p in document["parameters"]]
        runs.append([[own.mean(), own.std(), error * own.std()] for own, error in zip(logarithms, errors)])
    names = [p["name"] for p in document["parameters"]]
    mean, sd, mcse = np.moveaxis(np.array(runs), 2, 0)
    variance = (sd**2).mean(axis=0) + mean.var(axis=0)
    error = np.sqrt((mcse**2).sum(axis=0)) / len(runs)
    return names, mean.mean(axis=0), np.sqrt(variance), error / np.sqrt(variance)


def sampled_outside(posterior, start_at, spread):
    """Means and standard deviations by emcee over HTTP, half an ensemble's walkers per request. It moves in logarithms, where the ridges of the law are straight."""

    def ln_posterior(logarithms):
        points = np.exp(logarithms)
        [values] = posterior([points.ravel().tolist()], {"points": len(points)})
        # The density of logarithms has the factor |dx/d ln x| = x.
        return np.array(values) + logarithms.sum(axis=1)

    rng = np.random.default_rng(4242)
    first = start_at + 0.3 * spread * rng.standard_normal((WALKERS, len(start_at)))
    # emcee's snooker move is not used: its factor has half of the exponent d - 1, and a tenth of such moves makes every spread 3 % too small.
    moves = [(emcee.moves.DEMove(), 0.9), (emcee.moves.StretchMove(), 0.1)]
    sampler = emcee.EnsembleSampler(WALKERS, len(start_at), ln_posterior, vectorize=True, moves=moves)
    sampler.random_state = np.random.RandomState(4242).get_state()
    state = sampler.run_mcmc(first, BURN_IN)
    sampler.reset()
    sampler.run_mcmc(state, STEPS)
    draws = sampler.get_chain()
    time = sampler.get_autocorr_time(tol=0)
    mean, sd = draws.mean(axis=(0, 1)), draws.std(axis=(0, 1))
    return mean, sd, np.sqrt(time / (WALKERS * STEPS)), time


def main():
    with tempfile.TemporaryDirectory() as folder:
        small_experiment.write(folder, "eye")
        server, link = start(folder, "eye")
        try:
            posterior, worst = check_models(link)
            names, mean, sd, own_error = sampled_here(folder)
            outside_mean, outside_sd, outside_error, time = sampled_outside(posterior, mean, sd)
        finally:
            server.terminate()
            server.wait()
        error = np.sqrt(own_error**2 + outside_error**2)
        of_mean, of_sd = np.abs(outside_mean - mean) / sd, np.abs(outside_sd / sd - 1)
        for row in zip(names, of_mean, of_sd, error):
            assert row[1] < TOLERANCE and row[2] < TOLERANCE and 4 * row[3] < TOLERANCE, row
        print(
            f"umbridge and emcee {emcee.__version__}: gradients within {worst:.0e} of differences; {WALKERS * STEPS} draws over HTTP (autocorrelation "
            f"{time.max():.0f} steps) and `sample` agree in means to {of_mean.max():.2%} and in spreads to {of_sd.max():.2%} of sd "
            f"(Monte-Carlo error of a mean {error.max():.2%})"
        )


if __name__ == "__main__":
    main()
