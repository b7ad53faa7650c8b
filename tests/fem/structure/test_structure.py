"""Structures: mass, supports, sections, several families in one mesh."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from petsc4py import PETSc

import antiosc as ao
import parts
from antiosc import PointMass, Spring
from antiosc.fem.linalg.algebra import multiply
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.platform import compat
from antiosc.reduce.site import functional
from marks import FREE_ON_PURPOSE
from mpi import one_and_several
from sheets import RIB, SHEET, at, dof, frequencies, grouped, interpolated, loaded, rectangle, sheet

pytestmark = FREE_ON_PURPOSE


def handed_over(structure: ao.Structure, kind: str):
    """K and M without the fixed dofs, as another code would give them."""
    free = np.setdiff1d(np.arange(structure.K.getSize()[0]), structure.fixed)
    pair = [csr(A)[free][:, free] for A in (structure.K, structure.M)]
    if kind == "petsc":
        pair = [
            PETSc.Mat().createAIJ(A.shape, csr=(A.indptr, A.indices, A.data), comm=PETSc.COMM_SELF)
            for A in pair
        ]
    elif kind == "coo":
        pair = [A.tocoo() for A in pair]
    elif kind == "dense":
        pair = [A.toarray() for A in pair]
    return pair, free


SOLID = ao.Solid(**parts.STEEL)


def coordinates(structure: ao.Structure, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Dofs of one component and their coordinates (n, 3)."""
    return compat.dof_coordinates(structure.form.space, structure.form.components[name])


def held(structure: ao.Structure, name: str) -> np.ndarray:
    """Coordinates (n, 3) of the dofs of one component that are fixed."""
    dofs, x = coordinates(structure, name)
    return x[np.isin(dofs, structure.fixed)]


@pytest.mark.parametrize("cell", ["tetrahedron", "hexahedron"])
def test_a_named_group_holds_all_motions_of_its_face(cell):
    structure = ao.Structure(parts.box(cell=cell), SOLID, [ao.Support("left")])
    for name in "xyz":
        x = held(structure, name)
        assert len(x) == 25  # 2 × 2 elements of order 2 across
        np.testing.assert_allclose(x[:, 0], 0, atol=1e-15)
    assert structure.dofs == structure.K.getSize()[0] - 75
    assert structure.rigid_modes.shape[1] == 0
    K = csr(structure.K)
    fixed = structure.fixed
    np.testing.assert_array_equal(K[fixed][:, fixed].toarray(), np.eye(75))
    assert csr(structure.M)[fixed].nnz == 0 or not csr(structure.M)[fixed].data.any()
    assert abs(K[fixed]).sum() == 75


class Rubbery:
    """A material of one's own, with the weak form of a solid and a patch by default."""

    kind = SOLID.kind
    patch_radius = 0.02
    weak_form = SOLID.weak_form
    half_space_compliance = SOLID.half_space_compliance
    dimensions = SOLID.dimensions
    bar_speed = SOLID.bar_speed
    constants = SOLID.constants
    plane, thickness = SOLID.plane, SOLID.thickness
    E, nu, rho = SOLID.E, SOLID.nu, SOLID.rho


@pytest.mark.slow
def test_a_family_of_ones_own_says_what_a_site_takes():
    clamp = [ao.Support("left")]
    own, solid = (ao.Structure(parts.box((16, 4, 4)), m, clamp) for m in (Rubbery(), SOLID))
    at, along = (0.1, 0.025, 0.04), (0, 0, -1)
    given = functional(solid, ao.Site(at, along, radius=0.02))
    taken = functional(own, ao.Site(at, along))
    assert taken.radius == given.radius
    np.testing.assert_allclose(taken.b, given.b, atol=1e-12)
    with pytest.raises(ao.InputError, match="material must be a Solid"):
        ao.Structure(parts.box(), SOLID.weak_form)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["csr", "coo", "dense", "petsc"])
