"""Laminates against lamination theory, Navier's series, beams, solids, and the isotropic shell."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg

import antiosc as ao
from antiosc.base.errors import InputError
from antiosc.fem.elements import stacked
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.mesh import Mesh
from antiosc.fem.platform import compat
from laminates import navier, uniform
from sheets import (
    CELLS,
    NU,
    PLY,
    RHO,
    SIMPLE,
    E,
    edges,
    flipped,
    frequencies,
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


# --- axes, angles and sides -------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("cell", CELLS)
def test_isotropic_layers_are_a_shell(cell):
    thirds = [ao.Layer.isotropic(E, NU, RHO, t) for t in (2e-3, 5e-3, 3e-3)]
    mesh = sheet(3, lambda s, v: (s, np.sin(1.2 * v), np.cos(1.2 * v)), cell)
    one = ao.Structure(mesh, ao.Laminate(thirds, axis=(0.4, 1, 0.2)))
    assert max(differ(one, ao.Structure(mesh, ao.Shell(E, NU, RHO, 1e-2)))) < 1e-12


@pytest.mark.slow
@pytest.mark.sample(-1)
@pytest.mark.parametrize("cell", CELLS)
def test_opposite_normals(cell):
    """Refused where they matter, and settled by a top."""
    mesh = rectangle(3, 1.0, 1.0, cell)
    both = mesh, flipped(mesh, slice(4, 5))
    layers = unsymmetric(0.05)
    with pytest.raises(InputError, match="opposite"):
        ao.Structure(both[1], ao.Laminate(layers))
    straight, settled = (
        ao.Structure(m, ao.Laminate(layers, top=(0, 0.2, 1)), SIMPLE) for m in both
    )
    assert frequencies(settled, 3) == pytest.approx(frequencies(straight, 3), rel=1e-9)
    assert max(differ(ao.Structure(mesh, ao.Laminate(layers), SIMPLE), straight)) < 1e-12
    # a stack that is itself when flipped, asks for nothing
    same, part = (ao.Structure(m, ao.Laminate(stack([45, -45], 0.05)), SIMPLE) for m in both)
    assert frequencies(part, 2) == pytest.approx(frequencies(same, 2), rel=1e-9)


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


def test_a_flipped_section_is_that_of_its_flipped_stack():
    """Listed from the other side, and about the same 0° all angles change sign."""
    layers = unsymmetric(2e-3)
    here = stacked(layers).flipped
    there = stacked([p.rotated(-p.angle) for p in layers[::-1]])
    for name in ("A", "B", "D", "S", "I0", "I1", "I2"):
        one, other = np.asarray(getattr(here, name)), np.asarray(getattr(there, name))
        assert np.abs(one - other).max() < 1e-12 * np.abs(other).max(), name
        assert name == "S" or np.abs(other).min() > 0


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
    mixed = ao.Structure(mesh, {"left": metal, "right": ao.Laminate(stack([0, 30], 0.01))})
    assert mixed.mass == pytest.approx(RHO * 0.02 + PLY.rho * 0.01, rel=1e-12)
    assert "Laminate and Shell" in mixed.describe()
    assert mixed.dimensions == pytest.approx((2, 1, 0.01))
    site = ao.Site((1.5, 0.5, 0), (0, 0, 1))
    assert ao.extract(mixed, site, n=2).radius == pytest.approx(0.01)
    with pytest.raises(InputError, match="Solid"):
        ao.Structure(mesh, {"left": metal, "right": ao.Solid(E, NU, RHO)})
    sphere = ao.Sphere(0.01, E, NU, RHO, velocity=1.0)
    with pytest.raises(InputError, match="dimensions"):
        ao.advise(ao.Structure(mesh, layered), sphere)
