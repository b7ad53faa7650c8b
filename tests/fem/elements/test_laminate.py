"""Laminates against lamination theory, Navier's series, beams, solids, and the isotropic shell."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
from mpi4py import MPI

pytest.importorskip("dolfinx")

import dolfinx

import antiosc as ao
from antiosc.closed_form.laminates import SupportedLaminate
from antiosc.closed_form.plates import SupportedPlate
from antiosc.errors import InputError
from antiosc.fem import compat
from antiosc.fem.elements.plate_section import stacked
from antiosc.fem.linalg.algebra import multiply
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.mesh.mesh import Mesh
from mpi import run_ranks
from paths import TESTS, demo
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
    flipped,
    frequencies,
    interpolated,
    loaded,
    rectangle,
    sheet,
    stack,
    unsymmetric,
)

pytestmark = pytest.mark.fem

#: held as in Navier's solution for angle-plies: sliding along the edges, not across
SLIDING = [
    ao.Support(edges(0, 1), "z"),
    ao.Support(edges(0), ("x", "rx")),
    ao.Support(edges(1), ("y", "ry")),
]


def navier(layers, S=None):
    section = stacked(layers)
    inertia = (section.I0, section.I1, section.I2)
    S = section.S if S is None else S
    return SupportedLaminate(section.A, section.B, section.D, S, inertia, 1.0, 1.0)


def uniform(layers):
    """∫ G dz, the shear stiffness without correction."""
    return sum(layer.transverse_shear() * layer.thickness for layer in layers)


def differ(one, other):
    """Largest differences of K and M, of their largest entries."""
    return [
        abs(csr(a) - csr(b)).max() / abs(csr(b)).max()
        for a, b in ((one.K, other.K), (one.M, other.M))
    ]


# --- sections ---------------------------------------------------------------------------------


@pytest.mark.parametrize("angle", [0, 30, 90, -45])
def test_a_homogeneous_section_has_five_sixths_of_its_shear_stiffness(angle):
    layers = stack([angle] * 5, 4e-3)
    section = stacked(layers)
    assert pytest.approx(5 / 6 * uniform(layers), rel=1e-12, abs=1e-6) == section.S
    Q = layers[0].plane_stress()
    assert pytest.approx(Q * 4e-3, rel=1e-12, abs=1e-3) == section.A
    assert pytest.approx(Q * 4e-3**3 / 12, rel=1e-12, abs=1e-9) == section.D
    assert not section.B.any()
    assert section.I1 == 0


@pytest.mark.parametrize(
    ("angles", "factors"), [([0, 90, 90, 0], (0.59518, 0.72053)), ([0, 90], (0.8212, 0.8212))]
)
def test_shear_factors_are_whitneys(angles, factors):
    """E1/E2 = 25, G12 = G13 = E2/2, G23 = E2/5, ν12 = 1/4.

    Whitney (1972, 1973) lets the plate bend to a cylinder without moment across; here it bends
    without any, which differs by what the Poisson effect of the layers does, below 0.05 %.
    """
    ply = ao.Layer(25e9, 1e9, 0.25, 0.5e9, 0.5e9, 0.2e9, 1500.0, 1e-3)
    layers = stack(angles, 4e-3, ply)
    found = np.diag(stacked(layers).S) / np.diag(uniform(layers))
    assert found == pytest.approx(factors, rel=5e-4)


def test_a_sandwich_shears_as_its_core():
    """Thin stiff faces: Gc d²/c, d between the middles of the faces (Allen 1969)."""
    face = ao.Layer.isotropic(70e9, 0.3, 2700.0, 0.2e-3)
    core = ao.Layer.isotropic(50e6, 0.3, 60.0, 20e-3)
    S = stacked([face, core, face]).S
    assert S[0, 0] == pytest.approx(core.G12 * 20.2e-3**2 / 20e-3, rel=3e-4)
    assert S[1, 1] == pytest.approx(S[0, 0], rel=1e-12)
    assert abs(S[0, 1]) < 1e-12 * S[0, 0]


def test_a_ply_at_an_angle():
    """1/Ex = c⁴/E1 + (1/G12 − 2ν12/E1) s²c² + s⁴/E2 (Jones, eq. 2.97), and whole turns."""
    for angle in (0, 20, 45, 70, 90, 200):
        c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
        Q = PLY.rotated(angle).plane_stress()
        exact = c**4 / PLY.E1 + (1 / PLY.G12 - 2 * PLY.nu12 / PLY.E1) * (s * c) ** 2 + s**4 / PLY.E2
        assert np.linalg.inv(Q)[0, 0] == pytest.approx(exact, rel=1e-12)
    # fibres at +20°: stretching along 1 pulls them to shear of the positive sign
    assert PLY.rotated(20).plane_stress()[0, 2] > 0
    assert PLY.rotated(360 + 20).plane_stress() == pytest.approx(
        PLY.rotated(20).plane_stress(), rel=1e-12
    )


def test_sections_are_positive_definite():
    rng = np.random.default_rng(5)
    for _ in range(50):
        layers = [
            ao.Layer(
                *10 ** rng.uniform(7, 11, 2), 0.0, *10 ** rng.uniform(6, 10, 3), 1500.0, 1e-3, angle
            )
            for angle in rng.uniform(-90, 90, rng.integers(1, 6))
        ]
        layers = [
            replace(p, nu12=0.9 * rng.uniform(-1, 1) * np.sqrt(p.E1 / p.E2), thickness=t)
            for p, t in zip(layers, 10 ** rng.uniform(-4, -2, len(layers)), strict=True)
        ]
        s = stacked(layers)
        h = s.thickness
        whole = np.block([[s.A, s.B / h], [s.B / h, s.D / h**2]])
        assert np.linalg.eigvalsh(whole)[0] > 0
        assert np.linalg.eigvalsh(s.S)[0] > 0
        # equilibrium asks for more energy than uniform strain: S is below ∫G dz
        assert np.linalg.eigvalsh(uniform(layers) - s.S)[0] >= -1e-9 * s.S.max()
        assert s.I0 * s.I2 > s.I1**2


def test_which_stacks_have_sides():
    sides = {(0, 90): True, (45,): True, (45, -45, -45, 45): True}
    none = {(0, 90, 90, 0): False, (45, -45): False, (30, -30, 30, -30): False, (0,): False}
    for angles, expected in (sides | none).items():
        assert stacked(stack(angles, 1e-3)).has_sides is expected, angles


def test_a_flipped_section_is_that_of_its_flipped_stack():
    """Listed from the other side, and about the same 0° all angles change sign."""
    layers = unsymmetric(2e-3)
    here = stacked(layers).flipped
    there = stacked([p.rotated(-p.angle) for p in layers[::-1]])
    for name in ("A", "B", "D", "S", "I0", "I1", "I2"):
        one, other = np.asarray(getattr(here, name)), np.asarray(getattr(there, name))
        assert np.abs(one - other).max() < 1e-12 * np.abs(other).max(), name
        assert name == "S" or np.abs(other).min() > 0


# --- plates -----------------------------------------------------------------------------------


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


def test_navier_of_one_isotropic_layer_is_mindlins():
    theory = SupportedPlate(E, NU, RHO, 0.1, 1.0, 1.0)
    found = navier([ao.Layer.isotropic(E, NU, RHO, 0.1)])
    for m, n in ((1, 1), (2, 1), (2, 3)):
        assert found.frequencies(m, n)[0] == pytest.approx(theory.mindlin(m, n), rel=1e-10)
    thin = navier([ao.Layer.isotropic(E, NU, RHO, 1e-4)]).frequencies(1, 1)
    exact = SupportedPlate(E, NU, RHO, 1e-4, 1.0, 1.0).mindlin(1, 1)
    assert thin[0] == pytest.approx(exact, rel=1e-6)
    shear = np.sqrt(10 * E / (2 * (1 + NU)) / RHO) / 1e-4  # of the thickness, 5/6 · 12 G/ρh²
    assert thin[-1] == pytest.approx(shear, rel=1e-4)


def test_navier_of_thin_coupled_plates():
    """ω/h has a limit, which rounding of the thickness-shear modes must not drown."""
    for angles in ((0, 90), (45, -45)):
        thick, thin = (navier(stack(angles, h)).frequencies(1, 1)[0] / h for h in (1e-3, 1e-4))
        assert thin == pytest.approx(thick, rel=2e-4)


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
    pytest.param((45, -45), SLIDING, id="45/-45"),
]


@pytest.mark.parametrize(("angles", "supports"), PLATES)
@pytest.mark.parametrize("h", [pytest.param(0.1, marks=pytest.mark.slow), 0.01])
@pytest.mark.parametrize("cell", CELLS)
def test_plates_have_naviers_frequencies(cell, h, angles, supports):
    coarse, fine = (abs(plate_error(n, cell, angles, h, supports)) for n in (4, 8))
    assert fine < 2e-4
    assert np.log2(coarse / fine) > 3.2


def test_a_soft_core_leaves_no_spurious_mode():
    """What the quadrilaterals integrate in full must count with how soft in shear the stack is."""
    core = ao.Layer.isotropic(1e6, 0.3, 30.0, 20e-3)
    face = [PLY.rotated(a) for a in (0, 90)]
    layers = [*face, core, *face[::-1]]
    found = []
    for cell in CELLS:
        part = ao.Structure(rectangle(4, 1.0, 1.0, cell), ao.Laminate(layers))
        K, M = csr(part.K).toarray(), csr(part.M).toarray()
        values = scipy.linalg.eigh(K, M, eigvals_only=True, subset_by_index=(0, 9))
        assert abs(values[5]) < 1e-4 * values[6]
        found.append(np.sqrt(values[6:]))
    assert found[0] == pytest.approx(found[1], rel=5e-3)


def test_an_isotropic_section_stands_for_its_own_thickness():
    for nu in (0.0, 0.3, -0.5):
        section = stacked([ao.Layer.isotropic(E, nu, RHO, 3e-3)] * 2)
        assert section.t2_of_shear == pytest.approx(36e-6, rel=1e-12)
        assert section.t2_of_stretch == pytest.approx(36e-6, rel=1e-12)


# --- axes, angles and sides -------------------------------------------------------------------


@pytest.mark.parametrize("cell", CELLS)
def test_isotropic_layers_are_a_shell(cell):
    thirds = [ao.Layer.isotropic(E, NU, RHO, t) for t in (2e-3, 5e-3, 3e-3)]
    mesh = sheet(3, lambda s, v: (s, np.sin(1.2 * v), np.cos(1.2 * v)), cell)
    one = ao.Structure(mesh, ao.Laminate(thirds, axis=(0.4, 1, 0.2)))
    assert max(differ(one, ao.Structure(mesh, ao.Shell(E, NU, RHO, 1e-2)))) < 1e-12


@pytest.mark.parametrize("cell", CELLS)
def test_angles_count_from_the_axis_about_the_normal(cell):
    """One ply at 30° is one at 0° on an axis rotated by 30°; seen from below it lies at −30°."""
    mesh = rectangle(3, 1.0, 1.0, cell)
    rotated = (np.cos(np.pi / 6), np.sin(np.pi / 6), 0.7)  # its part off the sheet does not count
    here = ao.Structure(mesh, ao.Laminate([PLY.rotated(30)], axis=(2, 0, 0)))
    for same in (
        ao.Laminate([PLY], axis=rotated),
        ao.Laminate([PLY.rotated(-30)], top=(0.5, 0, -1)),
        ao.Laminate([PLY.rotated(-60)], axis=(0, 1, 0)),
    ):
        assert max(differ(ao.Structure(mesh, same), here)) < 1e-12
    other = ao.Structure(mesh, ao.Laminate([PLY.rotated(-30)]))
    assert differ(other, here)[0] > 1e-3


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


@pytest.mark.parametrize("cell", CELLS)
def test_opposite_normals(cell):
    """Refused where they matter, and settled by a top."""
    mesh = rectangle(3, 1.0, 1.0, cell)
    both = mesh, flipped(mesh, slice(4, 5))
    layers = unsymmetric(0.05)
    with pytest.raises(InputError, match=r"opposite normals at [34] edges, one at \(.*give Lamina"):
        ao.Structure(both[1], ao.Laminate(layers))
    straight, settled = (
        ao.Structure(m, ao.Laminate(layers, top=(0, 0.2, 1)), SIMPLE) for m in both
    )
    assert frequencies(settled, 3) == pytest.approx(frequencies(straight, 3), rel=1e-9)
    assert max(differ(ao.Structure(mesh, ao.Laminate(layers), SIMPLE), straight)) < 1e-12
    # a stack that is itself when flipped, asks for nothing
    same, part = (ao.Structure(m, ao.Laminate(stack([45, -45], 0.05)), SIMPLE) for m in both)
    assert frequencies(part, 2) == pytest.approx(frequencies(same, 2), rel=1e-9)


def test_the_top_of_a_plane_mesh_is_up():
    """dolfinx turns every other triangle of its own rectangles over."""
    corners = [np.zeros(2), np.ones(2)]
    built = ao.read_mesh(dolfinx.mesh.create_rectangle(MPI.COMM_WORLD, corners, [3, 3]))
    layers = unsymmetric(0.05)
    here = ao.Structure(built, ao.Laminate(layers), SIMPLE)
    cells = compat.geometry_nodes(built.dolfinx).astype(np.int64)
    space = ao.read_mesh(
        compat.create_mesh(built.comm, cells, built.dolfinx.geometry.x.copy(), "triangle", 1)
    )
    there = ao.Structure(space, ao.Laminate(layers, top=(0, 0, 1)), SIMPLE)
    assert frequencies(here, 2) == pytest.approx(frequencies(there, 2), rel=1e-9)
    with pytest.raises(InputError, match="opposite normals"):
        ao.Structure(space, ao.Laminate(layers))


def test_sides_end_where_three_sheets_meet():
    """A blade on a plate: the common edge has no side to keep, each sheet has its own."""
    x = np.array(
        [[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0], [1, 0, 1], [1, 1, 1.0]]
    )
    cells = np.array([[0, 1, 3, 4], [1, 4, 2, 5], [1, 4, 6, 7]])  # all go along it the same way
    mesh = ao.read_mesh(compat.create_mesh(MPI.COMM_WORLD, cells, x, "quadrilateral", 1))
    part = ao.Structure(mesh, ao.Laminate(unsymmetric(0.01), axis=(1, 1, 0)))
    assert part.rigid_modes.shape[1] == 6


def test_an_axis_as_a_function():
    """Around a cylinder, which no vector is, 0° is what 90° (or −90°) is from the axis along it."""
    mesh = sheet((2, 6), lambda s, v: (s, np.sin(2 * v), np.cos(2 * v)))
    layers = stack([10, 60], 0.02)
    hoop = ao.Laminate(layers, axis=lambda x: np.stack([0 * x[0], -x[2], x[1]]))
    along = ao.Laminate([p.rotated(p.angle - 90) for p in layers])
    outward = {"top": lambda x: x * [[0], [1], [1]]}
    one, other = (ao.Structure(mesh, replace(lam, **outward)) for lam in (hoop, along))
    # S belongs to the axes: bending to a cylinder along 0° and along 90°
    assert max(differ(one, other)) < 1e-9


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
    mixed = ao.Structure(mesh, {"left": metal, "right": ao.Laminate(stack([0, 30], 0.01))})
    assert mixed.mass == pytest.approx(RHO * 0.02 + PLY.rho * 0.01, rel=1e-12)
    assert "Laminate and Shell" in mixed.describe()
    assert mixed.dimensions == pytest.approx((2, 1, 0.01))
    site = ao.Site((1.5, 0.5, 0), (0, 0, 1))
    assert ao.extract(mixed, site, n=2).radius == pytest.approx(0.01)
    with pytest.raises(InputError, match="of one family: Solid, Beam, or Shell and Laminate"):
        ao.Structure(mesh, {"left": metal, "right": ao.Solid(E, NU, RHO)})
    sphere = ao.Sphere(0.01, E, NU, RHO, velocity=1.0)
    with pytest.raises(InputError, match="got a Laminate: give the dimensions"):
        ao.advise(ao.Structure(mesh, layered), sphere)


# --- against beams and solids -----------------------------------------------------------------


def two_layers(ratio=5.0):
    """Soft below, stiff and heavy above; no contraction."""
    return [
        ao.Layer.isotropic(E, 0.0, RHO, 0.01),
        ao.Layer.isotropic(ratio * E, 0.0, 2 * RHO, 0.01),
    ]


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


def sandwich():
    """Faces on a core a hundred times softer; with 5/6 its shear would be 20 times too stiff."""
    face = ao.Layer.isotropic(E, 0.0, RHO, 2.5e-3)
    return [face, ao.Layer.isotropic(E / 100, 0.0, 60.0, 15e-3), face]


@pytest.mark.parametrize(("layers", "through", "count"), [(two_layers, 4, 4), (sandwich, 8, 2)])
def test_a_layered_cantilever_as_shell_and_solid(layers, through, count):
    """Frequencies up and down, sideways, in twist; where thick faces bend alone, the lowest two."""
    length, width, h = 0.4, 0.04, 0.02
    held = [ao.Support(at(0, 0.0))]
    box = dolfinx.mesh.create_box(
        MPI.COMM_WORLD,
        [np.array([0, 0, -h / 2]), np.array([length, width, h / 2])],
        [12, 1, through],
        dolfinx.mesh.CellType.hexahedron,
    )
    middle = box.geometry.x[compat.geometry_nodes(box)].mean(axis=1)[:, 2]
    number = np.searchsorted(np.cumsum([layer.thickness for layer in layers()]) - h / 2, middle)
    groups, materials = {}, {}
    for k, layer in enumerate(layers()):
        groups[f"layer {k}"] = {3: np.flatnonzero(number == k).astype(np.int32)}
        materials[f"layer {k}"] = ao.Solid(layer.E1, layer.nu12, layer.rho)
    solid = ao.Structure(Mesh(box, groups, "the box"), materials, held)
    shell = ao.Structure(rectangle((12, 1), length, width), ao.Laminate(layers()), held)
    assert shell.mass == pytest.approx(solid.mass, rel=1e-12)
    found, exact = frequencies(shell, count), frequencies(solid, count)
    assert found == pytest.approx(exact, rel=1e-2)
    assert found[:2] == pytest.approx(exact[:2], rel=2.5e-3)


# --- struck -----------------------------------------------------------------------------------


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
import json, sys
sys.path.insert(0, sys.argv[1])
import numpy as np
import antiosc as ao
from sheets import flipped, sheet, unsymmetric

mesh = sheet((8, 3), lambda s, t: (
    np.minimum(2 * s, 1.0), 0.4 * t + 0.1 * s**2, np.maximum(2 * s - 1, 0.0)**2), "triangle")
part = ao.Structure(mesh, ao.Laminate(unsymmetric(0.01), axis=lambda x: 1 + 0 * x),
    [ao.Support(lambda x: np.isclose(x[0], 0))])
site = ao.Site((0.52, 0.21, 0), (0, 0.3, 1), radius=0.06, snap=True)
model = ao.extract(part, site, n=4)
print(json.dumps([part.dofs, part.mass, model.k0, model.m_st, *model.omega, *model.m]))
x, cells = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.]]), np.array([[0, 1, 2], [1, 2, 3]])
from mpi4py import MPI
from antiosc.fem import compat
few = slice(0 if MPI.COMM_WORLD.rank else 2)
bad = ao.read_mesh(compat.create_mesh(MPI.COMM_WORLD, cells[few], x if not few.stop == 0 else x[:0],
    "triangle", 1))
try:
    ao.Structure(bad, ao.Laminate(unsymmetric(0.01)))
except ao.InputError as error:
    print(json.dumps(str(error)))
"""


