"""Reads a revision's `posterior.nc` with ArviZ: R-hat equals the program's, `az.loo` and `az.plot_ppc` work, groups are consistent.

Run from anywhere; needs arviz (0.23).
"""

import json
import pathlib
import tempfile
import warnings

import numpy as np

warnings.simplefilter("ignore")
import arviz as az  # noqa: E402

import small_experiment  # noqa: E402

GROUPS = ["posterior", "sample_stats", "constant_data", "observed_data", "log_likelihood", "posterior_predictive", "prior", "prior_predictive"]
# The program and ArviZ both take one rank over all draws. R-hat differs by rounding and by a middle step of an odd number.
RHAT_TOLERANCE = 1e-3
# The program's effective sizes also include correlation between walkers of an ensemble, which ArviZ cannot see.
ESS_FACTOR = 2.0


def leave_one_out(data, noise_um):
    """elpd of each fitted position by importance sampling without smoothing, from the posterior predictive mean."""
    ln_likelihood = data.log_likelihood["position_um"].stack(sample=("chain", "draw")).values
    return -np.log(np.mean(np.exp(-ln_likelihood), axis=1))


def check(folder, noise):
    small_experiment.run(folder, "sample", "eye", "--out", "study", "--noise", ",".join(noise), "--quiet", "--force")
    revision = pathlib.Path(folder) / "study" / "m0"
    data = az.from_netcdf(str(revision / "posterior.nc"))
    missing = [group for group in GROUPS if not hasattr(data, group)]
    assert not missing, f"{missing} are missing"
    document = json.loads((revision / "posterior.json").read_text())
    assert data.posterior.sizes["chain"] == document["sampler"]["ensembles"]

    table = az.summary(data, round_to="none")
    worst_rhat, worst_ess = 0.0, 1.0
    for own in document["parameters"]:
        row = table.loc[own["name"]]
        worst_rhat = max(worst_rhat, abs(row["r_hat"] - own["rhat"]))
        ratio = row["ess_bulk"] / own["ess_bulk"]
        worst_ess = max(worst_ess, ratio, 1 / ratio)
        assert abs(row["mean"] / own["mean"] - 1) < 1e-9, own["name"]
    assert worst_rhat < RHAT_TOLERANCE, worst_rhat
    assert worst_ess < ESS_FACTOR, worst_ess

    constant, observed = data.constant_data, data.observed_data
    assert {"time_s", "force_un", "cycle", "fitted"} <= set(constant.data_vars)
    fitted = constant["fitted"].values.astype(bool)
    assert sorted(set(constant["cycle"].values[fitted])) == document["heldout"]["fitted_cycles"]
    rows = data.log_likelihood["row"].values
    assert fitted[rows].all() and len(rows) == fitted.sum(), "every fitted position has its likelihood"
    assert np.array_equal(data.posterior_predictive["row"].values, observed["row"].values)
    # The draws are those of the posterior, as the labels show.
    assert set(data.log_likelihood["draw"].values) <= set(data.posterior["draw"].values)

    loo = az.loo(data, reff=1, pointwise=True)
    assert np.isfinite(loo.elpd_loo) and (loo.pareto_k.values < 0.7).all(), loo
    direct = leave_one_out(data, 4.0)
    assert np.abs(loo.loo_i.values - direct).max() < 0.1, "PSIS differs from plain importance sampling"
    n = len(rows)
    # A normal of 4 µm has an expected log density of -ln 4 - ½ ln 2πe = -2.81; n positions lie within six standard errors √(n/2).
    if noise == ["white"]:
        assert abs(loo.elpd_loo + 2.805 * n) < 6 * np.sqrt(n / 2) + 6, loo.elpd_loo
        # The number of effective parameters equals the actual number, the noise included.
        assert 2 < loo.p_loo < 7, loo.p_loo
    az.loo(data)

    for group in ("posterior", "prior"):
        az.plot_ppc(data, group=group, num_pp_samples=20, random_seed=1)
    inside = observed["position_um"].values
    low, high = np.quantile(data.posterior_predictive["position_um"].values, [0.05, 0.95], axis=(0, 1))
    share = np.mean((inside > low) & (inside < high))
    # 200 positions at 90 %: 3 % standard error, plus the quantiles' own error.
    assert 0.78 < share < 0.99, share
    wide = data.prior_predictive["position_um"].std() > 3 * (data.posterior_predictive["position_um"] - observed["position_um"]).std()
    assert wide, "the prior predicts no wider than the posterior"
    return worst_rhat, worst_ess, loo.elpd_loo


def main():
    with tempfile.TemporaryDirectory() as folder:
        small_experiment.write(folder, "eye")
        for noise in (["white"], ["white", "ou"]):
            rhat, ess, elpd = check(folder, noise)
            print(f"arviz {az.__version__}, {'+'.join(noise)}: R-hat within {rhat:.1e}, ESS within a factor of {ess:.2f}, elpd_loo {elpd:.1f}")


if __name__ == "__main__":
    main()
