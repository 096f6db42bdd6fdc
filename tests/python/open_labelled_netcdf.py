"""Opens draws over named dimensions with ArviZ and xarray and compares them with the CSV of the same draws.

usage: open_labelled_netcdf.py [LABELLED.nc DRAWS.csv]; without arguments the example `export_draws` makes them: the CSV's ensembles are
the groups, its walkers the chains.

Both libraries must return labels as strings that select data. Exit code 0 means equal bit for bit.
"""

import csv
import pathlib
import subprocess
import sys
import tempfile

import arviz as az
import numpy as np
import xarray as xr

GROUPS = ["porcine", "bovine, µ-rheology at 4 °C", "human", "gel / 1.5 %"]


def read_csv(path):
    """Parameters' names; the draws over (group, chain, draw, parameter) and the log density over (group, chain, draw)."""
    with open(path, newline="", encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    rows = np.array(rows, dtype=float)
    shape = tuple(rows[:, :3].astype(int).max(axis=0) + 1)
    return header[3:-1], rows[:, 3:-1].reshape(*shape, -1), rows[:, -1].reshape(shape)


def compare(posterior, parameters, values, log_density):
    """Asserts that a dataset holds the table."""
    assert dict(posterior.sizes) == dict(zip(("group", "chain", "draw", "parameter"), values.shape)), posterior.sizes
    assert sorted(posterior.data_vars) == ["lp", "typical", "young_modulus_pa"], list(posterior.data_vars)
    for coordinate, labels in (("group", GROUPS), ("parameter", parameters)):
        found = posterior[coordinate].values.tolist()
        assert found == labels and all(type(label) is str for label in found), f"{coordinate}: {found}"
    assert posterior["typical"].dims == ("chain", "draw", "group", "parameter"), posterior["typical"].dims
    assert posterior["young_modulus_pa"].dims == ("chain", "draw", "group")
    assert posterior["lp"].dims == ("chain", "draw")
    assert [posterior[name].attrs["units"] for name in ("typical", "young_modulus_pa", "lp")] == ["1", "Pa", "1"]
    for g, group in enumerate(GROUPS):
        for p, parameter in enumerate(parameters):
            selected = posterior["typical"].sel(group=group, parameter=parameter)
            assert np.array_equal(selected.values, values[g, :, :, p]), f"{parameter} of {group} differs"
        assert np.array_equal(posterior["young_modulus_pa"].sel(group=group).values, values[g, :, :, 0]), group
    assert np.array_equal(posterior["lp"].values, log_density[0]), "lp differs"
    assert posterior.attrs["created_by"].startswith("vitreo-uq ")


def check(netcdf, table_csv):
    parameters, values, log_density = read_csv(table_csv)
    for engine in ("h5netcdf", "netcdf4"):
        with xr.open_dataset(netcdf, group="posterior", engine=engine) as posterior:
            compare(posterior.load(), parameters, values, log_density)
    draws = az.from_netcdf(netcdf)
    # ArviZ 1.x returns a tree of groups, 0.x a collection of datasets.
    posterior = draws["posterior"]
    compare(getattr(posterior, "to_dataset", lambda: posterior)(), parameters, values, log_density)
    table = az.summary(draws, var_names=["typical"])
    rows = {f"typical[{group}, {parameter}]" for group in GROUPS for parameter in parameters}
    assert set(table.index) == rows, list(table.index)
    print(f"arviz {az.__version__}: {values.size} draws of {len(GROUPS)} groups, labelled by strings, equal the CSV bit for bit")


def main():
    if len(sys.argv) == 3:
        check(sys.argv[1], sys.argv[2])
        return
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(["cargo", "run", "--quiet", "--example", "export_draws", "--", folder], check=True, stdout=subprocess.DEVNULL)
        check(str(pathlib.Path(folder) / "labelled.nc"), str(pathlib.Path(folder) / "draws.csv"))


if __name__ == "__main__":
    main()
