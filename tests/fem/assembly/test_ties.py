"""Ties: patch tests across meshes, shells and beams on solids, against one mesh."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.fem.linalg.petsc_algebra import csr
from assemblies import NU, SOLID, E, box, eigenfrequencies, pulled
from marks import FREE_ON_PURPOSE

pytestmark = FREE_ON_PURPOSE


HEX, TET, TRI, QUAD = "hexahedron", "tetrahedron", "triangle", "quadrilateral"
STRAIN = 1e-3
#: The rule on the follower's faces does not see the kinks of the leader: largest error of u.
CLOSE = 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize(
    ("first", "second", "n", "m"),
    [
        (HEX, TET, (2, 2, 2), (2, 3, 3)),
        (TET, HEX, (1, 3, 2), (2, 2, 5)),
        (TET, TET, (1, 3, 3), (1, 2, 2)),
        (HEX, HEX, (1, 2, 3), (1, 3, 2)),
        (TRI, QUAD, (3, 4), (2, 3)),
        (QUAD, TRI, (2, 5), (3, 3)),
    ],
)
def test_constant_stress_passes_through_a_tie(first, second, n, m, order):
    """A bar of two blocks in tension: u = ε (x, −ν y, −ν z)."""
    dim = len(n)
    material = SOLID if dim == 3 else ao.Solid(E, NU, 2700.0, plane="stress", thickness=0.1)
    rolls = [ao.Support(f"{axis}0", axis) for axis in "yz"[: dim - 1]]
    low, middle, high = (0, 0, 0)[:dim], (1, 0, 0)[:dim], (2, 1, 1)[:dim]
    left = ao.Structure(
        box(low, (1, 1, 1)[:dim], n, first), material, [*rolls, ao.Support("x0", "x")], order=order
    )
    right = ao.Structure(box(middle, high, m, second), material, rolls, order=order)
    bar = ao.assemble({"left": left, "right": right}, [ao.Tie("left:x1", "right:x0")])
    depth = 1.0 if dim == 3 else 0.1
    u = pulled(bar, "right", "x1", np.array([E * STRAIN * depth, 0.0, 0.0])[:dim])
    for member in bar.layout.members.values():
        exact = STRAIN * member.nodes[:, :dim] * np.array([1.0, -NU, -NU])[:dim]
        assert np.abs(u[member.rows].reshape(-1, dim) - exact).max() < CLOSE * 2 * STRAIN


@pytest.mark.slow
def test_constant_shear_passes_through_a_tie_between_held_sides():
    """u = (γ y, 0, 0) on both blocks: held on y = 0, pulled on y = 1 and on the ends."""
    G = E / (2 * (1 + NU))
    held = [ao.Support("y0"), ao.Support(lambda x: np.full(x.shape[1], True), ("y", "z"))]
    left = ao.Structure(box((0, 0, 0), (1, 1, 1), (2, 3, 2), TET), SOLID, held)
    right = ao.Structure(box((1, 0, 0), (2, 1, 1), (2, 2, 3), HEX), SOLID, held)
    both = ao.assemble({"left": left, "right": right}, [ao.Tie("left:x1", "right:x0")])
    shear = np.array([G * STRAIN, 0.0, 0.0])
    u = sum(pulled(both, part, "y1", shear) for part in ("left", "right"))
    for member in both.layout.members.values():
        assert np.abs(u[member.rows][0::3] - STRAIN * member.nodes[:, 1]).max() < 1e-11 * STRAIN


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 2])
def test_constant_stress_passes_where_four_parts_meet(order):
    """Four squares with four meshes, tied along all four lines that they share."""
    material = ao.Solid(E, NU, 2700.0, plane="stress")
    cells, counts = [QUAD, TRI, QUAD, TRI], [(2, 2), (3, 3), (4, 3), (2, 5)]
    parts = {}
    for k, (i, j) in enumerate([(0, 0), (1, 0), (0, 1), (1, 1)]):
        mesh = box((i, j), (i + 1, j + 1), counts[k], cells[k])
        rolls = [ao.Support("x0", "x")] * (i == 0) + [ao.Support("y0", "y")] * (j == 0)
        parts[f"p{i}{j}"] = ao.Structure(mesh, material, rolls, order=order)
    plate = ao.assemble(parts, [
        ao.Tie("p00:x1", "p10:x0"), ao.Tie("p01:x1", "p11:x0"),
        ao.Tie("p00:y1", "p01:y0"), ao.Tie("p10:y1", "p11:y0"),
    ])  # fmt: skip
    pull = E * STRAIN / (1 - NU)  # the same along x and y: every interface carries it
    u = sum(pulled(plate, part, "x1", np.array([pull, 0.0])) for part in ("p10", "p11"))
    u = u + sum(pulled(plate, part, "y1", np.array([0.0, pull])) for part in ("p01", "p11"))
    for member in plate.layout.members.values():
        exact = STRAIN * member.nodes[:, :2]
        assert np.abs(u[member.rows].reshape(-1, 2) - exact).max() < CLOSE * 2 * STRAIN


@pytest.mark.slow
@pytest.mark.parametrize("second", [TRI, pytest.param(QUAD, marks=pytest.mark.slow)])
def test_shell_edges_are_tied_with_their_rotations(second):
    """A cantilever plate of two sheets with different meshes bends as one of a single mesh."""
    sheet = ao.Shell(E, NU, 2700.0, 5e-3)
    clamp = ao.Support("x0")
    whole = ao.Structure(box((0, 0), (0.4, 0.2), (12, 6), TRI), sheet, [clamp])
    left = ao.Structure(box((0, 0), (0.2, 0.2), (6, 6), TRI), sheet, [clamp])
    right = ao.Structure(box((0.2, 0), (0.4, 0.2), (5, 5), second), sheet)
    tied = ao.assemble({"left": left, "right": right}, [ao.Tie("left:x1", "right:x0")])
    site = ao.Site((0.33, 0.06, 0.0), (0, 0, -1), radius=0.01)
    ours, theirs = ao.extract(tied, site, n=14), ao.extract(whole, site, n=14)
    assert ours.k0 == pytest.approx(theirs.k0, rel=2e-3)
    assert ours.omega[:4] == pytest.approx(theirs.omega[:4], rel=3e-3)


@pytest.mark.slow
@pytest.mark.parametrize("turned", [False, True])
def test_a_tie_keeps_mass_and_rigid_motions(turned):
    """A free bar of two parts, the second one made elsewhere and brought to its place."""
    left = ao.Structure(box((0, 0, 0), (1, 1, 1), (2, 2, 2), HEX), SOLID, order=1)
    right = ao.Structure(box((1, 0, 0), (2, 1, 1), (1, 3, 3), TET), SOLID, order=1)
    place = None
    if turned:
        right = ao.Structure(box((0, 0, 1), (1, 1, 2), (3, 3, 1), TET), SOLID, order=1)
        place = {"right": ao.Placement(axis=(0, 1, 0), angle=np.pi / 2, shift=(0, 0, 1))}
    bar = ao.assemble({"left": left, "right": right}, [ao.Tie("left:x1", "right:z0" if turned
                      else "right:x0")], place)  # fmt: skip
    assert bar.mass == pytest.approx(2 * 2700.0, rel=1e-12)
    assert bar.rigid_modes.shape[1] == 6
    inertia, _ = bar.rigid_inertia
    assert inertia.point == pytest.approx([1.0, 0.5, 0.5], abs=1e-12)
    along, across = 5400.0 / 6, 5400.0 * 5 / 12
    exact = np.diag([5400.0, 5400.0, 5400.0, along, across, across])
    assert inertia.matrix == pytest.approx(exact, abs=1e-9)
    low = eigenfrequencies(bar, 7)
    assert (low[:6] < 1e-5 * low[6]).all()
    # rigid motions: no force beside the sizes of its terms, and the parts follow them exactly
    K, exact = csr(bar.K), bar.layout.places.rigid_motions(inertia.point)
    q = bar.eliminated.coordinates(exact)
    assert (np.abs(K @ q) <= 1e-12 * (abs(K) @ np.abs(q)).max(axis=0)).all()
    assert bar.T @ q == pytest.approx(exact, abs=1e-12)


T, WIDTH = 0.01, 0.06
CLAMP = ao.Support("x0")
SHEET = ao.Shell(E, NU, 2700.0, T)


def root(n: int, cell: str = "hexahedron") -> ao.Structure:
    """The clamped half of a strip, as a solid."""
    mesh = box((0, 0, -T / 2), (0.1, WIDTH, T / 2), (6 * n, 3 * n, n), cell)
    return ao.Structure(mesh, SOLID, [CLAMP])


def sheet() -> ao.Structure:
    return ao.Structure(box((0, 0), (0.1, WIDTH), (6, 4), "triangle"), SHEET)


@pytest.mark.slow
@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_a_shell_edge_on_a_solid_against_the_solid_throughout(cell):
    """A cantilever strip, half solid and half shell: k0 and the bending frequencies."""
    strip = ao.Structure(
        box((0, 0, -T / 2), (0.2, WIDTH, T / 2), (24, 6, 2)), SOLID, [CLAMP], order=2
    )
    top = ao.Site((0.17, 0.02, T / 2), (0, 0, -1), radius=5e-3)
    with pytest.warns(ao.AccuracyWarning):  # the patch is as large as the faces
        whole = ao.extract(strip, top, n=16)
    exact = 1 / (1 / whole.k0 - whole.local_compliance)
    joined = ao.assemble(
        {"root": root(2, cell), "sheet": sheet()}, [ao.Tie("root:x1", "sheet:x0")],
        {"sheet": (0.1, 0, 0)},
    )  # fmt: skip
    ours = ao.extract(joined, ao.Site((0.17, 0.02, 0.0), (0, 0, -1), radius=5e-3), n=16)
    assert ours.k0 == pytest.approx(exact, rel=5e-3)
    # an uneven mesh gives a mode in the plane of the strip 6e-6 of the mass
    for omega in ours.omega[ours.m > 1e-4 * ours.m_st][:2]:
        assert np.abs(whole.omega / omega - 1).min() < 5e-3