@pytest.mark.parametrize("supports", [[ao.Support("left")], []], ids=["supported", "free"])
def test_matrices_give_the_model_of_the_mesh(kind, supports):
    mesh = parts.plate((6, 3), (0.2, 0.05))
    meshed = ao.Structure(mesh, ao.Solid(**parts.STEEL, plane="stress", thickness=0.01), supports)
    (K, M), free = handed_over(meshed, kind)
    foreign = ao.Structure.from_matrices(K, M)
    assert foreign.rigid_modes.shape[1] == meshed.rigid_modes.shape[1]
    assert foreign.dofs == meshed.dofs
    dofs, x = coordinates(meshed, "y")
    dof = int(dofs[np.argmin(np.linalg.norm(x - [0.2, 0.05, 0], axis=1))])
    b = np.zeros(meshed.K.getSize()[0])
    b[dof] = 1.0
    expected = ao.extract(meshed, ao.Site(vector=b), n=6, method="modes")
    for site in (ao.Site(dof=int(np.searchsorted(free, dof))), ao.Site(vector=b[free])):
        model = ao.extract(foreign, site, n=6, method="modes")
        np.testing.assert_allclose(model.omega, expected.omega, rtol=1e-8)
        np.testing.assert_allclose(model.m, expected.m, rtol=1e-7)
        assert model.k0 == pytest.approx(expected.k0, rel=1e-8)
        assert model.m0 == pytest.approx(expected.m0, rel=1e-6)


E, RHO = 70e9, 2700.0
CELLS = ["triangle", "quadrilateral"]


@pytest.mark.parametrize("cell", CELLS)
def test_a_stiffened_strip_is_a_composite_beam(cell):
    """A cantilever of T section: parallel axes and the shift of the neutral axis."""
    length, width = 1.0, 0.05
    mesh = grouped(rectangle((24, 2), length, width, cell), lambda x: np.isclose(x[1], width / 2))
    part = ao.Structure(mesh, {"sheet": SHEET, "rib": RIB}, [ao.Support(at(0, 0.0))])
    forces = ((0, 0.25), (width / 2, 0.5), (width, 0.25))
    tip = {dof(part, (length, v, 0), "z"): force for v, force in forces}
    z = dof(part, (length, width / 2, 0), "z")
    areas = np.array([width * 0.004, 0.004 * 0.03])
    centres = np.array([0.0, 0.017])
    own = np.array([width * 0.004**3, 0.004 * 0.03**3]) / 12
    middle = areas @ centres / areas.sum()
    EI = E * (own.sum() + areas @ (centres - middle) ** 2)
    assert loaded(part, tip)[z] == pytest.approx(length**3 / (3 * EI), rel=1e-2)
    assert part.mass == pytest.approx(RHO * length * areas.sum(), rel=1e-12)
    # pulled in the sheet's plane, below the neutral axis, it bends toward the rib's side
    pull = {dof(part, (length, v, 0), "x"): force for v, force in forces}
    assert loaded(part, pull)[z] == pytest.approx(middle * length**2 / (2 * EI), rel=2e-2)


@pytest.mark.parametrize("order", [1, 2])
def test_rigid_motions_strain_no_stiffener(order):
    """A rib around a curved sheet, off its surface: six rigid-body modes, exact mass."""
    mesh = sheet((4, 6), lambda s, v: (0.4 * s, np.sin(v), np.cos(v)), "triangle", order)
    mesh = grouped(mesh, lambda x: np.isclose(x[0], 0.2, atol=1e-6))
    frame = ao.Beam(
        E, 0.3, RHO, ao.Section.tube(0.03, 0.002), orientation=(0.1, 1, -1), offset=0.02
    )
    part = ao.Structure(
        mesh, {"sheet": SHEET, "rib": frame}, attached=[PointMass((0.1, 0, 1), 2.0)]
    )
    assert part.rigid_modes.shape[1] == 6
    K = csr(part.K)
    scale = abs(K).max() * np.abs(part.rigid_modes).max()
    assert np.abs(K @ part.rigid_modes).max() < 1e-12 * scale
    along = interpolated(part, lambda x: {"x": 0.6, "z": 0.8})
    assert along @ multiply(part.M, along) == pytest.approx(part.mass, rel=1e-9)
    inertia = part.uniform_inertia(np.array([0.6, 0, 0.8]))
    exact = multiply(part.M, along)
    assert inertia == pytest.approx(exact, rel=1e-5, abs=1e-7 * np.abs(exact).max())


