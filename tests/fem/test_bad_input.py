"""What cannot be computed is refused in one sentence on every rank; other units are told of."""

from __future__ import annotations

from functools import cache, partial
from itertools import product

import dolfinx
import numpy as np
import pytest
import scipy.sparse
from mpi4py import MPI

import antiosc as ao
import parts
from antiosc.base import plausible
from antiosc.fem.elements.shell import GivenSheet
from antiosc.fem.platform import compat
from mesh_files import write
from mpi import START, run_ranks
from parts import STEEL
from paths import MESHES
from refusals import refused

SOLID, STRESS = ao.Solid(**STEEL), ao.Solid(**STEEL, plane="stress")
BEAM = ao.Beam(**STEEL, section=ao.Section.circle(0.02))
FLAT = ao.Section.rectangle(0.01, 0.03)
LEFT = [ao.Support("left")]
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
HALVES = {
    "low": (3, lambda x: x[0] <= 0.1 + 1e-9), "high": (3, lambda x: x[0] >= 0.1 - 1e-9),
    "all": (3, lambda x: x[0] > -1), "skin": (2, lambda x: np.isclose(x[0], 0)),
}  # fmt: skip


@cache
def box(groups: bool = False) -> ao.Mesh:
    return parts.box(groups=HALVES) if groups else parts.box()


def block(*supports: object, **options: object) -> ao.Structure:
    return ao.Structure(box(), SOLID, supports, **options)


def halves(material: dict) -> ao.Structure:
    return ao.Structure(box(True), material)


def beam(**options: object) -> ao.Structure:
    return ao.Structure(parts.line(1.0, 2, (0, 0, 1)), ao.Beam(**STEEL, section=FLAT, **options))


def tagged(value: int) -> ao.Mesh:
    mesh = dolfinx.mesh.create_unit_square(MPI.COMM_SELF, 2, 2)
    one = np.array([0], dtype=np.int32)
    return ao.read_mesh(
        mesh, groups={"body": (dolfinx.mesh.meshtags(mesh, 2, one, one + 3), value)}
    )


def given(K: object, M: object) -> ao.Structure:
    return ao.Structure.from_matrices(K, M)


