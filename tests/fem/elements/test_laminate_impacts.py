"""Laminates against beams and solids, struck, and bad input."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.base.errors import InputError
from antiosc.closed_form.plates import SupportedPlate
from antiosc.fem.elements import stacked
from antiosc.fem.linalg.algebra import multiply
from antiosc.fem.linalg.petsc_algebra import csr
from mpi import one_and_several
from paths import demo
from sheets import (
    CELLS,
    PLY,
    RHO,
    E,
    at,
    dof,
    interpolated,
    loaded,
    rectangle,
    sheet,
    stack,
    unsymmetric,
)

pytestmark = pytest.mark.slow


def two_layers(ratio=5.0):
    """Soft below, stiff and heavy above; no contraction."""
    return [
        ao.Layer.isotropic(E, 0.0, RHO, 0.01),
        ao.Layer.isotropic(ratio * E, 0.0, 2 * RHO, 0.01),
    ]


@pytest.mark.sample
@pytest.mark.parametrize("cell", CELLS)
def test_a_cantilever_strip_bends_and_stretches_as_a_beam(cell):
    """Pushed up at the tip: w = F L³/3D* + F L/S, and the middle stretches, u = (B/A) F L²/2D*."""
    close = {"triangle": 2e-5, "quadrilateral": 2e-4}[cell]
    length, width = 1.0, 0.02  # narrow: what the corners' forces do beside them fades as width²
    mesh = rectangle((10, 1), length, width, cell)
    section = stacked(two_layers())
    part = ao.Structure(mesh, ao.Laminate(two_layers()), [ao.Support(at(0, 0.0))])
    y = loaded(part, {dof(part, (length, v, 0), "z"): 0.5 for v in (0, width)})
    A, B, D = section.A[0, 0], section.B[0, 0], section.D[0, 0]
    D -= B**2 / A
    tip = length**3 / (3 * D * width) + length / (section.S[0, 0] * width)
    assert y[dof(part, (length, 0, 0), "z")] == pytest.approx(tip, rel=close)
    stretch = B / A * length**2 / (2 * D * width)
    assert y[dof(part, (length, 0, 0), "x")] == pytest.approx(stretch, rel=close)


@pytest.mark.sample
@pytest.mark.parametrize("cell", CELLS)
def test_a_free_unsymmetric_laminate_is_struck(cell):
    """Exact rigid motions, the mass ρtA, and what momentum the sphere loses the sheet has."""
    layers = unsymmetric(4e-3)
    slope = np.array([1.0, 0.0, 0.5]) / np.sqrt(1.25)
    mesh = sheet(4, lambda s, t: (0.3 * slope[0] * s, 0.2 * t, 0.3 * slope[2] * s), cell)
    part = ao.Structure(mesh, ao.Laminate(layers))
    mass = 0.06 * sum(p.rho * p.thickness for p in layers)
    assert part.mass == pytest.approx(mass, rel=1e-12)
    R = part.rigid_modes
    assert R.shape[1] == 6
    K = csr(part.K)
    assert np.abs(K @ R).max() < 1e-12 * abs(K).max() * np.abs(R).max()
    # the momentum of a uniform motion counts what the middle's rotations carry
    for axis in range(3):
        e = np.eye(3)[axis]
        push = interpolated(part, lambda x, axis=axis: {"xyz"[axis]: 1.0})
        inertia = multiply(part.M, push)
        assert part.uniform_inertia(e) == pytest.approx(inertia, rel=1e-9, abs=1e-12 * mass)
        assert push @ inertia == pytest.approx(mass, rel=1e-12)
    # a turn about y through the middle: the centroids lie off it, I1/I0 up
    x = np.array([0.15 * slope[0], 0.1, 0.15 * slope[2]])

    def turn(points):
        d = points - x
        return {"x": d[:, 2], "z": -d[:, 0], "ry": 1.0}

    section = stacked(layers)
    normal = np.cross(slope, [0, 1, 0])
    moving = interpolated(part, turn)
    shift = np.array([part.uniform_inertia(e) @ moving for e in np.eye(3)])
    assert shift == pytest.approx(
        0.06 * section.I1 * np.cross([0, 1, 0], normal), rel=1e-9, abs=1e-12
    )
    if cell == "quadrilateral":
        return
    sphere = ao.Sphere(0.01, 210e9, 0.3, 7850.0, velocity=1.0)
    model = ao.extract(part, ao.Site((0.1 * slope[0], 0.1, 0.1 * slope[2]), tuple(-normal)), n=12)
    hit = ao.simulate(model, sphere, sphere.hertz(PLY.E2, 0.3), duration=5e-4)
    lost = sphere.mass * (sphere.velocity - hit.impactor_velocity[-1])
    assert hit.impulse == pytest.approx(lost, rel=1e-6)
    assert 0.2 < hit.restitution < 1
    assert model.k0 == 0
    # φ_CR = m_CR R Rᵀb, and e is rigid too: φ_CRᵀMe = m_CR bᵀe
    assert model.participation.sum() == pytest.approx(model.m_st, rel=1e-9)


SCRIPT = """
import json
import numpy as np
import antiosc as ao
from sheets import flipped, sheet, unsymmetric