@pytest.mark.mpi
def test_two_ranks_find_what_one_finds():
    here = str(TESTS)
    one = [json.loads(line) for line in run_ranks(1, SCRIPT, here)[0].splitlines()[-2:]]
    for text in run_ranks(2, SCRIPT, here):
        numbers, message = (json.loads(line) for line in text.splitlines()[-2:])
        assert numbers == pytest.approx(one[0], rel=1e-6)
        assert "opposite normals at 1 edges" in message == one[1]


@pytest.mark.slow
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


# --- bad input --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"E1": -1.0}, "E1 must be > 0"),
        ({"E2": 0.0}, "E2 must be > 0"),
        ({"G12": -1e9}, "G12 must be > 0"),
        ({"G13": float("nan")}, "G13 must be finite"),
        ({"G23": 0.0}, "G23 must be > 0"),
        ({"rho": 0.0}, "rho must be > 0"),
        ({"thickness": -1e-3}, "thickness must be > 0"),
        ({"angle": "ninety"}, "angle must be a number"),
        ({"nu12": 6.4}, r"nu12² must be < E1/E2 = 40, .* got nu12 = 6.4 \(is it nu21\?\)"),
    ],
)
def test_a_layer_needs_a_material(wrong, message):
    with pytest.raises(InputError, match=message):
        replace(PLY, **wrong)


def test_isotropic_layers_are_checked_as_shells():
    with pytest.raises(InputError, match="nu must lie in"):
        ao.Layer.isotropic(E, 0.5, RHO, 1e-3)
    with pytest.raises(InputError, match="E must be > 0"):
        ao.Layer.isotropic(-E, 0.3, RHO, 1e-3)


@pytest.mark.parametrize("layers", [[], [1.0, 2.0], "0/90", None])
def test_a_laminate_needs_layers(layers):
    with pytest.raises(InputError, match="layers lists the Layer objects of the stack"):
        ao.Laminate(layers)


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


def test_navier_refuses_what_it_does_not_solve():
    for angles in ([30], [30, -30, -30, 30], [0, 45]):
        with pytest.raises(InputError, match="a cross-ply or an antisymmetric angle-ply"):
            navier(stack(angles, 0.01))
