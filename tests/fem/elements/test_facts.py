"""What element families tell of a part: its dimensions, its constants, its own indentation."""

from __future__ import annotations

import basix
import numpy as np
import pytest
from mpi4py import MPI

pytest.importorskip("dolfinx")

import antiosc as ao
from antiosc.fem.elements import solid
from antiosc.fem.platform import compat
from parts import STEEL, box, frame, line, named, plate
from sheets import PLY

pytestmark = pytest.mark.fem

CONSTANTS = tuple(STEEL.values())
ROUND, OBLONG = ao.Section.circle(0.1), ao.Section.rectangle(0.1, 0.2)


def halves(mesh: ao.Mesh, at: float) -> ao.Mesh:
    """With the cells on both sides of x = `at` as groups "one" and "two"."""
    sides = {
        "one": (mesh.tdim, lambda x: x[0] < at + 1e-9),
        "two": (mesh.tdim, lambda x: x[0] > at - 1e-9),
    }
    return named(mesh.dolfinx, sides)


def arc() -> ao.Mesh:
    """One line of order 2."""
    x = np.array([[0.0, 0, 0], [1, 0, 0], [0.5, 0.1, 0]])
    mesh = compat.create_mesh(MPI.COMM_SELF, np.array([[0, 1, 2]]), x, "interval", 2)
    return ao.read_mesh(mesh)


@pytest.mark.slow
def test_boxes_and_thicknesses():
    block = ao.Structure(box((2, 1, 1), (0.3, 0.1, 0.2)), ao.Solid(**STEEL), order=1)
    assert block.dimensions == pytest.approx((0.3, 0.2, 0.1))
    for thickness in (0.5, 0.01):
        flat = ao.Solid(**STEEL, plane="stress", thickness=thickness)
        part = ao.Structure(plate((2, 1), (0.1, 0.3)), flat, order=1)
        assert part.dimensions == pytest.approx((0.3, thickness, 0.1))
    thick, thin = (ao.Shell(**STEEL, thickness=t) for t in (0.02, 0.01))
    sheet = halves(plate((2, 1), (0.2, 0.3), "triangle"), 0.1)
    part = ao.Structure(sheet, {"one": thick, "two": thin})
    assert part.dimensions == pytest.approx((0.3, 0.2, 0.01))


@pytest.mark.slow
def test_widths_of_beams_and_bars_are_those_of_rectangles():
    low, high = (ao.Section.rectangle(width=w, height=h) for w, h in ((0.03, 0.01), (0.01, 0.02)))
    mesh = halves(line(1.0, 2), 0.5)
    beams = {name: ao.Beam(**STEEL, section=s) for name, s in (("one", low), ("two", high))}
    part = ao.Structure(mesh, beams)
    assert part.dimensions == pytest.approx((1.0, 0.03, 0.01))
    assert ao.Structure(line(1.0, 2), beams["two"]).dimensions == pytest.approx((1.0, 0.01, 0.02))
    mast = frame([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)],
                 [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)], 1)  # fmt: skip
    truss = ao.Structure(mast, ao.Truss(**STEEL, area=4e-4))
    assert truss.dimensions == pytest.approx((1.0, 0.02, 0.02))


@pytest.mark.slow
def test_constants_are_those_of_the_first_material():
    soft = ao.Solid(1e9, 0.4, 1000.0)
    mesh = halves(box((2, 1, 1), (0.2, 0.1, 0.1)), 0.1)
    assert ao.Structure(mesh, {"one": ao.Solid(**STEEL), "two": soft}).constants() == CONSTANTS
    blocks = {name: ao.Structure(box((1, 1, 1), (0.1, 0.2, 0.3)), m, order=1)
              for name, m in (("a", soft), ("b", ao.Solid(**STEEL)))}  # fmt: skip
    joint = ao.Weld("a:right", "b:left")
    both = ao.assemble(blocks, [joint], {"b": (0.5, 0.0, 0.1)})
    assert both.constants() == (1e9, 0.4, 1000.0)
    assert both.dimensions == pytest.approx((0.6, 0.4, 0.2))
    beam = ao.Beam(**STEEL, section=ao.Section.circle(0.01))
    assert ao.Structure(line(1.0, 2), beam).constants() == CONSTANTS
    assert pytest.approx(210e9 / 2.6) == beam.G
    shell = ao.Shell(**STEEL, thickness=0.01)
    assert pytest.approx(210e9 / 2.6) == shell.G
    assert ao.Structure(plate((1, 1), (1, 1), "triangle"), shell).constants() == CONSTANTS


