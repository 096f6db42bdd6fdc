"""Opens exported draws with ArviZ and compares them with the CSV of the same draws.

usage: open_netcdf.py [DRAWS.nc DRAWS.csv]; without arguments the example `export_draws` makes them.

Needs ArviZ 0.23, or 1.x (there also `arviz_base` and `arviz_stats` alone are enough), and h5netcdf or netCDF4. Exit code 0 means equal bit for bit.
"""

import csv
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
import xarray as xr


def open_draws(path):
    """The groups as datasets, and the name of the reader."""
    try:
        import arviz

        reader = getattr(arviz, "from_netcdf", xr.open_datatree)
        return reader(path), arviz.summary, f"arviz {arviz.__version__}"
    except ImportError:
        import arviz_base
        import arviz_stats

        reader = getattr(arviz_base, "from_netcdf", xr.open_datatree)
        return reader(path), arviz_stats.summary, f"arviz_base {arviz_base.__version__}"


def read_csv(path):
    with open(path, newline="") as file:
        rows = list(csv.reader(file))
    return rows[0], np.array(rows[1:], dtype=float)


def compare(netcdf, table_csv):
    draws, summary, reader = open_draws(netcdf)
    header, rows = read_csv(table_csv)
    # ArviZ 1.x returns a tree of groups, 0.x a collection of datasets.
    as_dataset = getattr(draws["posterior"], "to_dataset", lambda: draws["posterior"])
    posterior = as_dataset()
    ensemble, walker, step = (rows[:, header.index(name)].astype(int) for name in ("ensemble", "walker", "step"))
    n_walkers, n_steps = walker.max() + 1, step.max() + 1
    shape = (ensemble.max() + 1, n_walkers * n_steps)
    names = [name for name in header if name not in ("ensemble", "walker", "step", "log_density")]

    # Index in the file of the CSV's walker and step.
    for coordinate in ("walker", "step"):
        assert posterior[coordinate].dims == ("draw",), f"{coordinate} is no coordinate of the draws"
    place = np.full((n_walkers, n_steps), -1)
    place[posterior["walker"].values, posterior["step"].values] = np.arange(shape[1])
    assert (place >= 0).all(), "a draw is missing"
    draw = place[walker, step]
    assert posterior["step"].values[: shape[1] // 2].max() <= n_steps // 2, "halves of a chain are not halves of the steps"

    assert sorted(posterior.data_vars) == sorted(names), list(posterior.data_vars)
    for name in names:
        variable = posterior[name]
        assert variable.dims == ("chain", "draw") and variable.shape == shape, variable.sizes
        assert variable.attrs["units"], f"{name} has no unit"
        assert np.array_equal(variable.values[ensemble, draw], rows[:, header.index(name)]), f"{name} differs"
    for coordinate in ("chain", "draw"):
        assert coordinate in posterior.coords, f"{coordinate} is no coordinate"
    assert posterior.attrs["created_by"].startswith("vitreo-uq ")
    if "log_density" in header:
        log_density = draws["sample_stats"]["lp"].values[ensemble, draw]
        assert np.array_equal(log_density, rows[:, header.index("log_density")]), "lp differs"

    table = summary(draws)
    for name in names:
        mean, exact = float(table.loc[name, "mean"]), rows[:, header.index(name)].mean()
        assert abs(mean - exact) <= 0.01 * abs(exact) + 0.01, f"{name}: {mean} against {exact}"
    print(f"{reader}: {len(rows)} draws of {len(names)} parameters equal the CSV bit for bit")


def main():
    if len(sys.argv) == 3:
        compare(sys.argv[1], sys.argv[2])
        return
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(["cargo", "run", "--quiet", "--example", "export_draws", "--", folder], check=True, stdout=subprocess.DEVNULL)
        compare(str(pathlib.Path(folder) / "draws.nc"), str(pathlib.Path(folder) / "draws.csv"))


if __name__ == "__main__":
    main()