WRONG = [
    # materials, sections, and the meshes that they fit
    (lambda: ao.Solid(**STEEL, plane="flat"), "plane"),
    (lambda: ao.Solid(**STEEL, plane="stress", thickness=0.0), "thickness must be > 0"),
    (lambda: ao.Structure(parts.plate(), SOLID), "needs the plane 'stress'"),
    (lambda: ao.Structure(box(), STRESS), "2-D meshes"),
    (lambda: ao.Section.tube(0.04, 0.02), "thinner than d/2 = 0.02 m; got 0.02"),
    (lambda: ao.Section.rectangle(-0.1, 0.1), "width must be > 0"),
    (lambda: ao.Section(A=0.0, I=1.0), "A must be > 0"),
    (lambda: ao.Beam(**STEEL, section=0.1), "section"),
    (lambda: ao.Structure(box(), BEAM), "hexahedron"),
    (lambda: ao.Structure(parts.line(1.0, 2), SOLID), "dimension"),
    (lambda: ao.Structure(ao.read_mesh("meshes/lever.msh"), STRESS, order=1), "geometric order 2"),
    (lambda: block(order=3), "order must be 1 or 2; got 3"),
    (lambda: ao.Structure("meshes/lever.msh", SOLID), "read_mesh"),
    (lambda: ao.Structure(box(), 210e9), "material"),
    (lambda: beam(), "orientation"),
    (lambda: beam(orientation=(0, 0, 2)), "parallel to 2 beam"),
    (lambda: beam(orientation=(0, 0, 0)), "length of orientation must be > 0"),
    (lambda: ao.material("S355", orientation=(0, 0, 1)), "section"),
    (lambda: ao.material("S355", thickness=1e-3, section=FLAT), "not both"),
    *((lambda B=B: GivenSheet(np.eye(3), np.eye(3), np.eye(2), 1.0, 0.1, 1.0, B=B), "A, B, D")
      for B in (2 * np.eye(3), np.eye(3)[[1, 2, 0]] / 2)),
    (lambda: halves({"low": SOLID}), "of 16 cells 8 have none and 0 more than one"),
    (lambda: halves({"all": SOLID, "high": SOLID}), "of 16 cells 0 have none and 8 more than one"),
    (lambda: halves({"middle": SOLID}), "middle"),
    (lambda: halves({"skin": SOLID}), "skin"),
    (lambda: halves({}), "empty dict"),
    (lambda: halves({"low": SOLID, "high": BEAM}), "materials"),
    # supports and sites
    (lambda: block(ao.Support("foot")), "foot"),
    (lambda: block(ao.Support(lambda x: x[0] > 1)), "mesh"),
    (lambda: block(ao.Support("left", "rx")), "component"),
    (lambda: block(ao.Support("left", ())), "component"),
    (lambda: block(ao.Support(lambda x: True)), "shape (225,); got ()"),
    (lambda: block("left"), "left"),
    (lambda: block(ao.Support(lambda x: x[0] > -1)), "structure"),
    (lambda: ao.extract(ao.Structure(parts.line(1.0, 4), BEAM), (0, 0, 0)), "direction"),
    (lambda: ao.extract(parts.line(1.0, 4), ao.Site((0.5, 0), (0, 1))), "structure"),
    # files
    (lambda: ao.read_mesh(3), "read_mesh takes a file or a dolfinx mesh; got 3"),
    *((lambda wrong=wrong: ao.read_mesh("meshes/bracket.step", size=0.1, refine=[wrong]), "refine")
      for wrong in (0.1, ((0.1, 0.2, 0.3), 0.1, -4),
                    ((0.1, 0.2, 0.3), 0.1, 1, 9), (0.1, 0.2))),
    (lambda: tagged(4), "no entity of the mesh tags has the value 4"),
    (lambda: ao.read_mesh("meshes/lever.msh", groups={"body": (None, 3)}), "groups"),
    (lambda: ao.read_mesh("meshes/lever.msh", comm=MPI.COMM_NULL), "COMM_NULL"),
    (lambda: ao.read_model("meshes/lever.msh", comm=MPI.COMM_NULL), "COMM_NULL"),
    # matrices
    (lambda: given("stiffness", np.eye(2)), "dense or PETSc matrix; got str"),
    (lambda: given(np.kron(np.eye(20), [[1e4, -1e4], [-1e4, 1e4]]), np.eye(40)), "matrices"),
    (lambda: given(np.diag([1.0, -2.0, 3.0]), np.eye(3)), "K must be positive semidefinite; its d"),
    (lambda: given(np.eye(3), np.diag([-1.0, 1.0, 1.0])), "M must be positive semidefinite; its d"),
    (lambda: given(np.eye(3), np.zeros((3, 3))), "structure"),
    (lambda: given(np.zeros((3, 3)), np.eye(3)), "K is zero"),
]  # fmt: skip
MATRICES = [
    ([[2, np.nan], [np.nan, 1]], np.eye(2), "K holds NaN or infinite entries"),
    (np.eye(2), [[1, 0], [0, np.inf]], "M holds NaN or infinite entries"),
    ([[2, 1], [0, 1]], np.eye(2), "K must be symmetric"),
    (np.eye(2), [[1, 2], [0, 1]], "M must be symmetric"),
    (np.eye(3), np.eye(2), "alike; got 3 and 2 rows"),
    (np.ones((2, 3)), np.eye(2), "K must be square; got 2 rows and 3 columns"),
    (np.zeros((0, 0)), np.zeros((0, 0)), "K must be square; got 0 rows"),
]
WRONG += [
    (lambda K=K, M=M, as_=as_: given(*(as_(np.asarray(A, dtype=float)) for A in (K, M))), word)
    for (K, M, word), as_ in product(MATRICES, (np.asarray, scipy.sparse.csr_matrix))
]
POINT, UP = {"point": (0, 0, 0)}, {"direction": (0, 0, 1)}
SITES = [
    ({}, "a Site needs one of: point with direction, dof, vector, or node"),
    *((more, "a Site needs one of") for more in (
        {**POINT, "dof": 3}, {"dof": 0, "vector": [1.0]}, {"node": 3, **POINT, **UP},
        {"node": 3, "vector": [1.0], "dof": "z"})),
    (POINT, "needs the direction of impact"),
    ({"point": "top"}, "needs the direction of impact"),
    ({**POINT, "direction": (0, 0, 0)}, "direction must not be the zero vector"),
    ({"node": 3, "direction": (0, 0, 0)}, "direction must not be the zero vector"),
    ({**POINT, "direction": (0, 1)}, "need 2 or 3 numbers; got 3 and 2"),
    ({"point": (0,), "direction": (1,)}, "need 2 or 3 numbers; got 1 and 1"),
    ({"node": 3, "direction": (1,)}, "need 2 or 3 numbers"),
    ({"point": (0, np.nan, 0), **UP}, "point must be finite"),
    ({**POINT, "direction": (0, np.inf, 1)}, "direction must be finite"),
    ({**POINT, **UP, "radius": 0.0}, "radius must be > 0"),
    ({"dof": 0, "radius": 0.1}, "no surface"),
    ({"dof": -1}, "dof must be a whole number >= 0"),
    ({"vector": "b"}, "vector must"),
    ({"node": 3}, "at a node needs one of: dof, as 'z', or direction"),
    ({"node": 3, "dof": "z", **UP}, "at a node needs one of"),
    ({"node": -3, "dof": "z"}, "node must be a whole number"),
    ({"node": 3, "dof": "w"}, "dof"),
    ({"dof": 0, "tangential": True}, "tangential directions need a Site with a direction"),
    ({"dof": 0, "snap": "no"}, "snap must be"),
    ({"dof": 0, "tangential": 3}, "tangential must be"),
    ({"dof": 0, "part": "a"}, "part names the part of an assembly"),
    ({**POINT, **UP, "part": ""}, "part must be a name"),
    ({"point": "", **UP}, "point must be a name"),
]  # fmt: skip
WRONG += [
    (lambda given=given: ao.extract(block(*LEFT), ao.Site(**given)), word) for given, word in SITES
]
IN_PLANE, UPWARDS = (0.0, 0.0), {"z": 5.0}
DASHPOTS = [
    (ao.Damper(IN_PLANE, UPWARDS), "2 coordinates"),
    (ao.Damper((0.0, 0.0, 0.0), UPWARDS, to=IN_PLANE), "2 coordinates"),
    (ao.Spring(IN_PLANE, UPWARDS), "2 coordinates"),
    (ao.PointMass(IN_PLANE, 1.0), "2 coordinates"),
    (ao.Damper((0.0, 0.0, 0.0), UPWARDS, to=(0.0, 0.0, 0.0)), "ends at the point where it begins"),
]
for one, word in DASHPOTS:
    in_part = partial(ao.Structure, parts.box(), ao.Solid(**STEEL), attached=[one])
    WRONG += [
        (in_part, word),
        (lambda one=one: ao.assemble({"a": block(*LEFT)}, [], attached=[one]), word),
    ]