def test_local_indentation_is_that_of_a_half_space_or_none():
    """Johnson's (3.41a) and (3.91a), weighted by the pressure; families without depth have none."""
    E, nu = STEEL["E"], STEEL["nu"]
    along, across = 0.6 * (1 - nu**2) / E, 0.3 * (2 - nu) * (1 + nu) / E
    steel = ao.Solid(**STEEL)
    for cosine in (0.0, 0.6, 1.0):
        exact = cosine**2 * along + (1 - cosine**2) * across
        assert steel.half_space_compliance(cosine) == pytest.approx(exact, rel=1e-12)
    section = ao.Section.circle(0.01)
    for other in (
        ao.Solid(**STEEL, plane="strain"),
        ao.Shell(**STEEL, thickness=0.01),
        ao.Laminate([PLY]),
        ao.Beam(**STEEL, section=section),
        ao.Truss(**STEEL, area=1e-4),
    ):
        assert other.half_space_compliance(0.6) == 0.0


@pytest.mark.parametrize(
    ("mesh", "material", "words"),
    [
        (lambda: line(1.0, 2), ao.Solid(**STEEL), "has interval cells in 2-D"),
        (lambda: plate((1, 1)), ao.Truss(**STEEL, area=1e-4), "Truss needs a mesh of lines"),
        (lambda: plate((1, 1)), ao.Beam(**STEEL, section=ROUND), "Beam needs a mesh of lines"),
        (lambda: arc(), ao.Beam(**STEEL, section=ROUND), "Beam elements are straight"),
        (lambda: arc(), ao.Truss(**STEEL, area=1e-4), "bars of a Truss are straight"),
        (lambda: line(1.0, 2), ao.Shell(**STEEL, thickness=0.1), "Shell needs a mesh of triangles"),
        (lambda: box((1, 1, 1)), ao.Laminate([PLY]), "Laminate needs a mesh of triangles"),
        (lambda: plate((1, 1)), ao.AnisotropicSolid(np.eye(6) * 1e9, 1e3), "is for 3-D meshes"),
        (
            lambda: line(1.0, 2),
            ao.Beam(**STEEL, section=OBLONG, orientation=(0, 1, 0), offset=0.1),
            "offset applies to beams in space",
        ),
        (
            lambda: line(1.0, 2, (1.0, 0, 0)),
            ao.Beam(**STEEL, section=OBLONG),
            "orientation",
        ),
    ],
)  # fmt: skip
def test_meshes_of_other_families_are_refused(mesh, material, words):
    with pytest.raises(ao.InputError, match=words):
        ao.Structure(mesh(), material)


def test_sections_that_are_none():
    good = {"A": 1e-4, "I": 1e-9, "I_side": 2e-9, "J": 3e-9, "shear": 0.8}
    made = ao.Section(**good)
    assert (made.side, made.torsion, made.isotropic) == (2e-9, 3e-9, False)
    assert ao.Section(1, 2).torsion == 4.0
    for name in good:
        for wrong in (0.0, -1.0, "thick"):
            with pytest.raises(ao.InputError, match=f"{name} must"):
                ao.Section(**{**good, name: wrong})
    for make, name in (
        (lambda v: ao.Section.rectangle(v, 0.1), "width"),
        (lambda v: ao.Section.rectangle(0.1, v), "height"),
        (lambda v: ao.Section.circle(v), "d"),
        (lambda v: ao.Section.tube(v, 0.01), "d"),
        (lambda v: ao.Section.tube(0.1, v), "t"),
    ):
        with pytest.raises(ao.InputError, match=f"{name} must be > 0"):
            make(-1.0)
    for d, t, inner in ((0.1, 0.0499, 2e-4), (0.1, 0.02, 0.06)):
        tube, whole, hole = ao.Section.tube(d, t), ao.Section.circle(d), ao.Section.circle(inner)
        assert pytest.approx(whole.A - hole.A) == tube.A
        assert pytest.approx(whole.I - hole.I) == tube.I
    with pytest.raises(ao.InputError, match="thinner than d/2"):
        ao.Section.tube(0.1, 0.05)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_thin_cells_of_thin_parts(cell, axis):
    """Edges of more than 8 to 1, parts of more than 100 shortest ones; up to 1000 cells."""

    def thin(count: int, length: float, across: tuple[int, int] = (1, 1)) -> bool:
        n, size = list(across), [float(k) for k in across]
        n.insert(axis, count)
        size.insert(axis, count * length)
        return solid._is_thin(box(n, size, cell))

    longest = 8.0 if cell == "hexahedron" else np.sqrt(62.0)  # of tetrahedra the diagonals
    assert thin(14, 1.01 * longest)
    assert not thin(14, 0.99 * longest)
    assert not thin(12, 1.01 * longest)
    if cell == "hexahedron" and not axis:
        assert thin(20, 8.1, (10, 5))
        assert not thin(13, 8.1, (11, 7))
    found = {tuple(int(k) for k in e) for e in basix.topology(getattr(basix.CellType, cell))[1]}
    assert found == set(solid.SOLID_EDGES[cell])
