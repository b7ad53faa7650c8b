"""Layered shells: sections, plates of closed form, strips that are struck."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg

import antiosc as ao
from antiosc.fem.elements import section_of_layers
from antiosc.fem.linalg.algebra import multiply
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.mesh import Mesh
from antiosc.fem.platform import compat
from laminates import navier, uniform
from mpi import START, one_and_several
from paths import demo
from plates import SupportedPlate
from sheets import (
    CELLS,
    NU,
    PLY,
    RHO,
    SIMPLE,
    E,
    at,
    dof,
    edges,
    frequencies,
    interpolated,
    loaded,
    rectangle,
    sheet,
    stack,
    unsymmetric,
)

#: held as in Navier's solution for angle-plies: sliding along the edges, not across
SLIDING = [
    ao.Support(edges(0, 1), "z"),
    ao.Support(edges(0), ("x", "rx")),
    ao.Support(edges(1), ("y", "ry")),
]


def differ(one, other):
    """Largest differences of K and M, of their largest entries."""
    return [
        abs(csr(a) - csr(b)).max() / abs(csr(b)).max()
        for a, b in ((one.K, other.K), (one.M, other.M))
    ]


def test_navier_gives_the_published_frequencies():
    """ω a²/h √(ρ/E2) of square plates with a/h = 10 and the factor 5/6.

    Cross-plies: Reddy (2004); angle-plies: Khdeir, J. Sound Vib. 122 (1988) 377-388, table 1.
    """
    h = 0.1
    for angles, published in {
        (0, 90, 90, 0): 15.143,
        (0, 90): 10.473,
        (30, -30): 12.68,
        (30, -30) * 2: 17.63,
        (30, -30) * 5: 18.51,
        (45, -45): 13.04,
        (45, -45) * 2: 18.46,
        (45, -45) * 5: 19.38,
    }.items():
        layers = stack(angles, h)
        omega = navier(layers, 5 / 6 * uniform(layers)).frequencies(1, 1)[0]
        found = omega / h * np.sqrt(PLY.rho / PLY.E2)
        assert found == pytest.approx(published, abs=0.6 * 10.0 ** -len(str(published)[3:])), angles


def plate_error(n, cell, angles, h, supports):
    """Of the fundamental frequency, relative.

    Where u and w couple a thick plate ends 1e-5 low: a sheet also has an inertia about its normal.
    """
    layers = stack(angles, h)
    part = ao.Structure(rectangle(n, 1.0, 1.0, cell), ao.Laminate(layers), supports)
    return frequencies(part, 1)[0] / navier(layers).frequencies(1, 1)[0] - 1


PLATES = [
    pytest.param((0, 90, 90, 0), SIMPLE, id="0/90/90/0"),
    pytest.param((0, 90), SIMPLE, id="0/90"),
    pytest.param((45, -45), SLIDING, id="45/-45", marks=pytest.mark.slow),
]


@pytest.mark.slow
@pytest.mark.parametrize(("angles", "supports"), PLATES)
@pytest.mark.parametrize("h", [pytest.param(0.1, marks=pytest.mark.slow), 0.01])
@pytest.mark.parametrize("cell", CELLS)
def test_plates_have_naviers_frequencies(cell, h, angles, supports):
    coarse, fine = (abs(plate_error(n, cell, angles, h, supports)) for n in (4, 8))
    assert fine < 2e-4
    assert np.log2(coarse / fine) > 3.2


@pytest.mark.slow
@pytest.mark.parametrize("cell", CELLS)
def test_isotropic_layers_are_a_shell(cell):
    thirds = [ao.Layer.isotropic(E, NU, RHO, t) for t in (2e-3, 5e-3, 3e-3)]
    mesh = sheet(3, lambda s, v: (s, np.sin(1.2 * v), np.cos(1.2 * v)), cell)
    one = ao.Structure(mesh, ao.Laminate(thirds, axis=(4e-3, 1e-2, 2e-3)))
    assert max(differ(one, ao.Structure(mesh, ao.Shell(E, NU, RHO, 1e-2)))) < 1e-12


def test_a_sandwich_shears_as_its_core():
    """Thin stiff faces: Gc d²/c, d between the middles of the faces (Allen 1969)."""
    face = ao.Layer.isotropic(70e9, 0.3, 2700.0, 0.2e-3)
    core = ao.Layer.isotropic(50e6, 0.3, 60.0, 20e-3)
    S = section_of_layers([face, core, face]).S
    assert S[0, 0] == pytest.approx(core.G12 * 20.2e-3**2 / 20e-3, rel=3e-4)
    assert S[1, 1] == pytest.approx(S[0, 0], rel=1e-12)
    assert abs(S[0, 1]) < 1e-12 * S[0, 0]


@pytest.mark.parametrize("angle", [0, 30, 90, -45])
def test_a_homogeneous_section_has_five_sixths_of_its_shear_stiffness(angle):
    layers = stack([angle] * 5, 4e-3)
    section = section_of_layers(layers)
    assert pytest.approx(5 / 6 * uniform(layers), rel=1e-12, abs=1e-6) == section.S
    Q = layers[0].plane_stress()
    assert pytest.approx(Q * 4e-3, rel=1e-12, abs=1e-3) == section.A
    assert pytest.approx(Q * 4e-3**3 / 12, rel=1e-12, abs=1e-9) == section.D
    assert not section.B.any()
    assert section.I1 == 0


@pytest.mark.slow
@pytest.mark.parametrize("cell", CELLS)
def test_a_laminate_rotated_in_space_keeps_its_frequencies(cell):
    """Mesh and axis rotated together; and the top of a stack listed from the other side."""
    R = np.linalg.qr(np.random.default_rng(2).standard_normal((3, 3)))[0]
    R *= np.linalg.det(R)
    layers = unsymmetric(0.05)

    def free(R, **laminate):
        order = {"triangle": 1, "quadrilateral": 2}[cell]
        mesh = sheet(3, lambda s, t: np.tensordot(R, [s, 0.8 * t, 0.3 * s**2], 1), cell, order)
        part = ao.Structure(mesh, ao.Laminate(**laminate))
        K, M = csr(part.K).toarray(), csr(part.M).toarray()
        return np.sqrt(scipy.linalg.eigh(K, M, eigvals_only=True, subset_by_index=(6, 11)))

    here = free(np.eye(3), layers=layers)
    there = free(R, layers=layers, axis=R[:, 0])
    over = [p.rotated(-p.angle) for p in layers[::-1]]
    assert there == pytest.approx(here, rel=1e-8)
    assert free(np.eye(3), layers=over, top=(0, 0, -1)) == pytest.approx(here, rel=1e-8)
    assert free(np.eye(3), layers=over) != pytest.approx(here, rel=1e-3)


@pytest.mark.slow
def test_laminate_and_shell_by_group():
    """A step from metal to the same metal in layers, and to a lighter one."""
    mesh = rectangle((4, 2), 2.0, 1.0)
    middle = mesh.dolfinx.geometry.x[compat.geometry_nodes(mesh.dolfinx)].mean(axis=1)[:, 0]
    groups = {
        name: {2: np.flatnonzero(mask).astype(np.int32)}
        for name, mask in (("left", middle < 1), ("right", middle > 1))
    }
    mesh = Mesh(mesh.dolfinx, groups, "the step")
    metal = ao.Shell(E, NU, RHO, 0.02)
    layered = ao.Laminate([ao.Layer.isotropic(E, NU, RHO, 0.01)] * 2)
    whole = ao.Structure(mesh, metal)
    assert max(differ(ao.Structure(mesh, {"left": metal, "right": layered}), whole)) < 1e-12
    mixed = ao.Structure(mesh, {"left": metal, "right": ao.Laminate(stack([0, 30, 0], 0.01))})
    assert mixed.mass == pytest.approx(RHO * 0.02 + PLY.rho * 0.01, rel=1e-12)
    assert "Laminate and Shell" in mixed.describe()
    assert mixed.dimensions == pytest.approx((2, 1, 0.01))
    site = ao.Site((1.5, 0.5, 0), (0, 0, 1))
    assert ao.extract(mixed, site, n=2).radius == pytest.approx(0.01)
    with pytest.raises(ao.InputError, match="Solid"):
        ao.Structure(mesh, {"left": metal, "right": ao.Solid(E, NU, RHO)})
    sphere = ao.Sphere(0.01, E, NU, RHO, velocity=1.0)
    with pytest.raises(ao.InputError, match="dimensions"):
        ao.advise(ao.Structure(mesh, layered), sphere)


def two_layers(ratio=5.0):
    """Soft below, stiff and heavy above; no contraction."""
    return [
        ao.Layer.isotropic(E, 0.0, RHO, 0.01),
        ao.Layer.isotropic(ratio * E, 0.0, 2 * RHO, 0.01),
    ]


@pytest.mark.slow
@pytest.mark.parametrize("cell", CELLS)
def test_a_cantilever_strip_bends_and_stretches_as_a_beam(cell):
    """Pushed up at the tip: w = F L³/3D* + F L/S, and the middle stretches, u = (B/A) F L²/2D*."""
    close = {"triangle": 2e-5, "quadrilateral": 2e-4}[cell]
    length, width = 1.0, 0.02  # narrow: what the corners' forces do beside them fades as width²
    mesh = rectangle((10, 1), length, width, cell)
    section = section_of_layers(two_layers())
    part = ao.Structure(mesh, ao.Laminate(two_layers()), [ao.Support(at(0, 0.0))])
    y = loaded(part, {dof(part, (length, v, 0), "z"): 0.5 for v in (0, width)})
    A, B, D = section.A[0, 0], section.B[0, 0], section.D[0, 0]
    D -= B**2 / A
    tip = length**3 / (3 * D * width) + length / (section.S[0, 0] * width)
    assert y[dof(part, (length, 0, 0), "z")] == pytest.approx(tip, rel=close)
    stretch = B / A * length**2 / (2 * D * width)
    assert y[dof(part, (length, 0, 0), "x")] == pytest.approx(stretch, rel=close)


@pytest.mark.slow
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

    section = section_of_layers(layers)
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
from sheets import flipped, sheet, unsymmetric

mesh = sheet((8, 3), lambda s, t: (
    np.minimum(2 * s, 1.0), 0.4 * t + 0.1 * s**2, np.maximum(2 * s - 1, 0.0)**2), "triangle")
part = ao.Structure(mesh, ao.Laminate(unsymmetric(0.01), axis=lambda x: 1 + 0 * x),
    [ao.Support(lambda x: np.isclose(x[0], 0))])
site = ao.Site((0.52, 0.21, 0), (0, 0.3, 1), radius=0.06, snap=True)
model = ao.extract(part, site, n=4)
numbers = [part.dofs, part.mass, model.k0, model.m_st, *model.omega, *model.m]
x, cells = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.]]), np.array([[0, 1, 2], [1, 2, 3]])
few = slice(0 if MPI.COMM_WORLD.rank else 2)
bad = ao.read_mesh(compat.create_mesh(MPI.COMM_WORLD, cells[few], x if not few.stop == 0 else x[:0],
    "triangle", 1))
try:
    ao.Structure(bad, ao.Laminate(unsymmetric(0.01)))
except ao.InputError as error:
    print(json.dumps([numbers, str(error)]))
"""


