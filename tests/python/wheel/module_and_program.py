"""The module agrees with the program to the last bit: trajectories and densities of `serve`, draws of `sample`. It refuses invalid arguments."""

import csv
import os
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import umbridge

import vitreo_uq as vu

sys.path.insert(0, str(Path(os.environ["VITREO_UQ_SOURCE"]) / "tests/python"))
import small_experiment  # noqa: E402

# Fourth-order differences of the filter are exact to rounding for white noise; steps of 1e-5 leave about 1e-10.
SLOPE_TOLERANCE = 1e-6


def served(target):
    """UM-Bridge's models of the same target."""
    command = [vu.program.program(), "serve", str(target), "--port", "0", "--quiet"]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    return server, server.stdout.readline().strip()


def same_as_served(model, target, rng):
    server, link = served(target)
    try:
        n = model.n_trajectory_parameters
        points = model.prior_median * np.exp(0.1 * rng.standard_normal((40, len(model.names))))
        trajectory, posterior = (umbridge.HTTPModel(link, name) for name in ("trajectory", "posterior"))
        theirs = np.array([trajectory([point[:n].tolist()])[0] for point in points])
        assert np.array_equal(model.trajectory(points[:, :n]), theirs)
        densities = np.array(posterior([points.ravel().tolist()], {"points": len(points)})[0])
        assert np.array_equal(model.log_density(points), densities)
        slopes = np.array([posterior.gradient(0, 0, [point.tolist()], [1.0]) for point in points])
        assert np.array_equal(model.log_density_gradient(points), slopes)
    finally:
        server.terminate()
        server.wait()
    return points


def slopes_are_differences(model, points):
    gradient = model.log_density_gradient(points)
    for d in range(points.shape[1]):
        step = 1e-5 * points[:, d]
        ahead, behind = points.copy(), points.copy()
        ahead[:, d] += step
        behind[:, d] -= step
        difference = (model.log_density(ahead) - model.log_density(behind)) / (2 * step)
        size = np.abs(gradient[:, d]) + 1 / points[:, d]
        assert (np.abs(gradient[:, d] - difference) / size).max() < SLOPE_TOLERANCE, model.names[d]


def shapes_and_ends(model, points):
    n = model.n_trajectory_parameters
    one = points[0]
    assert model.trajectory(one[:n]).shape == (model.trajectory(points[:, :n]).shape[1],)
    assert np.array_equal(model.trajectory(one[:n]), model.trajectory(points[:, :n])[0])
    assert model.log_density(one).shape == () and model.log_density_gradient(one).shape == one.shape
    assert model.log_density(np.empty((0, len(one)))).shape == (0,)
    assert model.trajectory(np.empty((0, n))).shape == (0, model.trajectory(one[:n]).size)
    # Any memory order, number type and batch size give the same bits.
    assert np.array_equal(model.log_density(np.asfortranarray(points)), model.log_density(points))
    assert np.array_equal(model.log_density(points[::2]), model.log_density(points)[::2])
    many = np.tile(points, (50, 1))
    assert np.array_equal(model.log_density(many), np.tile(model.log_density(points), 50))
    assert model.log_density([[4, 1, 50, 4]]) == model.log_density([4.0, 1.0, 50.0, 4.0])
    outside = one * [-1, 1, 1, 1]
    assert model.log_density(outside) == -np.inf and not model.log_density_gradient(outside).any()
    assert model.log_density([np.inf, 1, 50, 4]) == -np.inf


def refused(ask, *words):
    try:
        ask()
    except vu.InputError as error:
        assert isinstance(error, (ValueError, vu.Error)) and all(word in str(error) for word in (*words, "what to do")), error
    else:
        raise AssertionError(f"not refused: {words}")


