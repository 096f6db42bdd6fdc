"""Opens the program's .vtu files with VTK itself: counts, cell types, volumes, Jacobians, node order and values."""

import math
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy

# Quarter of the ball of 10 mm without the robot of 0.275 mm, in m³.
QUARTER_BALL = math.pi / 3 * (10e-3**3 - 0.275e-3**3)
# File: VTK's cell type, nodes, elements, volume, and the tolerance of the volume, because facets and coarse parabolas cut corners.
EXPECTED = {
    "tetrahedron4.vtu": (10, 282, 930, QUARTER_BALL, 0.1),
    "tetrahedron10.vtu": (24, 1439, 749, QUARTER_BALL, 2e-3),
    "hexahedron27.vtu": (29, 27, 1, 48.0, 1e-12),
}


def read(path):
    errors = []
    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.AddObserver("ErrorEvent", lambda *_: errors.append("reader"))
    reader.SetFileName(str(path))
    reader.Update()
    grid = reader.GetOutput()
    assert not errors and reader.GetErrorCode() == 0, f"{path.name}: VTK cannot read the file"
    return grid


def quadrature(cell_type):
    """Points and weights in VTK's parametric coordinates, exact to degree 4 and more."""
    abscissae, weights = np.polynomial.legendre.leggauss(4)
    abscissae, weights = (abscissae + 1) / 2, weights / 2
    for i, a in enumerate(abscissae):
        for j, b in enumerate(abscissae):
            for k, c in enumerate(abscissae):
                weight = weights[i] * weights[j] * weights[k]
                if cell_type == 29:
                    yield (a, b, c), weight
                else:
                    # The cube collapsed onto the tetrahedron.
                    yield (a, b * (1 - a), c * (1 - a) * (1 - b)), weight * (1 - a) ** 2 * (1 - b)


def volume(grid):
    """Integral of VTK's own Jacobians, all of which must be positive."""
    total = 0.0
    for index in range(grid.GetNumberOfCells()):
        cell = grid.GetCell(index)
        points = vtk_to_numpy(cell.GetPoints().GetData())
        n = cell.GetNumberOfPoints()
        for position, weight in quadrature(cell.GetCellType()):
            derivatives = [0.0] * (3 * n)
            cell.InterpolateDerivs(position, derivatives)
            determinant = np.linalg.det(np.reshape(derivatives, (3, n)) @ points)
            assert determinant > 0, f"cell {index}: Jacobian determinant {determinant}"
            total += weight * determinant
    return total


def check_values(grid, name):
    points = vtk_to_numpy(grid.GetPoints().GetData())
    x, y, z = points.T
    values = vtk_to_numpy(grid.GetPointData().GetArray("polynomials"))
    assert np.array_equal(values, np.column_stack([x, x * y, x * x * y * y * z * z])), f"{name}: vector field"
    distance = vtk_to_numpy(grid.GetPointData().GetArray("distance_m"))
    assert np.array_equal(distance, np.sqrt(x * x + y * y + z * z)), f"{name}: scalar field"


def check_node_order(grid):
    """A 27-node brick interpolates x²y²z² exactly between its nodes, but only with the correct node order."""
    cell = grid.GetCell(0)
    parametric = np.reshape(cell.GetParametricCoords(), (27, 3))
    points = vtk_to_numpy(grid.GetPoints().GetData())
    assert np.array_equal(points, (2 * parametric - 1) * [1, 2, 3]), "reference nodes differ from VTK's"
    field = vtk_to_numpy(grid.GetPointData().GetArray("polynomials"))[:, 2]
    for position in np.random.default_rng(1).random((50, 3)):
        shape = [0.0] * 27
        cell.InterpolateFunctions(position, shape)
        x, y, z = shape @ points
        assert abs(shape @ field - x * x * y * y * z * z) < 1e-12, "interpolation between the nodes"


def check_series(folder):
    entries = ElementTree.parse(folder / "series.pvd").getroot().findall("./Collection/DataSet")
    assert [float(entry.get("timestep")) for entry in entries] == [0.0, 0.5]
    for entry in entries:
        read(folder / entry.get("file"))


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        subprocess.run(["cargo", "run", "--quiet", "--example", "write_vtu", "--", str(folder)], check=True, stdout=subprocess.DEVNULL)
        for file, (cell_type, n_nodes, n_elements, expected, tolerance) in EXPECTED.items():
            grid = read(folder / file)
            assert (grid.GetNumberOfPoints(), grid.GetNumberOfCells()) == (n_nodes, n_elements), f"{file}: counts"
            assert {grid.GetCellType(k) for k in range(n_elements)} == {cell_type}, f"{file}: cell types"
            check_values(grid, file)
            measured = volume(grid)
            assert abs(measured / expected - 1) < tolerance, f"{file}: volume {measured} instead of {expected}"
        check_node_order(read(folder / "hexahedron27.vtu"))
        check_series(folder)
    print(f"VTK {vtk.VTK_VERSION} reads 3 element kinds: counts, types, volumes, positive Jacobians, node order, fields and a time series")


if __name__ == "__main__":
    sys.exit(main())