@pytest.mark.mpi
def test_two_ranks_find_what_one_finds():
    script = """
        import json
        import numpy as np
        import antiosc as ao
        from antiosc import PointMass, Spring
        from sheets import sheet
        from sheets import RIB, SHEET, grouped

        mesh = sheet((6, 6), lambda s, t: (s, 0.6 * t, 0.1 * s * t), "triangle", 2)
        mesh = grouped(mesh, lambda x: np.isclose(x[0], 0.5), lambda x: np.isclose(x[0], 0))
        part = ao.Structure(mesh, {"sheet": SHEET, "rib": RIB}, attached=[
            PointMass("feet", 0.1, 1e-3),
            Spring("feet", {"z": 1e4, "ry": 10.0})])
        site = ao.Site((0.52, 0.33, 0.02), (0, 0.3, 1), snap=True)
        model = ao.extract(part, site, n=4, method="modes")
        print(json.dumps([part.mass, part.rigid_modes.shape[1], model.k0, model.m_st,
                          *model.omega, *model.m, *np.abs(model.participation)]))
    """
    one, two = one_and_several(script)
    assert two == pytest.approx(one, rel=1e-5)


@pytest.mark.slow
def test_a_stiff_plate_on_springs_heaves_as_one_mass():
    mesh = grouped(
        rectangle(4, 0.2, 0.2),
        points=lambda x: np.isclose(np.abs(x[0] - 0.1), 0.1) & np.isclose(np.abs(x[1] - 0.1), 0.1),
    )
    feet = Spring("feet", {"x": 100.0, "y": 100.0, "z": 100.0})
    motor = PointMass((0.1, 0.1, 0.0), 0.5, inertia=1e-3)
    part = ao.Structure(mesh, ao.Shell(E, 0.3, RHO, 0.01), attached=[feet, motor])
    mass = RHO * 0.01 * 0.04 + 0.5
    assert part.mass == pytest.approx(mass, rel=1e-12)
    assert part.rigid_modes.shape[1] == 0
    J = (mass - 0.5) * (0.2**2 + 0.01**2) / 12 + 1e-3  # about x and y
    polar = (mass - 0.5) * (0.2**2 + 0.2**2) / 12 + 1e-3  # about z; thin normals add a little
    squares = sorted([400 / mass] * 3 + [4 * 100 * 0.1**2 / J] * 2 + [400 * 0.02 / polar])
    assert frequencies(part, 6) ** 2 == pytest.approx(squares, rel=2e-3)


@pytest.mark.parametrize(
    "region",
    [
        {"near": ((0, 0, 0), 0.1)},
        {"box": ((0, 0, 0), (0.1, 0.2, 0.3))},
        {"plane": ((0, 0, 0.1), (0, 0, 1))},
    ],
)
def test_a_support_of_a_region_can_be_pickled(region):
    support = ao.Support(**region)
    copy = pickle.loads(pickle.dumps(support))
    x = np.random.default_rng(0).random((3, 50)) * 0.2
    assert (copy.where(x, size=1.0) == support.where(x, size=1.0)).all()


def test_a_solver_for_more_columns_is_chosen_anew():
    part = ao.Structure(parts.box(), ao.material("S355"))
    of_one = part.factorize_at(1e6)
    of_one.columns = 1.0  # as of conjugate gradients, which are slow for many
    assert part.factorize_at(1e6, 1.0) is of_one
    assert part.factorize_at(1e6, 50.0) is not of_one