@pytest.mark.slow
@pytest.mark.mpi
def test_two_ranks_find_what_one_finds():
    one, two = one_and_several(START + SCRIPT)
    assert two[0] == pytest.approx(one[0], rel=1e-6)
    assert "opposite normals at 1 edges" in two[1] == one[1]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*deflects by")  # by more than half its thickness
def test_the_demo(tmp_path):
    """Panels of one mass; the plain one as Mindlin's series has it, the sandwich far stiffer."""
    numbers = demo("composite_panel").main(elements=6, n=8, duration=3e-3, out=tmp_path)
    for row in numbers.values():
        assert row["mass"] == pytest.approx(numbers["aluminium"]["mass"], rel=1e-12)
        assert row["impulse"] == pytest.approx(row["momentum"], rel=1e-6)
    t = numbers["aluminium"]["thickness"]
    sheet = ao.material("aluminium 6061-T6")
    plate = SupportedPlate(sheet.E, sheet.nu, sheet.rho, t, 0.4, 0.3)
    exact = plate.mindlin_compliance(0.2, 0.15, radius=t)
    assert numbers["aluminium"]["k0"] == pytest.approx(1 / exact, rel=1e-2)
    assert numbers["sandwich"]["k0"] > 5 * numbers["carbon"]["k0"]
    assert numbers["carbon"]["k0"] > 2 * numbers["aluminium"]["k0"]
    assert (tmp_path / "composite_panel.png").stat().st_size > 0
