"""Solids: patches, closed forms, shear locking; what all families know of themselves."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import antiosc as ao
import parts
from antiosc.fem.elements.shell import GivenSheet
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.platform import compat
from marks import FREE_ON_PURPOSE
from parts import STEEL, box, line, named, nodal, plate
from sheets import PLY

pytestmark = [
    FREE_ON_PURPOSE,
    pytest.mark.filterwarnings("ignore:the compliance under a point"),
]


def k0(part: ao.Structure, point, direction=(0.3, 0.5, 0.8)) -> float:
    return ao.extract(part, ao.Site(point, direction), n=3).k0


def half_space_patch(E: float, nu: float, direction: np.ndarray) -> float:
    """Compliance × radius of a patch by quadrature of Boussinesq's and Cerruti's point solutions.

    Weights √(1 − r²/a²) of load and displacement; a = 1. With P(s) the autocorrelation of the
    normalised weight, the compliance is ∫ P(s) u(s) d²s, and u ~ 1/s times a function of the
    angle: ∫ P(s) ds over s, times the mean over the angle.
    """
    G = E / 2 / (1 + nu)
    normal, tangential = direction[2], np.hypot(*direction[:2])
    # Johnson, Contact Mechanics, (3.18), (3.75): u_z = (1 - ν) F/(2πGs), u_x = F/(2πGs)
    # (1 - ν + ν cos²)
    angle = (np.arange(64) + 0.5) * np.pi / 32
    along = np.mean((1 - nu) + nu * np.cos(angle) ** 2)
    shape = normal**2 * (1 - nu) + tangential**2 * along  # the coupling normal–tangential is odd
    # ∫ P(s) ds · 2π/(2πG), with P by its Fourier transform W(k)², W(k) = 3 j1(k)/k: on a line
    # through the origin ∫0^∞ P ds = (1/2π)∫ W² dk (central slice, and ∫ over the half line).
    k = (np.arange(400_000) + 0.5) * 2.5e-3
    j1_over_k = (np.sin(k) / k - np.cos(k)) / k**2
    area = np.sum((3 * j1_over_k) ** 2) * 2.5e-3 / (2 * np.pi)
    return shape * area / G


PLANE = {"plane": "stress", "thickness": 0.01}


def material(mesh: ao.Mesh, **constants: float) -> ao.Solid:
    extra = PLANE if mesh.gdim == 2 else {}
    return ao.Solid(**{**parts.STEEL, **extra, **constants})


def on_boundary(structure: ao.Structure, size) -> np.ndarray:
    """Whether each dof lies on the boundary of a box from the origin."""
    form = structure.form
    mask = np.zeros(structure.K.getSize()[0], dtype=bool)
    for path in form.components.values():
        dofs, x = compat.dof_coordinates(form.space, path)
        d = len(size)
        mask[dofs] = np.any(np.isclose(x[:, :d], 0) | np.isclose(x[:, :d], size), axis=1)
    return mask


def shaken(cell: str, size, amount: float = 0.15) -> ao.Mesh:
    """A box or plate whose inner nodes are moved at random: no two cells alike."""
    n = [3, 3, 3][: len(size)]
    mesh = parts.box(n, size, cell)
    x = mesh.dolfinx.geometry.x
    d = len(size)
    inner = np.all(~np.isclose(x[:, :d], 0) & ~np.isclose(x[:, :d], size), axis=1)
    rng = np.random.default_rng(3)
    x[inner, :d] += amount * np.asarray(size) / 3 * rng.uniform(-1, 1, (inner.sum(), d))
    return mesh


@pytest.mark.slow
@pytest.mark.parametrize("cell", parts.CELLS)
@pytest.mark.parametrize(("geometry", "order"), [(1, 1), (1, 2), (2, 2)])
def test_mass_and_rigid_motions_are_exact(tmp_path, cell, geometry, order):
    path = parts.gmsh_cube(tmp_path / "cube.msh", cell, geometry, bent=geometry == 2)
    mesh = ao.read_mesh(path)
    structure = ao.Structure(mesh, material(mesh), order=order)
    depth = 1.0 if mesh.gdim == 3 else PLANE["thickness"]
    mass = parts.STEEL["rho"] * depth  # the bent cube keeps its volume
    assert structure.mass == pytest.approx(mass, rel=1e-13)
    K, M, R = csr(structure.K), csr(structure.M), structure.rigid_modes
    assert R.shape[1] == (6 if mesh.gdim == 3 else 3)
    assert structure.shift > 0
    np.testing.assert_allclose(R.T @ (M @ R), np.eye(R.shape[1]), atol=1e-12)
    assert np.abs(K @ R).max() < 1e-12 * abs(K).max() * np.abs(R).max()
    # An infinitesimal rotation is among them, and the mass matrix knows every translation.
    d = mesh.gdim
    turn = nodal(structure, lambda x: np.array([-x[1], x[0], 0 * x[0]])[:d])
    assert np.linalg.norm(turn - R @ (R.T @ (M @ turn))) < 1e-11 * np.linalg.norm(turn)
    for axis in range(d):
        shift = nodal(structure, lambda x, a=axis: np.eye(d)[a][:, None] + 0 * x[:d])
        assert shift @ (M @ shift) == pytest.approx(mass, rel=1e-13)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("cell", parts.CELLS)
def test_patch_of_constant_strain(cell, order):
    """A linear displacement field on irregular cells: no force inside, the exact energy."""
    size = (0.3, 0.2, 0.1) if cell in ("tetrahedron", "hexahedron") else (0.3, 0.2)
    mesh = shaken(cell, size)
    structure = ao.Structure(mesh, material(mesh), order=order)
    d = mesh.gdim
    gradient = np.array([[1.0, 2.0, -0.5], [0.3, -1.5, 0.8], [0.6, -0.2, 0.7]])[:d, :d] * 1e-3
    u = nodal(structure, lambda x: gradient @ x[:d])
    force = csr(structure.K) @ u
    inner = ~on_boundary(structure, size)
    assert inner.sum() >= (4 * d if order == 1 else 25 * d)
    assert np.abs(force[inner]).max() < 1e-12 * np.abs(force).max()
    E, nu = parts.STEEL["E"], parts.STEEL["nu"]
    strain = (gradient + gradient.T) / 2
    if d == 2:  # plane stress, by hand
        G = E / 2 / (1 + nu)
        xx, yy, xy = strain[0, 0], strain[1, 1], strain[0, 1]
        density = E / (1 - nu**2) * (xx**2 + yy**2 + 2 * nu * xx * yy) / 2 + 2 * G * xy**2
        density *= PLANE["thickness"]
    else:
        stress = E / (1 + nu) * (strain + nu / (1 - 2 * nu) * np.trace(strain) * np.eye(3))
        density = np.sum(stress * strain) / 2
    assert u @ force / 2 == pytest.approx(density * np.prod(size), rel=1e-12)


E, NU, RHO = 70e9, 0.33, 2700.0
#: About a pine's, Pa.
WOOD = {"E": (12e9, 0.9e9, 0.5e9), "nu": (0.4, 0.42, 0.45), "G": (0.8e9, 0.75e9, 0.07e9)}


def turn(angle: float) -> np.ndarray:
    """Rotation about (1, 2, 3)."""
    n = np.array([1, 2, 3]) / np.sqrt(14)
    K = np.array([[0, -n[2], n[1]], [n[2], 0, -n[0]], [-n[1], n[0], 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * (K @ K)


def test_waves_in_bars_run_at_the_speed_of_the_stiffest_direction():
    """√(E/ρ): of the fibres, of layers at any angle, of an isotropic sheet."""
    wood = ao.AnisotropicSolid.orthotropic(**WOOD, rho=500.0, axes=np.roll(np.eye(3), 1, 1))
    assert wood.bar_speed() == pytest.approx(np.sqrt(12e9 / 500.0), rel=1e-12)
    shear = {"G12": 5e9, "G13": 5e9, "G23": 3e9}
    ply = ao.Layer(E1=140e9, E2=10e9, nu12=0.3, **shear, rho=1600.0, thickness=1e-3)
    for layers in ([ply], [ply, ply.rotated(90)]):
        speed = ao.Laminate(layers, axis=(1, 0, 0)).bar_speed()
        assert speed == pytest.approx(np.sqrt(140e9 / 1600.0), rel=1e-12)
    plane = np.array([[1, NU, 0], [NU, 1, 0], [0, 0, (1 - NU) / 2]]) * E / (1 - NU**2)
    t = 2e-3
    sheet = GivenSheet(t * plane, t**3 / 12 * plane, 1e7 * np.eye(2), RHO * t, RHO * t**3 / 12, t)
    assert sheet.bar_speed() == pytest.approx(np.sqrt(E / RHO), rel=1e-12)


@pytest.mark.parametrize("along", [0, 1, 2])
def test_a_bar_is_as_stiff_as_the_modulus_along_it(along):
    """Its end moves as one and it may contract: E_i A / L."""
    material = ao.AnisotropicSolid.orthotropic(**WOOD, rho=500.0, axes=np.roll(np.eye(3), along, 1))
    # rows rolled: direction 1 + k of the material lies along x + along + k
    own = np.linalg.inv(material.voigt)
    modulus = WOOD["E"][-along % 3]
    assert 1 / own[0, 0] == pytest.approx(modulus, rel=1e-12)


@pytest.mark.parametrize("plane", ["stress", "strain"])
def test_plane_states_in_tension(plane):
    """A strip pulled at its end stretches by F L/(E' A), with E' = E or E/(1 − ν²)."""
    L, h, t = 0.2, 0.06, 0.004
    mesh = parts.plate((6, 3), (L, h), "triangle")
    solid = ao.Solid(**parts.STEEL, plane=plane, thickness=t)
    held = [
        ao.Support("left", "x"),
        ao.Support(lambda x: np.isclose(x[0], 0) & np.isclose(x[1], 0), "y"),
    ]
    structure = ao.Structure(mesh, solid, held)
    modulus = solid.E if plane == "stress" else solid.E / (1 - solid.nu**2)
    contraction = solid.nu if plane == "stress" else solid.nu / (1 - solid.nu)
    strain = 1e-3
    u = nodal(structure, lambda x: strain * np.array([x[0], -contraction * x[1]]))
    force = csr(structure.K) @ u
    dofs, x = compat.dof_coordinates(structure.form.space, (0,))
    pulled = np.zeros(len(u), dtype=bool)
    pulled[dofs] = np.isclose(x[:, 0], L)
    assert force[pulled].sum() == pytest.approx(modulus * strain * h * t, rel=1e-12)
    rest = ~pulled
    rest[structure.fixed] = False
    assert np.abs(force[rest]).max() < 1e-11 * np.abs(force).max()


def test_several_materials_by_group():
    """Two bars in a row: the compliance is the sum, the mass too."""
    L, b, h = 0.2, 0.05, 0.04
    halves = {
        "left": (2, lambda x: np.isclose(x[0], 0)),
        "soft": (3, lambda x: x[0] <= L / 2 + 1e-9),
        "stiff": (3, lambda x: x[0] >= L / 2 - 1e-9),
    }
    mesh = parts.box((4, 2, 2), (L, b, h), groups=halves)
    soft = ao.Solid(E=3e9, nu=0.0, rho=1200.0)
    stiff = ao.Solid(E=200e9, nu=0.0, rho=8000.0)
    structure = ao.Structure(mesh, {"soft": soft, "stiff": stiff}, [ao.Support("left", "x")])
    assert structure.mass == pytest.approx(b * h * L / 2 * (1200 + 8000), rel=1e-13)
    strains = np.array([1 / soft.E, 1 / stiff.E]) / (b * h)  # under 1 N
    u = nodal(structure, lambda x: np.array([
        strains[0] * np.minimum(x[0], L / 2) + strains[1] * np.maximum(x[0] - L / 2, 0),
        0 * x[0], 0 * x[0],
    ]))  # fmt: skip
    force = csr(structure.K) @ u
    dofs, x = compat.dof_coordinates(structure.form.space, (0,))
    pulled = np.zeros(len(u), dtype=bool)
    pulled[dofs] = np.isclose(x[:, 0], L)
    assert force[pulled].sum() == pytest.approx(1.0, rel=1e-12)
    rest = ~pulled
    rest[structure.fixed] = False
    assert np.abs(force[rest]).max() < 1e-11


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.45])
@pytest.mark.parametrize("degrees", [0, 30, 60, 90])
def test_half_space_compliance_along_any_direction(nu, degrees):
    solid = ao.Solid(E=2.0, nu=nu, rho=1.0)
    t = np.radians(degrees)
    direction = np.array([np.sin(t) * 0.6, np.sin(t) * 0.8, np.cos(t)])
    expected = half_space_patch(2.0, nu, direction)
    assert solid.half_space_compliance(np.cos(t)) == pytest.approx(expected, rel=1e-6)


@pytest.mark.slow
def test_an_isotropic_matrix_is_a_solid_in_any_axes():
    mesh = parts.box()
    plain = ao.Structure(mesh, ao.Solid(E, NU, RHO), ao.Support("left"))
    tip = mesh.dolfinx.geometry.x.max(axis=0)
    G = E / (2 * (1 + NU))
    made = ao.AnisotropicSolid.orthotropic((E,) * 3, (NU,) * 3, (G,) * 3, RHO, turn(0.7)[:2])
    np.testing.assert_allclose(made.voigt, ao.Solid(E, NU, RHO).voigt, atol=1e-4 * E * 1e-8)
    other = ao.Structure(mesh, made, ao.Support("left"))
    assert k0(other, tip) == pytest.approx(k0(plain, tip), rel=1e-9)
    assert other.mass == pytest.approx(plain.mass, rel=1e-12)


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