@pytest.mark.parametrize(("call", "word"), WRONG)
def test_it_is_refused(call, word):
    with refused(None, word, ao.InputError):
        call()


LINE = [[0, 0, 0], [1, 0, 0], [1, 0, 0], [2, 0, 0]], ("line", [[0, 1], [1, 2], [2, 3]])
FACE = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 1, 0]], ("triangle", [[0, 1, 2], [0, 2, 3]])
BOWTIE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], ("quad", [[0, 1, 3, 2]])
#: A block whose upper corners are given in another order than the lower ones.
TURNED = (
    [[x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))],
    ("hexahedron", [[0, 1, 2, 3, 5, 4, 7, 6]]),
)
INNER = [*SQUARE, [0.5, 0.6, 0], [0.6, 0.4, 0], [0.6, 0.4, 0]]
MIDDLES = [*INNER, [0.5, 0, 0], [1, 0.5, 0], [0.5, 1, 0], [0, 0.5, 0]]
PAIR = INNER, ("quad", [[0, 1, 2, 4], [0, 4, 2, 3]])
#: An inner node that is a corner.
CORNER = MIDDLES, ("triangle6", [[0, 1, 2, 7, 8, 5], [0, 2, 3, 1, 9, 10]])
CELLS = [
    (LINE, {}, "1 of 3 cells of part.vtu have no length, one at (1, 0, 0) m: merge"),
    (FACE, {"gdim": 2}, "1 of 2 cells of part.vtu have no area"),
    (FACE, {"gdim": 3}, "1 of 2 cells of part.vtu have no area"),
    (BOWTIE, {}, "1 of 1 cells of part.vtu cross themselves, as a bowtie does, one at (0.5, 0.5"),
    (BOWTIE, {"gdim": 3}, "1 of 1 cells of part.vtu cross themselves"),
    (TURNED, {}, "1 of 1 cells of part.vtu cross themselves"),
    (PAIR, {}, "2 of 2 cells of part.vtu repeat another one, or share two sides"),
    (CORNER, {}, "1 nodes inside sides of cells are corners of cells too"),
    (None, {}, "cannot be opened"),
]


