"""Sheets of several thicknesses: what is judged at a site has the thickness there."""

import pytest

import antiosc as ao

STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
THIN, THICK = 1e-3, 12e-3


@pytest.fixture(scope="module")
def stepped(tmp_path_factory):
    """A plate of 0.4 x 0.2 m held at both ends: 1 mm thick on the left, 12 mm on the right."""
    gmsh = pytest.importorskip("gmsh")
    path = tmp_path_factory.mktemp("stepped") / "plate.msh"
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        left, right = (gmsh.model.occ.addRectangle(x, 0, 0, 0.2, 0.2) for x in (0.0, 0.2))
        gmsh.model.occ.fragment([(2, left)], [(2, right)])
        gmsh.model.occ.synchronize()
        for name, tag in (("thin", left), ("thick", right)):
            gmsh.model.setPhysicalName(2, gmsh.model.addPhysicalGroup(2, [tag]), name)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.04)
        gmsh.model.mesh.generate(2)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    mesh = ao.read_mesh(path, gdim=3)
    shells = {
        "thin": ao.Shell(**STEEL, thickness=THIN),
        "thick": ao.Shell(**STEEL, thickness=THICK),
    }
    supports = [ao.Support("-x"), ao.Support("+x")]
    return ao.Structure(mesh, shells, supports)


@pytest.mark.fem
@pytest.mark.parametrize(("x", "thickness"), [(0.1, THIN), (0.3, THICK)])
def test_a_site_has_the_thickness_and_the_waves_of_its_own_cell(stepped, x, thickness):
    """A blow on 12 mm was judged by the 1 mm of other cells: "0.97 times its thickness"."""
    model = ao.extract(stepped, ao.Site((x, 0.1, 0.0), (0, 0, -1)), n=4)
    assert model.info.thickness == thickness
    (cell,) = model.info.cells.values()
    speed = (STEEL["E"] / STEEL["rho"]) ** 0.5
    assert cell[1] == pytest.approx(speed * thickness / 12**0.5, rel=0.05)
