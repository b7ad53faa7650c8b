"""The sheet parts of meshes/: areas and lengths of their groups against closed forms."""

from __future__ import annotations

from math import atanh, pi, radians, sqrt

import numpy as np
import pytest
from scipy.integrate import dblquad

pytest.importorskip("dolfinx")

import antiosc as ao
from antiosc.fem.elements.weak_form import coefficient, measure
from antiosc.fem.platform import compat
from antiosc.fem.structure.of_mesh import parts_of
from paths import MESHES

pytestmark = pytest.mark.fem

FOLDER = MESHES
ARC = radians(36)
PLATE = 0.3 * 0.2 - pi * (0.020**2 + 0.025**2 + 0.015**2 + 0.012**2) - 0.080 * 0.024
PANEL = {
    "skin": 1.2 * ARC * 0.9,
    "stringers": 3 * 0.9 * 0.025,
    "frames": 2 * ARC / 2 * (1.2**2 - 1.16**2),
}


def area(mesh: ao.Mesh, group: str) -> float:
    """Of one group of cells: the integral of a weight that is 1 there alone."""
    cells = [name for name, parts in mesh.groups.items() if 2 in parts]
    materials = {name: ao.Shell(1.0, 0.3, 1.0 if name == group else 1e-12, 1.0) for name in cells}
    weight = coefficient(mesh, parts_of(mesh, materials), lambda sheet: sheet.rho)
    return compat.integrate(weight * measure(mesh, 4), mesh.dolfinx)


@pytest.mark.slow
def test_plate():
    mesh = ao.read_mesh(FOLDER / "plate.msh")
    assert mesh.gdim == 2
    assert area(mesh, "plate") == pytest.approx(PLATE, rel=1e-5)


@pytest.fixture(scope="module")
def panel() -> ao.Mesh:
    return ao.read_mesh(FOLDER / "panel.msh")


@pytest.mark.sample(-1)
@pytest.mark.parametrize("group", PANEL)
def test_panel(panel, group):
    assert area(panel, group) == pytest.approx(PANEL[group], rel=1e-5)


@pytest.mark.parametrize(
    ("group", "length"), [("stringers", 3 * 0.9), ("frames", 2 * 1.2 * ARC), ("sides", 2 * 0.9)]
)
@pytest.mark.slow
def test_lines_of_the_skin(group, length):
    """Their length is the mass that a beam on them adds."""
    mesh = ao.read_mesh(FOLDER / "skin.msh")
    sheet = ao.Shell(1e-3, 0.3, 1e-9, 1.0)
    rod = ao.Beam(1e6, 0.3, 1.0, ao.Section(A=1.0, I=1.0))
    with_rod, bare = (ao.Structure(mesh, m) for m in ({"skin": sheet, group: rod}, {"skin": sheet}))
    assert with_rod.mass - bare.mass == pytest.approx(length, rel=1e-5)


@pytest.mark.slow
def test_tank_from_its_step_file():
    """A 2:1 half spheroid on a skirt, less the manhole; the geometry meshed anew as well."""
    a, b = 0.3, 0.15
    e = sqrt(1 - (b / a) ** 2)
    whole = pi * a**2 * (1 + (1 - e**2) / e * atanh(e)) + 2 * pi * a * 0.06

    def slope(phi, r):  # dA/(r dr dφ) of z = b √(1 − ρ²/a²)
        rho2 = (0.11 + r * np.cos(phi)) ** 2 + (r * np.sin(phi)) ** 2
        return r * sqrt(1 + (b / a) ** 2 * rho2 / (a**2 - rho2))

    hole = dblquad(slope, 0, 0.06, 0, 2 * pi)[0]
    for mesh in (ao.read_mesh(FOLDER / "tank.msh"), ao.read_mesh(FOLDER / "tank.geo", size=0.05)):
        assert area(mesh, "tank") == pytest.approx(whole - hole, rel=1e-4)
        held = ao.Structure(mesh, ao.Shell(210e9, 0.3, 7850.0, 3e-3), [ao.Support("rim")])
        assert held.rigid_modes.shape[1] == 0


def test_a_group_may_not_be_given_twice():
    """A cell that two groups hold has two materials: said with the number of cells."""
    mesh = ao.read_mesh(FOLDER / "panel.msh")
    both = ao.Mesh(mesh.dolfinx, {**mesh.groups, "all": mesh.groups["skin"]}, mesh.name)
    sheet = ao.Shell(1.0, 0.3, 1.0, 1.0)
    materials = {name: sheet for name in ("skin", "stringers", "frames", "all")}
    with pytest.raises(ao.InputError, match=r"0 have none and \d+ more than one"):
        ao.Structure(both, materials)


def test_a_group_name_used_twice(tmp_path):
    import gmsh

    gmsh.initialize(readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        squares = [(2, gmsh.model.occ.addRectangle(x, 0, 0, 1, 1)) for x in (0, 1)]
        gmsh.model.occ.fragment(squares[:1], squares[1:])
        gmsh.model.occ.synchronize()
        for tag in (1, 2):
            gmsh.model.setPhysicalName(2, gmsh.model.addPhysicalGroup(2, [tag]), f"sheet{tag}")
        gmsh.model.mesh.generate(2)
        gmsh.write(str(tmp_path / "two.msh"))
    finally:
        gmsh.finalize()
    # gmsh itself gives a name once, but reads files that give it twice
    text = (tmp_path / "two.msh").read_text()
    (tmp_path / "two.msh").write_text(text.replace("sheet1", "sheet").replace("sheet2", "sheet"))
    with pytest.raises(ao.InputError, match="two groups of dimension 2 the name 'sheet'"):
        ao.read_mesh(tmp_path / "two.msh")