def test_a_dolfinx_mesh_of_cells_that_cross_is_refused():
    x, (_, cells) = np.array(BOWTIE[0], dtype=float), BOWTIE[1]
    order = np.array(cells)[:, [0, 1, 3, 2]]  # dolfinx counts rows
    mesh = compat.create_mesh(MPI.COMM_SELF, order.astype(np.int64), x[:, :2], "quadrilateral", 1)
    with refused(None, "1 of 1 quadrilateral cells cross themselves", ao.MeshError):
        ao.read_mesh(mesh)


def test_a_node_that_is_corner_and_inside_a_side_is_refused_on_every_way_to_a_mesh():
    """dolfinx ends the process at it."""
    x = np.array([*MIDDLES, [0.2, 0.2, 0]], dtype=float)[:, :2]
    cells = np.array([[0, 1, 2, 8, 11, 7], [0, 2, 3, 9, 10, 1]])
    with refused(None, "1 nodes inside sides of cells are corners", ao.MeshError):
        compat.create_mesh(MPI.COMM_SELF, cells, x, "triangle", 2)


@pytest.mark.slow
@pytest.mark.parametrize(("content", "options", "words"), CELLS)
def test_files_of_cells_without_measure_or_that_dolfinx_would_die_of(
    tmp_path, content, options, words
):
    if content:
        write(tmp_path / "part.vtu", *content)
    with refused(None, words, ao.MeshError):
        ao.read_mesh(tmp_path / "part.vtu", **options)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["modes", "krylov"])
@pytest.mark.parametrize("supports", [[ao.Support(lambda x: np.isclose(x[0], 0))], []],
                         ids=["supported", "free"])  # fmt: skip
@pytest.mark.filterwarnings("ignore::antiosc.base.errors.AntioscWarning")
def test_a_part_that_hangs_on_one_node(tmp_path, supports, method):
    """Two squares that touch in one corner: the factor may pass, but no number made with it may."""
    points = [*SQUARE, [2, 1, 0], [2, 2, 0], [1, 2, 0]]
    path = write(tmp_path / "hinge.vtu", points, ("quad", [[0, 1, 2, 3], [2, 4, 5, 6]]))
    structure = ao.Structure(ao.read_mesh(path), STRESS, supports)
    with refused(None, "hinge", (ao.AccuracyError, ao.NotConvergedError)):
        ao.extract(structure, ao.Site((2.0, 2.0), (-1, 1)), n=3, method=method)


RANKS = r"""
folder = sys.argv[1]

warnings.simplefilter("ignore", ao.AntioscWarning)
world = MPI.COMM_WORLD
solid = ao.Solid(**parts.STEEL)
mesh = parts.box(groups={
    "left": (2, lambda x: np.isclose(x[0], 0)), "low": (3, lambda x: x[0] <= 0.1 + 1e-9)
})
part = ao.Structure(mesh, solid, [ao.Support("left")])
top = ao.Site((0.2, 0.02, 0.04), (0, 0, -1))
rod = ao.Section.rectangle(0.01, 0.03)

def one_rank_fails(x):
    if world.rank == world.size - 1:
        raise ValueError("only here")
    return x[0] < 0

cases = [
    lambda: ao.read_mesh(folder + "/nowhere.msh"),
    lambda: ao.read_mesh(folder + "/garbage.msh"),
    lambda: ao.read_mesh(folder + "/garbage.vtu"),
    lambda: ao.read_mesh(folder + "/pieces.vtu", cells="nowhere"),
    lambda: ao.read_mesh(folder + "/pieces.vtu"),
    lambda: mesh.group("foot"),
    lambda: ao.Structure(mesh, solid, [ao.Support("foot")]),
    lambda: ao.Structure(mesh, solid, [ao.Support(lambda x: x[0] > 1)]),
    lambda: ao.Structure(mesh, solid, [ao.Support(lambda x: x[0] > -1)]),
    lambda: ao.Structure(mesh, solid, [ao.Support(one_rank_fails)]),
    lambda: ao.Structure(mesh, {"low": solid}),
    lambda: ao.Structure(mesh, ao.Solid(**parts.STEEL, plane="stress")),
    lambda: ao.Structure(parts.frame([(0, 0, 0), (1, 0, 0), (1, 1, 0)], [(0, 1), (1, 2)], 3),
                         ao.Beam(**parts.STEEL, section=rod, orientation=(0, 1, 0))),
    lambda: ao.extract(part, ao.Site((0.2, 0.02, 0.1), (0, 0, -1))),
    lambda: ao.extract(part, ao.Site((0.0, 0.02, 0.01), (0, 0, -1))),
    lambda: ao.extract(part, ao.Site((0.1, 0.025, 0.02), (0, 0, -1), radius=1e-3)),
    lambda: ao.extract(part, top, n=part.dofs),
    lambda: ao.extract(part, top, n=3, method="magic"),
    lambda: ao.impact_map(part, "nowhere"),
    lambda: ao.impact_map(part, "left"),
]
for k, case in enumerate(cases):
    try:
        case()
    except Exception as error:
        print(k, type(error).__name__, error)
    else:
        print(k, "nothing was raised")
"""


