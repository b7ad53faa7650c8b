"""The errors of the strains of shells: energies, fields without errors, torsion, nested meshes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import antiosc as ao
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.platform import compat
from antiosc.fem.structure.structure import on_mesh
from antiosc.impact.error_budget import (
    COARSE_SHELL,
    SAFETY,
    SAFETY_COARSE,
    SHELL,
)
from antiosc.impact.histories.bars import QUANTITIES, differences
from antiosc.reduce.error.shell import (
    SheetRecovery,
    ShellErrors,
    StrainsOfSheets,
    layers_of,
    section_forces,
    smooth_pieces,
)
from sheets import (
    NU,
    RHO,
    RIB,
    SHEET,
    E,
    at,
    edges,
    flipped,
    grouped,
    interpolated,
    plate,
    rectangle,
    sheet,
    stack,
    unsymmetric,
)


def _normals(mesh) -> np.ndarray:
    x = mesh.dolfinx.geometry.x[compat.geometry_nodes(mesh.dolfinx)]
    n = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    return n / np.linalg.norm(n, axis=1, keepdims=True)


pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore:the supports leave:antiosc.base.errors.AntioscWarning"),
]

CLAMPED = [ao.Support(edges(0, 1))]
NO_TURN = ao.Support(lambda x: x[0] < 1e9, ("rx", "ry", "rz"))
CONTRACTING = ao.Shell(E, NU, RHO, 0.004)
TILT = np.linalg.qr(np.array([[2.0, 1, 0], [1, 3, 1], [-1, 0.5, 2]]))[0]


def tilted(n: int):
    """A unit square in a plane that no axis lies in."""
    return sheet(n, lambda s, t: tuple(np.tensordot(TILT[:, :2], np.stack([s, t]), axes=1)))


def two_thicknesses(n: int, mesh=None) -> ao.Structure:
    """A plate whose half x > 0.5 is half as thick."""
    mesh = mesh or rectangle(n, 1.0, 1.0)
    middles = mesh.dolfinx.geometry.x[compat.geometry_nodes(mesh.dolfinx)].mean(axis=1)
    thin = middles[:, 0] > 0.5
    groups = {
        name: {2: np.flatnonzero(own).astype(np.int32)}
        for name, own in (("thick", ~thin), ("thin", thin))
    }
    shells = {"thick": ao.Shell(E, NU, RHO, 0.06), "thin": ao.Shell(E, NU, RHO, 0.03)}
    return ao.Structure(ao.Mesh(mesh.dolfinx, groups), shells, [])


STRUCTURES = {
    "plate": lambda: plate(3, 0.02),
    "cells turned over": lambda: ao.Structure(flipped(rectangle(3, 1.0, 1.0), [1, 4, 9]), SHEET),
    "layers": lambda: ao.Structure(
        flipped(rectangle(3, 1.0, 1.0), [2, 3]),
        ao.Laminate(unsymmetric(0.03), axis=(1, 2, 0), top=(0, 0, -1), offset=0.004),
    ),
}


@pytest.mark.parametrize("name", list(STRUCTURES))
def test_the_strains_are_those_of_the_stiffness(name):
    """Their energy is uᵀKu, for any u without in-plane rotations, whose squares are of degree 6."""
    structure = STRUCTURES[name]()
    part = on_mesh(structure)
    u = np.random.default_rng(1).normal(size=(structure.rows, 3))
    u[compat.dof_coordinates(part.form.space, part.form.components["rz"])[0]] = 0.0
    u[part.fixed] = 0.0
    strains = StrainsOfSheets(part, u, smooth_pieces(part)).at(np.arange(part.mesh.n_cells))
    (D,) = section_forces(part)
    energy = np.einsum("pik,ij,pjl,p->kl", strains.own, D, strains.own, strains.weights)
    scale = np.sqrt(np.outer(np.diag(energy), np.diag(energy)))
    assert np.all(np.abs(energy - u.T @ (csr(structure.K) @ u)) < 1e-9 * scale)


#: In the planes of the axes, askew, and with cells turned over.
SQUARES = [
    rectangle(3, 1.0, 1.0),
    sheet(2, lambda s, t: (0 * s, s, t)),
    flipped(sheet(2, lambda s, t: (t, 0 * s, s)), [1, 2]),
    tilted(3),
    flipped(tilted(3), [0, 5, 7]),
]


@pytest.mark.sample(-1)
@pytest.mark.parametrize("mesh", SQUARES)
def test_strains_of_degree_two_have_no_error(mesh):
    """Cubic displacements, quadratic rotations: whatever the axes and the normals of the cells."""
    structure = ao.Structure(mesh, CONTRACTING, [NO_TURN])
    rng = np.random.default_rng(2)
    A, B = rng.normal(size=(2, 3, 3))

    def field(x):
        u, turn = (x**3) @ A + x[:, :1] * x[:, 1:2] ** 2, (x**2) @ B - x[:, :1] * x[:, 1:2]
        return dict(zip(("x", "y", "z", "rx", "ry", "rz"), np.hstack([u, turn]).T, strict=True))

    def rough(x):
        return {name: np.sin(9 * x[:, 0] + 7 * x[:, 1]) for name in ("x", "y", "z", "rx", "ry")}

    shapes = np.stack([interpolated(structure, each) for each in (field, rough)], axis=1)
    errors = ShellErrors(on_mesh(structure))
    E, misfit = errors.gram_and_misfit(shapes)
    assert abs(E[0, 0]) < 1e-10 * E[1, 1]
    assert abs(misfit[0, 0]) < 1e-10 * abs(misfit[1, 1])
    assert errors.of_cells(shapes[:, 1:]).sum() == pytest.approx(E[1, 1], rel=1e-9)


def twisted(structure: ao.Structure) -> np.ndarray:
    """w = x y without shear strain."""
    x, y = (lambda x, k=k: x[:, k] for k in (0, 1))
    return interpolated(structure, lambda p: {"z": x(p) * y(p), "rx": x(p), "ry": -y(p)})[:, None]


def layer_energy(structure: ao.Structure, u: np.ndarray) -> float:
    part = on_mesh(structure)
    pieces = smooth_pieces(part)
    return float(layers_of(part, pieces, SheetRecovery(part, u, pieces)).energies()[0, 0])


def test_layers_along_free_edges_are_those_of_torsion():
    """The torsion constant of a thin rectangle is b t³/3 (1 - 0.63 t/b) (Timoshenko, Goodier)."""
    t, width, length = 0.04, 1.0, 4.0
    mesh = rectangle((8, 2), length, width)
    short = edges(0, size=length)
    ends = [ao.Support(short, ("rx", "ry", "rz"))]
    strip = ao.Structure(mesh, ao.Shell(E, NU, RHO, t), ends)
    u = twisted(strip)
    energy = float((E / (2 * (1 + NU))) * t**3 / 3 * width * length)
    assert layer_energy(strip, u) / energy == pytest.approx(0.63 * t / width, rel=0.01)
    assert layer_energy(ao.Structure(mesh, SHEET, [NO_TURN]), u) == 0


def test_layers_where_the_thickness_changes():
    """Both halves twist alike; the jump of the moments is shared so that both turn alike."""
    structure = two_thicknesses(4)
    u, G = twisted(structure), E / (2 * (1 + NU))
    D, c = [], []
    for t in (0.06, 0.03):
        D.append(G * t**3 / 12)
        c.append(t / np.sqrt(10) / D[-1])
    free = sum(2 * (2 * d) ** 2 * own for d, own in zip(D, c, strict=True))
    jump = (2 * (D[0] - D[1])) ** 2 * c[0] * c[1] / (c[0] + c[1])
    assert layer_energy(structure, u) == pytest.approx(free + jump, rel=1e-6)


def fold(s, t):
    """Two squares at a right angle."""
    return np.minimum(2 * s, 1.0), t, np.maximum(2 * s - 1, 0.0)


def test_flat_cells_of_a_curved_surface_are_told():
    """An arc of eight strips of 5° each; with curved cells there is nothing to tell."""

    def arc(s, t):
        angle = np.radians(40) * s
        return 0.3 * np.cos(angle), 0.3 * np.sin(angle), t

    facets = ShellErrors(on_mesh(ao.Structure(sheet((8, 1), arc), SHEET)))
    assert "angles of up to 5°, for a curved surface" in facets.faceted
    curved = ShellErrors(on_mesh(ao.Structure(sheet((4, 1), arc, order=2), SHEET)))
    assert curved.faceted == ""


def corner_held(n: int, t: float) -> ao.Structure:
    """Held at three corners: it twists."""

    def corner(x0, y0):
        return lambda x: np.isclose(x[0], x0) & np.isclose(x[1], y0)

    held = [
        ao.Support(corner(0, 0), ("x", "y", "z")),
        ao.Support(corner(1, 0), ("y", "z")),
        ao.Support(corner(0, 1), ("z",)),
    ]
    return ao.Structure(rectangle(n, 1.0, 1.0), ao.Shell(E, NU, RHO, t), held)


#: structure by its number of elements and the site; coarse and finest numbers
NESTED = {
    "clamped, softer than the part": (
        lambda n: plate(n, 0.02, supports=CLAMPED),
        ao.Site((0.5, 0.5, 0), (0, 0, -1), radius=0.1),
        (4, 16),
    ),
    "twisted": (
        lambda n: corner_held(n, 0.1),
        ao.Site((0.9, 0.9, 0), (0, 0, -1), radius=0.1),
        (3, 24),
    ),
    "folded": (
        lambda n: ao.Structure(sheet(n, fold), SHEET, [ao.Support(at(0, 0.0))]),
        ao.Site((0.5, 0.5, 0), (0, 0, -1), radius=0.1),
        (4, 16),
    ),
    "layers": (
        lambda n: ao.Structure(
            rectangle(n, 1.0, 1.0), ao.Laminate(stack([0, 45, -45, 90], 0.05)), CLAMPED
        ),
        ao.Site((0.5, 0.5, 0), (0, 0, -1), radius=0.1),
        (4, 16),
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", list(NESTED))
def test_k0_and_bars_of_nested_meshes(name):
    part, site, (few, many) = NESTED[name]
    model = ao.extract(part(few), site, n=12, error="estimate")
    true = ao.extract(part(many), site, n=12)
    error = model.k0 - true.k0
    if "softer" in name:
        assert error < -1e-3 * true.k0
    if name not in ("folded", "layers"):  # of which error and misfit cancel
        assert abs(model.corrected().k0 - true.k0) < 0.75 * abs(error)
    impact = ao.RigidMass(0.1 * part(few).mass, 1.0), ao.Hertz(3e7)
    hit, exact = (ao.simulate(each, *impact, 2e-2, tol=1e-5) for each in (model, true))
    off = differences(hit, exact)
    for quantity in QUANTITIES:
        assert off[quantity] < hit.error_budget[quantity].mesh + 1e-6
        assert hit.error_budget[quantity].mesh < 30 * max(off.values())
    coarse = hit.error_budget.energy_error > COARSE_SHELL
    assert hit.error_budget.safety == SHELL * (SAFETY_COARSE if coarse else SAFETY)


@pytest.fixture(scope="module")
def model() -> ao.AntiOscillators:
    site = ao.Site((0.4, 0.3, 0), (0, 0, -1), radius=0.1)
    return ao.extract(plate(3, 0.03), site, n=6, error="estimate")


@pytest.mark.slow
def test_a_blow_too_short_for_the_cells_has_a_wide_bar():
    """The bodies part before a wave crosses a cell: the corrected model sees nothing of it."""
    site = ao.Site((0.4, 0.3, 0), (0, 0, -1))
    thin = 0.004
    impact = ao.RigidMass(0.05, 2.0), ao.Hertz(4e9), 1e-3
    model = ao.extract(plate(3, thin), site, n=20, error="estimate")
    hit = ao.simulate(model, *impact, tol=1e-4)
    true = ao.simulate(ao.extract(plate(18, thin), site, n=40), *impact, tol=1e-4)
    budget, off = hit.error_budget, differences(hit, true)
    assert off["peak_force"] > 0.1
    assert off["peak_force"] < budget["peak_force"].mesh
    assert budget["peak_force"].mesh >= budget.energy_error > COARSE_SHELL
    assert any("the mesh is coarse" in note for note in budget.notes)


@pytest.mark.parametrize("mesh", SQUARES)
def test_rigid_motions_have_no_strain_and_one_side(mesh):
    """Rotations in the plane of the sheet too; the normals of a piece point to one side."""
    layers = ao.Laminate(unsymmetric(0.03), axis=(1, 2, 0.5), top=tuple(_normals(mesh)[0]))
    part = on_mesh(ao.Structure(mesh, layers))
    pieces = smooth_pieces(part)
    cells = np.arange(mesh.n_cells)
    own = StrainsOfSheets(part, part.rigid_modes, pieces).at(cells).own
    assert own.shape[2] == 6
    assert np.abs(own).max() < 1e-9 * np.abs(part.rigid_modes).max()
    structure = on_mesh(ao.Structure(mesh, SHEET))
    sides = smooth_pieces(structure).axes.side[:, None] * _normals(mesh)
    np.testing.assert_allclose(sides, np.broadcast_to(sides[0], sides.shape), atol=1e-12)


@pytest.mark.slow
def test_ribs_hold_the_edges_that_they_lie_on_and_part_the_surface():
    """Of the four equal layers of a twisted square one is gone with a rib along that side."""
    square = rectangle(2, 1.0, 1.0)
    alone = ao.Structure(square, SHEET)
    ribbed = ao.Structure(grouped(square, edges=at(0, 0.0)), {"sheet": SHEET, "rib": RIB})
    energy = layer_energy(alone, twisted(alone))
    c, d = np.cos(0.5), np.sin(0.5)
    askew = ao.Structure(sheet(2, lambda s, t: (c * s - d * t, d * s + c * t, 0 * s)), SHEET)
    along, across = (lambda p: c * p[:, 0] + d * p[:, 1]), (lambda p: c * p[:, 1] - d * p[:, 0])
    bent = interpolated(
        askew,
        lambda p: {
            "z": along(p) * across(p),
            "rx": c * along(p) + d * across(p),
            "ry": d * along(p) - c * across(p),
        },
    )
    assert layer_energy(askew, bent[:, None]) == pytest.approx(energy, rel=1e-9)
    assert layer_energy(ribbed, twisted(ribbed)) == pytest.approx(0.75 * energy, rel=1e-9)
    errors = ShellErrors(on_mesh(alone))  # the layers are those of cells too
    shapes = np.hstack([twisted(alone), 2 * twisted(alone)])
    cells, gram = errors.of_cells(shapes), errors.gram(shapes)
    assert cells.sum() == pytest.approx(np.trace(gram), rel=1e-9)
    assert np.trace(gram) == pytest.approx(5 * energy, rel=1e-6)
    assert gram == pytest.approx(gram[0, 0] * np.array([[1, 2], [2, 4]]), rel=1e-6)
    middle = ao.Structure(grouped(square, edges=at(0, 0.5)), {"sheet": SHEET, "rib": RIB})
    folded = ao.Structure(sheet(2, fold), SHEET)
    for part, count in ((alone, 1), (ribbed, 1), (middle, 2), (folded, 2), (two_thicknesses(2), 2)):
        found = smooth_pieces(on_mesh(part))
        assert len(np.unique(found.number)) == count
        x = part.mesh.dolfinx.geometry.x[compat.geometry_nodes(part.mesh.dolfinx)].mean(axis=1)
        side = x[:, 0] + x[:, 2] > (1.0 if part is folded else 0.5)
        if count == 2:  # one on either side
            assert len(np.unique(found.number[side])) == len(np.unique(found.number[~side])) == 1
        assert found.bent < 1e-9
        assert ShellErrors(on_mesh(part)).faceted == ""


def test_the_larger_of_both_differences_counts(model):
    """An error and a misfit that cancel leave a bar."""
    cancelled = replace(model, strain_misfit=-model.strain_error)
    assert cancelled.corrected().k0 == pytest.approx(model.k0, rel=1e-12)
    impact = ao.RigidMass(3.0, 1.0), ao.Hertz(3e7), 1e-2
    without = ao.simulate(replace(model, strain_misfit=None), *impact, tol=1e-5).error_budget
    bars = ao.simulate(cancelled, *impact, tol=1e-5).error_budget
    for name in QUANTITIES:
        assert bars[name].mesh == pytest.approx(SHELL * without[name].mesh, rel=1e-3)
