"""Opens the fields that `simulate` writes with VTK and compares them with the trajectory beside them."""

import csv
import json
import sys
import tempfile
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy

import small_experiment

ROBOT_RADIUS_M, OUTER_RADIUS_M = 0.275e-3, 10e-3


def read(path):
    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(path))
    reader.Update()
    grid = reader.GetOutput()
    assert grid.GetNumberOfPoints() > 0, f"{path}: VTK reads nothing"
    return vtk_to_numpy(grid.GetPoints().GetData()), vtk_to_numpy(grid.GetPointData().GetArray("displacement_m"))


def main():
    with tempfile.TemporaryDirectory() as name:
        study, result = Path(name) / "study", Path(name) / "result.json"
        small_experiment.run(name, "simulate", "--quiet", "--out", study, "--json", result)
        folder = study / "simulation"
        assert json.loads(result.read_text())["schema"] == "vitreo-uq/simulation/1"
        with open(folder / "trajectory.csv", newline="") as file:
            rows = [[float(value) for value in row] for row in list(csv.reader(file))[1:]]
        time_s, _, position_um, _ = np.array(rows).T
        entries = ElementTree.parse(folder / "fields.pvd").getroot().findall("./Collection/DataSet")
        assert len(entries) >= 7, "a field for every force hold"
        compared = 0
        for entry in entries:
            points, displacement = read(folder / entry.get("file"))
            radius = np.linalg.norm(points, axis=1)
            robot = np.abs(radius / ROBOT_RADIUS_M - 1) < 1e-9
            outer = np.abs(radius / OUTER_RADIUS_M - 1) < 1e-9
            assert robot.sum() > 20 and outer.sum() > 20
            # The robot moves as a rigid body along x, the outer surface rests, and nothing crosses a symmetry plane.
            assert np.ptp(displacement[robot], axis=0).max() < 1e-18 and np.abs(displacement[robot, 1:]).max() == 0
            assert np.abs(displacement[outer]).max() == 0
            assert np.abs(displacement[points[:, 1] == 0, 1]).max() == 0
            assert np.abs(displacement[points[:, 2] == 0, 2]).max() == 0
            row = np.flatnonzero(np.abs(time_s - float(entry.get("timestep"))) < 1e-9)
            if row.size:
                assert abs(1e6 * displacement[robot][0, 0] - position_um[row[0]]) < 1e-6
                compared += 1
        assert compared >= 7
    print(f"VTK {vtk.VTK_VERSION} reads the fields of simulate: rigid robot, resting wall, {compared} positions as in the trajectory")


if __name__ == "__main__":
    sys.exit(main())