@pytest.mark.mpi
def test_every_rank_raises_the_same_error(tmp_path):
    for suffix in ("msh", "vtu"):
        (tmp_path / f"garbage.{suffix}").write_text("Dear reader,\nthis is no mesh.\n")
    quads = ("quad", [[0, 1, 2, 3], [4, 5, 6, 7]])
    write(tmp_path / "pieces.vtu", [*SQUARE, *(SQUARE + 2)], quads)
    one = run_ranks(1, START + RANKS, str(tmp_path))[0]
    two = run_ranks(2, START + RANKS, str(tmp_path))
    assert "nothing was raised" not in one
    assert two == [one, one]
    assert len(one.splitlines()) == 20


ROUND = ao.Section.circle(0.02)
SOLID_STEEL, HELD = ao.Solid(**parts.STEEL), [ao.Support("left")]


def bar(scale: float = 1.0, material: ao.Solid = SOLID_STEEL, **options: int) -> ao.Structure:
    mesh = parts.box(n=(2, 1, 1), size=(0.2 * scale, 0.05 * scale, 0.04 * scale))
    return ao.Structure(mesh, material, HELD, **options)


REFUSED = [
    (lambda: plausible.material_doubt(ao.Beam(210e3, 0.3, 7850.0, ROUND)), "outside 40 to"),
    (
        lambda: plausible.material_doubt(ao.Solid(210, 0.3, 7850.0)),
        "0.164 m/s.*units are SI",
    ),
    (
        lambda: plausible.material_doubt(ao.Solid(210e9, 0.3, 7.85e-9)),
        "5.17e.09 m/s, outside 40 to 20000: units are SI",
    ),
    (lambda: bar(material=ao.Solid(210e3, 0.3, 7850.0)), "Solid"),
    (lambda: ao.read_mesh(MESHES / "bracket.step", size=5), "larger.*0.08.* m.*0.005 m"),
    (lambda: ao.extract(bar(order=1), ao.Site((0.1, 0.02, 0.04), (0, 0, -1), radius=4.0), n=2),
     "radius 4 m.*larger than the part.*0.004 m"),
    (lambda: plausible.impact_doubts([soft()], [ball(3e4)]), "30 .30000 mm/s. is probably"),
]  # fmt: skip


@pytest.mark.parametrize(("call", "words"), REFUSED)
def test_what_cannot_be_is_refused(call, words):
    with pytest.raises(ao.InputError, match=words):
        call()


def told(material: object) -> None:
    plausible.warn_each([plausible.material_doubt(material)])


def soft(**info) -> ao.AntiOscillators:
    """A model whose patch is far too small for a hard blow."""
    return ao.AntiOscillators(
        m0=0.1, k0=1e7, m=[0.2], omega=[5e3], local_compliance=2e-9, radius=4e-3, info=info
    )


def ball(velocity: float) -> ao.Sphere:
    return ao.Sphere(0.01, 210e9, 0.3, 7850.0, velocity)
