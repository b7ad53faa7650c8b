"""Strains, stresses and section forces of given displacement fields: polynomials and energies."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import antiosc as ao
import parts
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.platform import compat
from antiosc.fem.recovery import Place
from antiosc.fem.recovery.tensors import PointsInCells, SheetAxes, evaluator, middle_strains
from antiosc.fem.structure.structure import on_mesh
from sheets import sheet as mapped

PLY = ao.Layer(E1=140e9, E2=9e9, nu12=0.3, G12=5e9, G13=5e9, G23=3.5e9, rho=1600.0, thickness=1e-3)
BEAM = ao.Beam(
    **parts.STEEL, section=ao.Section(A=3e-4, I=4e-9, I_side=2e-9, J=1e-9), orientation=(0, 0.3, 1)
)


def field(part: ao.Structure, **functions: Callable[..., np.ndarray]) -> np.ndarray:
    """Dofs (n, 1) of a displacement given by functions of x, y, z."""
    form = on_mesh(part).form
    shapes = np.zeros((compat.local_size(form.space), 1))
    for name, function in functions.items():
        dofs, x = compat.dof_coordinates(form.space, form.components[name])
        shapes[dofs, 0] = function(*x.T)
    return shapes


def at_gauss(part: ao.Structure, shapes: np.ndarray, n: int):
    """Points of n Gauss points a direction in all cells, and their weights times |J|."""
    mesh = on_mesh(part).mesh
    x, w = np.polynomial.legendre.leggauss(n)
    x, w = (x + 1) / 2, w / 2
    if mesh.cell == "triangle":  # a square collapsed
        grid = np.array([(a, b * (1 - a)) for a in x for b in x])
        weight = np.array([p * q * (1 - a) for a, p in zip(x, w, strict=True) for q in w])
    else:
        mesh_of = np.meshgrid(*[x] * mesh.tdim, indexing="ij")
        grid = np.stack([m.ravel() for m in mesh_of], axis=1)
        weight = np.prod(np.meshgrid(*[w] * mesh.tdim, indexing="ij"), axis=0).ravel()
    cells = np.repeat(np.arange(mesh.n_cells), len(grid))
    at = PointsInCells(on_mesh(part), shapes, cells, np.tile(grid, (mesh.n_cells, 1)))
    J = at.J
    size = np.sqrt(np.linalg.det(np.einsum("pia,pib->pab", J, J)))
    return at, np.tile(weight, mesh.n_cells) * size


@pytest.mark.parametrize("cell", parts.CELLS)
def test_a_quadratic_field_has_its_own_strain(cell):
    plane = cell in ("triangle", "quadrilateral")
    if plane:
        solid = ao.Solid(**parts.STEEL, plane="stress", thickness=0.01)
        part = ao.Structure(parts.plate((3, 2), cell=cell), solid, [ao.Support("left")])
    else:
        part = ao.Structure(parts.box((3, 2, 2), cell=cell), ao.Solid(**parts.STEEL))
    A = np.random.default_rng(1).standard_normal((3, 3, 3))
    A = A + np.swapaxes(A, 1, 2)  # u_i = x·A_i·x/2

    def component(i):
        def function(x, y, z):
            p = np.stack([x, y, z])
            return np.einsum("an,ab,bn->n", p, A[i], p) / 2

        return function

    names = "xy" if plane else "xyz"
    shapes = field(part, **{name: component(i) for i, name in enumerate(names)})
    at, _ = at_gauss(part, shapes, 2) if cell != "tetrahedron" else (None, None)
    if at is None:
        at = PointsInCells(
            on_mesh(part), shapes, np.array([1, 3]), np.array([[0.2, 0.3, 0.1], [0.5, 0, 0.2]])
        )
    x = on_mesh(part).mesh.geometry.at(at.cells, at.X)[0]
    g = np.einsum("iab,pb->pia", A, x)
    if plane:
        g[:, 2] = g[:, :, 2] = 0
    strain = (g + np.swapaxes(g, 1, 2)) / 2
    G, lame = 210e9 / 2.6, 210e9 * 0.3 / 1.3 / 0.4
    if plane:
        strain[:, 2, 2] = -0.3 / 0.7 * (strain[:, 0, 0] + strain[:, 1, 1])
    trace = np.trace(strain, axis1=1, axis2=2)[:, None, None]
    stress = 2 * G * strain + lame * trace * np.eye(3)
    curl = (g - np.swapaxes(g, 1, 2)) / 2
    turned = curl[:, 1, 0][:, None] if plane else curl[:, [2, 0, 1], [1, 2, 0]]
    for quantity, exact in (("strain", strain), ("stress", stress), ("rotation", turned)):
        found = evaluator(on_mesh(part), quantity, Place())(at)[..., 0]
        np.testing.assert_allclose(found, exact, atol=1e-11 * np.abs(exact).max())
    if plane:
        assert np.abs(stress[:, 2]).max() < 1e-9 * np.abs(stress).max()


@pytest.mark.sample
@pytest.mark.parametrize("plane", [True, False])
@pytest.mark.parametrize("order", [1, 2])
def test_section_forces_of_beams_carry_the_energy_of_K(plane, order):
    """uᵀKu is the integral of forces times strains, by the Gauss points of K, for random u."""
    direction = (3, 4) if plane else (1, 2, -2)
    part = ao.Structure(parts.line(0.8, 3, direction), BEAM, order=order)
    shapes = np.random.default_rng(2).standard_normal((part.size, 1))
    at, weight = at_gauss(part, shapes, order)
    forces = evaluator(on_mesh(part), "section_forces", Place())(at)[..., 0]
    s = BEAM.section
    stiffness = [BEAM.E * s.A, BEAM.G * s.A * s.shear, BEAM.E * s.I]
    if not plane:
        EA, GA, EI = stiffness
        stiffness = [EA, GA, GA, BEAM.G * s.J, BEAM.E * s.I_side, EI]
    energy = weight @ (forces**2 / stiffness).sum(axis=1)
    assert energy == pytest.approx(float((shapes.T @ csr(part.K) @ shapes)[0, 0]), rel=1e-10)


def test_fibres_of_a_beam():
    """Bending about both axes and stretching: σ = N/A − M y/I …, and the signs by the geometry."""
    part = ao.Structure(parts.line(0.8, 3, (1, 0, 0)), ao.Beam(**parts.STEEL, section=BEAM.section,
                        orientation=(0, 0, 1)))  # fmt: skip
    a, b, c = 1e-3, 2e-2, 3e-2  # u = a x, w = b x²/2 (so θy = −b x), v = c x²/2 (θz = c x)
    shapes = field(
        part, x=lambda x, y, z: a * x, z=lambda x, y, z: b * x**2 / 2, ry=lambda x, y, z: -b * x,
        y=lambda x, y, z: c * x**2 / 2, rz=lambda x, y, z: c * x,
    )  # fmt: skip
    at = PointsInCells(on_mesh(part), shapes, np.array([1]), np.array([[0.3]]))
    up, side = 0.01, 0.004  # height is z, and the section's z = x × z = −y
    found = evaluator(on_mesh(part), "strain", Place(fibre=(up, side)))(at)[0, ..., 0]
    along = a - b * up - c * (-side)
    np.testing.assert_allclose(np.diag(found), [along, -0.3 * along, -0.3 * along], rtol=1e-12)
    stress = evaluator(on_mesh(part), "stress", Place(fibre=(up, side)))(at)[0, ..., 0]
    np.testing.assert_allclose(stress[0, 0], 210e9 * along, rtol=1e-12)
    assert np.abs(stress[1:]).max() < 1e-9 * stress[0, 0]


def sheets(stack: str) -> ao.Shell | ao.Laminate:
    if stack == "shell":
        return ao.Shell(**parts.STEEL, thickness=4e-3)
    angles = (0, 90, 45, 20)  # unsymmetric
    return ao.Laminate([PLY.rotated(a) for a in angles], axis=(1, 0.3, 0))


@pytest.mark.sample
@pytest.mark.filterwarnings("ignore:the supports leave:antiosc.base.errors.AntioscWarning")
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
def test_rigid_motions_of_any_sheet_have_no_strain(cell, order):
    """On flat and curved cells that lie askew; and a constant shear strain beside no rotation."""
    turn = np.linalg.qr(np.array([[2.0, 1, 0], [1, 3, 1], [-1, 0.5, 2]]))[0]

    def bowl(s, t):
        return tuple(np.tensordot(turn, np.stack([s, t, 0.3 * (s**2 - s * t)]), axes=1))

    part = ao.Structure(mapped(2, bowl, cell, order), sheets("shell"))
    modes = on_mesh(part).rigid_modes
    at, weight = at_gauss(part, np.asarray(modes), 3)
    axes = SheetAxes(on_mesh(part))
    size = np.abs(modes).max()
    for strain in middle_strains(at, axes):
        assert np.abs(strain).max() < 1e-9 * size
    # a deflection alone: γ = (∂w/∂1, ∂w/∂2), whatever is interpolated
    plane = ao.Structure(mapped(2, lambda s, t: (s, t, 0 * s), cell), sheets("shell"))
    at, _ = at_gauss(plane, field(plane, z=lambda x, y, z: 3 * x - 2 * y), 2)
    own = SheetAxes(on_mesh(plane))
    frame, found = own.frame(at), middle_strains(at, own).shear[..., 0]
    sign = frame.n[:, 2]
    for k, axis in enumerate((frame.e1, frame.e2)):
        np.testing.assert_allclose(found[:, k], sign * (axis @ [3.0, -2.0, 0.0]), atol=1e-10)
    assert (weight > 0).all()


@pytest.mark.sample
@pytest.mark.parametrize("stack", ["shell", "laminate"])
@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
def test_layers_of_a_bent_and_stretched_sheet(stack, cell):
    """The strain is ε + zκ of the polynomials; each layer has its own stress of it."""
    part = ao.Structure(parts.plate((3, 2), (0.3, 0.2), cell), sheets(stack))
    e, k = np.array([1e-3, -2e-3, 5e-4]), np.array([0.3, -0.2, 0.1])  # of x, y and shear
    shapes = field(
        part, x=lambda x, y, z: e[0] * x + e[2] * y / 2, y=lambda x, y, z: e[1] * y + e[2] * x / 2,
        z=lambda x, y, z: -(k[0] * x**2 + k[1] * y**2 + k[2] * x * y) / 2,
        rx=lambda x, y, z: -(k[1] * y + k[2] * x / 2), ry=lambda x, y, z: k[0] * x + k[2] * y / 2,
    )  # fmt: skip
    at = PointsInCells(on_mesh(part), shapes, np.array([0, 2]), np.array([[0.2, 0.3], [0.6, 0.3]]))
    places = [(None, "top", 2e-3), (None, "bottom", -2e-3), (None, "middle", 0.0)]
    if stack == "laminate":
        places += [(1, "top", 0.0), (3, "bottom", 1e-3)]
    for layer, surface, z in places:
        strain, stress = (
            evaluator(on_mesh(part), q, Place(surface, layer))(at)[..., 0]
            for q in ("strain", "stress")
        )
        xx, yy, xy = e + z * k
        plane = np.array([[xx, xy / 2], [xy / 2, yy]])
        for s in strain:
            np.testing.assert_allclose(s[:2, :2], plane, atol=1e-9 * np.abs(plane).max())
        if stack == "shell":
            expected = 210e9 / 0.91 * (0.7 * plane + 0.3 * np.trace(plane) * np.eye(2))
            np.testing.assert_allclose(
                strain[:, 2, 2], -0.3 / 0.7 * np.trace(plane), atol=1e-9 * np.abs(plane).max()
            )
        else:
            number = {None: {"top": 3, "bottom": 0, "middle": 2}[surface]}.get(layer, layer)
            turn = np.deg2rad((0, 90, 45, 20)[number]) + np.arctan2(0.3, 1)
            c, s_ = np.cos(turn), np.sin(turn)
            R = np.array([[c, s_], [-s_, c]])
            own = R @ plane @ R.T
            nu21 = 0.3 * 9 / 140
            Q = np.array([[140e9, 0.3 * 9e9], [0.3 * 9e9, 9e9]]) / (1 - 0.3 * nu21)
            s1, s2 = Q @ np.diag(own)
            t12 = 5e9 * 2 * own[0, 1]
            expected = R.T @ np.array([[s1, t12], [t12, s2]]) @ R
            local = evaluator(on_mesh(part), "stress", Place(surface, layer, local=True))(at)
            np.testing.assert_allclose(
                local[:, :2, :2, 0],
                np.broadcast_to([[s1, t12], [t12, s2]], (2, 2, 2)),
                atol=1e-8 * np.abs(expected).max(),
            )
        for s in stress:
            np.testing.assert_allclose(s[:2, :2], expected, atol=1e-8 * np.abs(expected).max())
            assert np.abs(s[2, 2]) < 1e-9 * np.abs(expected).max()


@pytest.mark.sample
@pytest.mark.parametrize("up", [1, -1])
def test_a_direction_names_the_surface(up):
    part = ao.Structure(parts.plate((2, 2), (0.3, 0.2), "triangle"), sheets("shell"))
    shapes = field(part, ry=lambda x, y, z: x, z=lambda x, y, z: -(x**2) / 2)
    at = PointsInCells(on_mesh(part), shapes, np.array([0]), np.array([[0.2, 0.3]]))
    found = evaluator(on_mesh(part), "strain", Place((0.1, 0, up)))(at)
    assert found[0, 0, 0, 0] == pytest.approx(up * 2e-3, rel=1e-9)
    with pytest.raises(ao.InputError, match="along"):
        evaluator(on_mesh(part), "strain", Place((1.0, 0, 0.01)))(at)


def test_shear_stresses_of_layers_are_in_equilibrium():
    """Their integral is the shear force, and the surfaces are free; 3/2 Q/t in the middle."""
    from antiosc.fem.elements import shear_stresses

    layers = [PLY.rotated(a) for a in (0, 90, 45, 20)]
    x, w = np.polynomial.legendre.leggauss(3)
    whole = np.zeros((2, 2))
    for k in range(4):
        for a, weight in zip(x, w, strict=True):
            whole += weight / 2 * 1e-3 * shear_stresses(layers, k, (k - 2 + (a + 1) / 2) * 1e-3)
        np.testing.assert_allclose(
            shear_stresses(layers, max(k - 1, 0), (k - 2) * 1e-3),
            shear_stresses(layers, k, (k - 2) * 1e-3),
            atol=1e-6,
        )
    np.testing.assert_allclose(np.diag(whole), [1, 1], rtol=1e-10)
    assert np.abs(shear_stresses(layers, 3, 2e-3)).max() < 1e-9 * 250
    one = [ao.Layer.isotropic(210e9, 0.3, 7850.0, 4e-3)]
    np.testing.assert_allclose(shear_stresses(one, 0, 0.0), 1.5 / 4e-3 * np.eye(2), atol=1e-9)


@pytest.mark.sample
@pytest.mark.parametrize("stack", ["shell", "laminate"])
def test_section_forces_of_triangles_carry_the_energy_of_K(stack):
    """For random deflections and rotations, the interpolated shear strain included."""
    part = ao.Structure(parts.plate((2, 2), (0.3, 0.2), "triangle"), sheets(stack))
    rng = np.random.default_rng(3)
    form = on_mesh(part).form
    shapes = np.zeros((part.size, 1))
    for name in ("z", "rx", "ry"):
        dofs, _ = compat.dof_coordinates(form.space, form.components[name])
        shapes[dofs, 0] = rng.standard_normal(len(dofs)) * (0.01 if name == "z" else 1)
    at, weight = at_gauss(part, shapes, 5)
    axes = SheetAxes(on_mesh(part))
    forces = evaluator(on_mesh(part), "section_forces", Place())(at)[..., 0]
    strains = np.hstack([s[..., 0] for s in middle_strains(at, axes)])
    energy = weight @ (forces * strains).sum(axis=1)
    assert energy == pytest.approx(float((shapes.T @ csr(part.K) @ shapes)[0, 0]), rel=1e-9)