mesh = sheet((8, 3), lambda s, t: (
    np.minimum(2 * s, 1.0), 0.4 * t + 0.1 * s**2, np.maximum(2 * s - 1, 0.0)**2), "triangle")
part = ao.Structure(mesh, ao.Laminate(unsymmetric(0.01), axis=lambda x: 1 + 0 * x),
    [ao.Support(lambda x: np.isclose(x[0], 0))])
site = ao.Site((0.52, 0.21, 0), (0, 0.3, 1), radius=0.06, snap=True)
model = ao.extract(part, site, n=4)
numbers = [part.dofs, part.mass, model.k0, model.m_st, *model.omega, *model.m]
x, cells = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.]]), np.array([[0, 1, 2], [1, 2, 3]])
from mpi4py import MPI
from antiosc.fem.platform import compat
few = slice(0 if MPI.COMM_WORLD.rank else 2)
bad = ao.read_mesh(compat.create_mesh(MPI.COMM_WORLD, cells[few], x if not few.stop == 0 else x[:0],
    "triangle", 1))
try:
    ao.Structure(bad, ao.Laminate(unsymmetric(0.01)))
except ao.InputError as error:
    print(json.dumps([numbers, str(error)]))
"""


@pytest.mark.mpi
def test_two_ranks_find_what_one_finds():
    one, two = one_and_several(SCRIPT)
    assert two[0] == pytest.approx(one[0], rel=1e-6)
    assert "opposite normals at 1 edges" in two[1] == one[1]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*deflects by")  # by more than half its thickness
def test_the_demo(tmp_path):
    """Panels of one mass; the plain one as Mindlin's series has it, the sandwich far stiffer."""
    numbers = demo("composite_panel").main(elements=10, n=16, duration=3e-3, out=tmp_path)
    for row in numbers.values():
        assert row["mass"] == pytest.approx(numbers["aluminium"]["mass"], rel=1e-12)
        assert row["impulse"] == pytest.approx(row["momentum"], rel=1e-6)
    t = numbers["aluminium"]["thickness"]
    plate = SupportedPlate(70e9, 0.33, 2700.0, t, 0.4, 0.3)
    exact = plate.mindlin_compliance(0.2, 0.15, radius=t)
    assert numbers["aluminium"]["k0"] == pytest.approx(1 / exact, rel=1e-2)
    assert numbers["sandwich"]["k0"] > 20 * numbers["carbon"]["k0"]
    assert numbers["carbon"]["k0"] > 2 * numbers["aluminium"]["k0"]
    assert (tmp_path / "composite_panel.png").stat().st_size > 0


def test_directions_that_do_not_say_where():
    mesh = rectangle(2, 1.0, 1.0)
    layers = stack([0, 90], 0.01)
    for axis, message in (
        ((0, 0, 0), "the length of axis must be > 0"),
        ((1, 0), r"axis must have shape \(3\)"),
    ):
        with pytest.raises(InputError, match=message):
            ao.Laminate(layers, axis=axis)
    for laminate, message in (
        ({"axis": (0.01, 0, 1)}, r"the axis \(0.01, 0, 1\) is normal to the sheet in 8 cells"),
        ({"top": (1, 0, 0.01)}, r"top \(1, 0, 0.01\) lies along the sheet in 8 cells"),
        ({"axis": lambda x: 0 * x}, "axis has no length in 8 cells"),
        ({"axis": lambda x: x[:2]}, r"axis, as a function of x \(3, n\), must"),
    ):
        with pytest.raises(InputError, match=message):
            ao.Structure(mesh, ao.Laminate(layers, **laminate))
