"""Makes the meshes beside this file: a quarter sphere (radius 0.275 mm) in a quarter ball (radius 10 mm), unit mm.

Needs `pip install gmsh`; the files were made with Gmsh 4.15.2. Run from this folder.
"""

import gmsh

ROBOT_RADIUS_MM = 0.275
OUTER_RADIUS_MM = 10.0


def geometry():
    occ = gmsh.model.occ
    ball = occ.addSphere(0, 0, 0, OUTER_RADIUS_MM)
    robot = occ.addSphere(0, 0, 0, ROBOT_RADIUS_MM)
    shell, _ = occ.cut([(3, ball)], [(3, robot)])
    quadrant = occ.addBox(-20, 0, 0, 40, 20, 20)
    gel, _ = occ.intersect(shell, [(3, quadrant)])
    occ.synchronize()
    return gel


def name_surfaces(gel):
    groups = {"robot": [], "outer": [], "symmetry_y": [], "symmetry_z": []}
    for dimension, tag in gmsh.model.getBoundary(gel, oriented=False):
        low = gmsh.model.getBoundingBox(dimension, tag)[:3]
        high = gmsh.model.getBoundingBox(dimension, tag)[3:]
        if high[1] < 1e-3:
            groups["symmetry_y"].append(tag)
        elif high[2] < 1e-3:
            groups["symmetry_z"].append(tag)
        elif high[0] - low[0] < 4 * ROBOT_RADIUS_MM:
            groups["robot"].append(tag)
        else:
            groups["outer"].append(tag)
    for name, tags in groups.items():
        gmsh.model.addPhysicalGroup(2, tags, name=name)
    gmsh.model.addPhysicalGroup(3, [tag for _, tag in gel], name="gel")


def mesh(relative_size, order):
    """Element size proportional to the distance from the robot's centre."""
    field = gmsh.model.mesh.field.add("MathEval")
    gmsh.model.mesh.field.setString(field, "F", f"{relative_size}*Sqrt(x*x+y*y+z*z)")
    gmsh.model.mesh.field.setAsBackgroundMesh(field)
    for option in ("MeshSizeExtendFromBoundary", "MeshSizeFromPoints", "MeshSizeFromCurvature"):
        gmsh.option.setNumber(f"Mesh.{option}", 0)
    gmsh.option.setNumber("Mesh.ElementOrder", order)
    gmsh.option.setNumber("Mesh.HighOrderOptimize", 2 if order == 2 else 0)
    gmsh.model.mesh.generate(3)


def save(name, binary):
    gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
    gmsh.option.setNumber("Mesh.Binary", int(binary))
    gmsh.write(name)


def make(name, relative_size, order):
    gmsh.clear()
    gmsh.model.add("quarter_sphere")
    name_surfaces(geometry())
    mesh(relative_size, order)
    save(name, binary=False)


gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
gmsh.option.setNumber("General.NumThreads", 1)
make("quarter_sphere_tet4.msh", 0.45, order=1)
make("quarter_sphere_tet10.msh", 0.5, order=2)
# The binary file is made from the text file, whose coordinates are rounded to 16 digits, so both hold the same numbers.
gmsh.clear()
gmsh.open("quarter_sphere_tet10.msh")
save("quarter_sphere_tet10_binary.msh", binary=True)
gmsh.finalize()