def what_is_wrong_is_refused(model, eye):
    for ask in (model.log_density, model.log_density_gradient, model.trajectory):
        refused(lambda: ask(np.ones((2, 2))), "points", "shape [2, 2]")
        refused(lambda: ask(1.0), "points", "shape []")
        refused(lambda: ask([]), "points", "shape [0]")
        refused(lambda: ask(np.ones((1, 1, 4))), "points", "shape [1, 1, 4]")
        refused(lambda: ask("abc"), "points")
        refused(lambda: ask(None), "points")
        refused(lambda: ask([[1, 2], [3]]), "points")
        refused(lambda: ask(np.ones(4, complex)), "points", "complex")
    refused(lambda: model.log_density([np.nan, 1, 1, 1]), "number 0 of point 0 is NaN")
    refused(lambda: model.trajectory([[3.5, 1.4, 47], [-1, 1.4, 47]]), "point 1", "young_modulus_pa")
    refused(lambda: vu.Experiment.read("absent"), "absent")
    refused(lambda: vu.ReducedModel("absent"), "absent")
    refused(lambda: vu.ReducedModel(eye, base="lethersick"), "`base`", "lethersick")
    refused(lambda: vu.ReducedModel(eye, effects=["no-effect"]), "`effects`", "no-effect")
    refused(lambda: vu.ReducedModel(eye, noise=["pink"]), "`noise`", "pink")
    refused(lambda: vu.ReducedModel(eye, prior="none"), "`prior`", "none")
    refused(lambda: vu.ReducedModel(eye, fixed={"young_modulus_pa": -1.0}), "`fixed`", "young_modulus_pa")
    refused(lambda: vu.ReducedModel(eye, fixed={"young_modulus_pa": float("nan")}), "young_modulus_pa")
    refused(lambda: vu.ReducedModel(eye, revision="m0"), "`revision`")
    refused(lambda: vu.sample("absent"), "absent")
    refused(lambda: vu.read_study("eye"), "not a study")


def draws_are_those_of_the_table(study):
    data = vu.read_study(study)
    with (study / "m0/draws.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    for name in ("young_modulus_pa", "noise_sd_um"):
        ours = np.sort(data.posterior[name].values.ravel())
        assert np.array_equal(ours, np.sort([float(row[name]) for row in rows])), name
    assert {"lp"} <= set(data.sample_stats.data_vars) and data.log_likelihood.sizes["row"] > 0
    refused(lambda: vu.read_study(study, "m7"), "m7", "m0")


def main():
    rng = np.random.default_rng(7)
    place = small_experiment.write(".", "eye")
    eye = vu.Experiment.read(place)
    table = np.genfromtxt(place / "trajectory.csv", delimiter=",", names=True)
    assert np.array_equal(eye.time_s, table["time_s"]) and np.array_equal(eye.cycle, table["cycle"])
    assert np.allclose(1e6 * eye.position_m, table["position_um"], rtol=1e-12) and np.allclose(1e6 * eye.force_n, table["force_uN"])
    assert (eye.label, eye.noise_um, eye.calibration_cycles, eye.heldout_cycles) == ("eye", 4.0, [1], [2, 3, 4])
    lossy = small_experiment.write(".", "lossy") / "trajectory.csv"
    rows = lossy.read_text(encoding="utf-8").splitlines()
    fields = rows[5].split(",")
    fields[rows[0].split(",").index("position_um")] = ""
    lossy.write_text("\n".join([*rows[:5], ",".join(fields), *rows[6:]]) + "\n", encoding="utf-8")
    assert eye.notes == [] and ["1 of" in note for note in vu.Experiment.read(lossy.parent).notes] == [True]
    model = vu.ReducedModel(eye)
    assert model.names == ["young_modulus_pa", "viscosity_1_pa_s", "viscosity_2_pa_s", "noise_sd_um"]
    assert [own["unit"] for own in model.parameters] == ["Pa", "Pa s", "Pa s", "um"], model.parameters
    # Closed form of the experiment's law, in µm. The sampled instrument is exact.
    expected = [1e6 * small_experiment.FORCE_N * small_experiment.COMPLIANCE_PER_M * small_experiment.creep(t, 1.0) for t in eye.time_s[:25]]
    assert np.allclose(model.trajectory([3.527, 1.402, 47.37])[:25], expected, rtol=1e-9)
    points = same_as_served(model, place, rng)
    slopes_are_differences(model, points)
    shapes_and_ends(model, points)
    what_is_wrong_is_refused(model, eye)
    fixed = vu.ReducedModel(eye, fixed={"viscosity_1_pa_s": 1.4})
    assert np.array_equal(fixed.trajectory([3.5, 47.0]), model.trajectory([3.5, 1.4, 47.0]))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        short = vu.sample(eye, out="short", steps=50)
    assert not short["converged"] and any(issubclass(own.category, vu.NotTrusted) for own in caught)
    document = vu.sample(eye, out="study")
    assert document["schema"] == "vitreo-uq/posterior/1" and document["converged"]
    draws_are_those_of_the_table(Path("study"))
    of_study = vu.ReducedModel("study")
    assert np.array_equal(of_study.log_density(points), model.log_density(points))
    diagnosis = vu.diagnose("study", simulations=99)
    assert diagnosis["schema"] == "vitreo-uq/diagnosis/1" and diagnosis["verdict"]["kind"] in ("none", "missing", "unexplained")
    print(f"{len(points)} trajectories, densities and gradients equal those of `serve` to the last bit; draws equal the table's")


if __name__ == "__main__":
    main()
