"""What cannot be computed is refused in one sentence, on every rank, and leaves no file behind."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import dolfinx
import meshio
import scipy.sparse
from mpi4py import MPI

import antiosc as ao
import parts
from antiosc.errors import AntioscWarning
from mpi import run_ranks
from paths import TESTS

pytestmark = pytest.mark.fem

SOLID = ao.Solid(**parts.STEEL)
CIRCLE = ao.Section.circle(0.02)
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)


def refused(text: str, error=ao.InputError):
    """The block must raise `error` with a message of one line that matches `text`."""
    return pytest.raises(error, match=text)


def one_sentence(message: str) -> bool:
    return "\n" not in message and message.rstrip().endswith(".") and len(message) < 400


@pytest.fixture(scope="module")
def clamped():
    return ao.Structure(parts.box(), SOLID, [ao.Support("left")])


def write(path: Path, points, *cells) -> Path:
    meshio.Mesh(np.asarray(points, dtype=float), list(cells)).write(path)
    return path


# --- Files ----------------------------------------------------------------------------------------


def test_missing_file(tmp_path):
    with refused(r"there is no mesh file '.*part\.msh'; check the path", ao.MeshError) as caught:
        ao.read_mesh(tmp_path / "part.msh")
    assert one_sentence(str(caught.value))


@pytest.mark.parametrize(
    "suffix", ["msh", "step", "brep", "geo", "vtu", "inp", "bdf", "med", "xyz", "stl"]
)
def test_a_file_of_something_else(tmp_path, suffix):
    path = tmp_path / f"part.{suffix}"
    path.write_text("Dear reader,\nthis is no mesh.\n")
    with refused(rf"part\.{suffix}", ao.MeshError) as caught:
        ao.read_mesh(path, size=0.1 if suffix in ("step", "brep", "geo") else None)
    assert one_sentence(str(caught.value)), str(caught.value)


def test_a_geometry_needs_a_size_and_a_mesh_takes_none(tmp_path):
    with refused(r"bracket\.step is a geometry, not a mesh: give the element size"):
        ao.read_mesh("meshes/bracket.step")
    with refused(r"lever\.msh is a finished mesh: size= and refine= apply to geometry files only"):
        ao.read_mesh("meshes/lever.msh", size=0.01)
    with refused(r"size must be > 0 \(in m\); got -1"):
        ao.read_mesh("meshes/bracket.step", size=-1)
    with refused(r"gdim must be 2 or 3; got 4"):
        ao.read_mesh("meshes/lever.msh", gdim=4)
    with refused(r"order must be 1 or 2; got 3"):
        ao.read_mesh("meshes/lever.msh", order=3)
    with refused(r"a size of refine must be > 0"):
        ao.read_mesh("meshes/bracket.step", size=0.1, refine=[((0, 0, 0), 0.0)])


def test_cells_that_no_element_carries(tmp_path):
    points = [*SQUARE, [0.5, 0.5, 0.0]]
    path = write(tmp_path / "part.vtu", points, ("polygon", [range(5)]))
    with refused(r"part\.vtu holds polygon cells", ao.MeshError):
        ao.read_mesh(path)
    path = write(tmp_path / "points.vtu", points, ("vertex", [[0], [1]]))
    with refused(r"points\.vtu contains no cells", ao.MeshError):
        ao.read_mesh(path)
    (tmp_path / "empty.off").write_text("OFF\n\n1 0 0\n\n0 0 0\n")
    with refused(r"empty\.off contains no cells", ao.MeshError):
        ao.read_mesh(tmp_path / "empty.off")


def test_pieces_that_share_no_node(tmp_path):
    points = [*SQUARE, *(SQUARE + np.array([1.5, 0, 0])), *(SQUARE + np.array([2.5, 0, 0]))]
    quads = [[0, 1, 2, 3], [4, 5, 6, 7], [8, 9, 10, 11]]
    path = write(tmp_path / "part.vtu", points, ("quad", quads))
    with refused(
        r"part\.vtu falls into 3 pieces that share no node \(1, 1, 1 cells\)", ao.MeshError
    ):
        ao.read_mesh(path)


def test_coordinates_that_are_not_numbers(tmp_path):
    points = SQUARE.copy()
    points[2, 1] = np.nan
    path = write(tmp_path / "part.vtu", points, ("quad", [[0, 1, 2, 3]]))
    with refused("coordinates of the mesh are not finite", ao.MeshError):
        ao.read_mesh(path)


def test_cells_without_measure(tmp_path):
    line = [[0, 0, 0], [1, 0, 0], [1, 0, 0], [2, 0, 0]]
    path = write(tmp_path / "line.vtu", line, ("line", [[0, 1], [1, 2], [2, 3]]))
    with refused(
        r"1 of 3 cells of line\.vtu have no length, one at \(1, 0, 0\) m: merge", ao.MeshError
    ):
        ao.read_mesh(path)
    faces = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 1, 0]]
    path = write(tmp_path / "face.vtu", faces, ("triangle", [[0, 1, 2], [0, 2, 3]]))
    for gdim in (2, 3):
        with refused(r"1 of 2 cells of face\.vtu have no area", ao.MeshError):
            ao.read_mesh(path, gdim=gdim)


def test_what_is_no_file(tmp_path):
    with refused("read_mesh takes a file or a dolfinx mesh; got int 3"):
        ao.read_mesh(3)
    for wrong in (0.1, ((0.1, 0.2, 0.3), 0.1, 4), (0.1, 0.2)):
        with refused(r"refine lists pairs \(point, size\)"):
            ao.read_mesh("meshes/bracket.step", size=0.1, refine=[wrong])


def test_tags_that_mark_nothing():
    mesh = dolfinx.mesh.create_unit_square(MPI.COMM_SELF, 2, 2)
    tags = dolfinx.mesh.meshtags(
        mesh, 2, np.array([0], dtype=np.int32), np.array([3], dtype=np.int32)
    )
    with refused("group 'body': no entity of the mesh tags has the value 4"):
        ao.read_mesh(mesh, groups={"body": (tags, 4)})
    with refused("a file brings its own groups"):
        ao.read_mesh("meshes/lever.msh", groups={"body": (tags, 3)})


# --- Materials ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"E": -1.0}, r"E must be > 0 \(in Pa\); got -1"),
        ({"E": 0.0}, r"E must be > 0"),
        ({"E": np.nan}, r"E must be finite"),
        ({"E": "stiff"}, r"E must be a number"),
        ({"nu": 0.5}, r"nu must lie in -1 < nu < 0.5 .*incompressible.*; got 0.5"),
        ({"nu": -1.0}, r"nu must lie in -1 < nu < 0.5"),
        ({"rho": 0.0}, r"rho must be > 0 \(in kg/m³\); got 0"),
        ({"rho": -7850.0}, r"rho must be > 0"),
    ],
)
def test_material_constants(change, text):
    with refused(text):
        ao.Solid(**{**parts.STEEL, **change})
    with refused(text):
        ao.Beam(**{**parts.STEEL, **change}, section=CIRCLE)


def test_plane_parts():
    with refused(r"plane must be None, 'stress' or 'strain'; got 'flat'"):
        ao.Solid(**parts.STEEL, plane="flat")
    with refused(r"thickness must be > 0"):
        ao.Solid(**parts.STEEL, plane="stress", thickness=0.0)
    with refused(r"Solid on a 2-D mesh needs plane='stress' or plane='strain'"):
        ao.Structure(parts.plate(), SOLID)
    with refused(r"plane='stress' applies to 2-D meshes"):
        ao.Structure(parts.box(), ao.Solid(**parts.STEEL, plane="stress"))


def test_sections():
    with refused(r"the wall t must be thinner than d/2 = 0.02 m; got 0.02"):
        ao.Section.tube(0.04, 0.02)
    with refused(r"width must be > 0"):
        ao.Section.rectangle(-0.1, 0.1)
    with refused(r"A must be > 0"):
        ao.Section(A=0.0, I=1.0)
    with refused(r"section must be a Section; got float"):
        ao.Beam(**parts.STEEL, section=0.1)


def test_materials_and_meshes_that_do_not_fit():
    beam = ao.Beam(**parts.STEEL, section=CIRCLE)
    with refused(r"Beam needs a mesh of lines; .* has hexahedron cells"):
        ao.Structure(parts.box(), beam)
    with refused(r"Solid needs cells of the dimension of the space; .* has interval cells"):
        ao.Structure(parts.line(1.0, 2), SOLID)
    with refused(r"displacements of order 1 on cells of geometric order 2"):
        ao.Structure(
            ao.read_mesh("meshes/lever.msh"), ao.Solid(**parts.STEEL, plane="stress"), order=1
        )
    with refused(r"order must be 1 or 2; got 3"):
        ao.Structure(parts.box(), SOLID, order=3)
    with refused(r"mesh must come from read_mesh; got str"):
        ao.Structure("meshes/lever.msh", SOLID)
    with refused(r"material must be a Solid.*; got float"):
        ao.Structure(parts.box(), 210e9)


def test_orientation_of_sections():
    mesh = parts.line(1.0, 2, (0, 0, 1))
    flat = ao.Section.rectangle(0.01, 0.03)
    with refused(r"needs an orientation in space"):
        ao.Structure(mesh, ao.Beam(**parts.STEEL, section=flat))
    with refused(r"orientation \(0, 0, 2\) is parallel to the axis of 2 beam elements"):
        ao.Structure(mesh, ao.Beam(**parts.STEEL, section=flat, orientation=(0, 0, 2)))
    with refused(r"the length of orientation must be > 0"):
        ao.Beam(**parts.STEEL, section=flat, orientation=(0, 0, 0))


def test_every_cell_needs_one_material():
    halves = {
        "low": (3, lambda x: x[0] <= 0.1 + 1e-9),
        "high": (3, lambda x: x[0] >= 0.1 - 1e-9),
        "all": (3, lambda x: x[0] > -1),
        "skin": (2, lambda x: np.isclose(x[0], 0)),
    }
    mesh = parts.box(groups=halves)
    with refused(r"of 16 cells 8 have none and 0 more than one; the groups named are 'low'"):
        ao.Structure(mesh, {"low": SOLID})
    with refused(r"of 16 cells 0 have none and 8 more than one"):
        ao.Structure(mesh, {"all": SOLID, "high": SOLID})
    with refused(r"has no group 'middle'; its groups are: 'all', 'high', 'low', 'skin'"):
        ao.Structure(mesh, {"middle": SOLID})
    with refused(r"group 'skin' holds no cells"):
        ao.Structure(mesh, {"skin": SOLID})
    with refused(r"empty dict"):
        ao.Structure(mesh, {})
    with refused(r"all materials of one structure must be of one family"):
        ao.Structure(mesh, {"low": SOLID, "high": ao.Beam(**parts.STEEL, section=CIRCLE)})


# --- Supports -------------------------------------------------------------------------------------


def test_supports():
    mesh = parts.box()
    with refused(r"has no group 'foot'; its groups are: 'left', 'right'"):
        ao.Structure(mesh, SOLID, [ao.Support("foot")])
    with refused(r"the support by function .* fixes nothing: no point of the mesh lies there"):
        ao.Structure(mesh, SOLID, [ao.Support(lambda x: x[0] > 1)])
    with refused(
        r"fix='rx' is not a component of this structure: it must be 'all' or of 'x', 'y', 'z'"
    ):
        ao.Structure(mesh, SOLID, [ao.Support("left", "rx")])
    with refused(r"fix=\(\) is not a component"):
        ao.Structure(mesh, SOLID, [ao.Support("left", ())])
    with refused(r"must return one bool per point: shape \(225,\); got \(\)"):
        ao.Structure(mesh, SOLID, [ao.Support(lambda x: True)])
    with refused(r"supports must be a list of Support\(where, fix\); got str 'left' in it"):
        ao.Structure(mesh, SOLID, ["left"])
    with refused(r"the supports fix every dof of the structure"):
        ao.Structure(mesh, SOLID, [ao.Support(lambda x: x[0] > -1)])


def test_a_function_that_fails_says_its_own_error():
    with pytest.raises(ZeroDivisionError):
        ao.Structure(parts.box(), SOLID, [ao.Support(lambda x: 1 / 0)])


# --- Sites ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({}, r"a Site needs one of: point with direction, dof, vector, or node"),
        ({"point": (0, 0, 0), "dof": 3}, r"a Site needs one of"),
        ({"point": (0, 0, 0)}, r"needs the direction of impact"),
        ({"point": (0, 0, 0), "direction": (0, 0, 0)}, r"direction must not be the zero vector"),
        (
            {"point": (0, 0, 0), "direction": (0, 1)},
            r"must both have 2 or 3 coordinates; got 3 and 2",
        ),
        ({"point": (0,), "direction": (1,)}, r"must both have 2 or 3 coordinates; got 1 and 1"),
        ({"point": (0, np.nan, 0), "direction": (0, 0, 1)}, r"point must be finite"),
        ({"point": (0, 0, 0), "direction": (0, np.inf, 1)}, r"direction must be finite"),
        ({"point": (0, 0, 0), "direction": (0, 0, 1), "radius": 0.0}, r"radius must be > 0"),
        ({"dof": 0, "radius": 0.1}, r"radius needs a mesh"),
    ],
)
def test_sites(clamped, arguments, text):
    with refused(text) as caught:
        ao.extract(clamped, ao.Site(**arguments))
    assert one_sentence(str(caught.value))


def test_a_site_outside_or_held(clamped):
    with refused(
        r"is 0.06 m off the structure; its nearest point is \(0.2, 0.02, 0.04\) m.*snap=True"
    ):
        ao.extract(clamped, ao.Site((0.2, 0.02, 0.1), (0, 0, -1)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", AntioscWarning)
        with refused(r"\(0, 0.02, 0.01\) m is fixed by supports .*it cannot move"):
            ao.extract(clamped, ao.Site((0, 0.02, 0.01), (1, 0, 0)))


# --- Extraction -----------------------------------------------------------------------------------


def test_numbers_of_anti_oscillators(clamped):
    site = ao.Site((0.2, 0.02, 0.04), (0, 0, -1))
    with refused(rf"n must be below the structure's {clamped.dofs} dofs; got {clamped.dofs}"):
        ao.extract(clamped, site, n=clamped.dofs)
    with refused(r"n must be a whole number >= 0; got 2.5"):
        ao.extract(clamped, site, n=2.5)
    with refused(r"n must be a whole number >= 0; got -1"):
        ao.extract(clamped, site, n=-1)
    with refused(r"method must be .*; got 'magic'"):
        ao.extract(clamped, site, n=3, method="magic")
    with refused(r"tol must be > 0"):
        ao.extract(clamped, site, n=3, tol=0)


@pytest.mark.parametrize(
    ("K", "M", "text"),
    [
        ([[2, np.nan], [np.nan, 1]], np.eye(2), r"K holds NaN or infinite entries"),
        (np.eye(2), [[1, 0], [0, np.inf]], r"M holds NaN or infinite entries"),
        ([[2, 1], [0, 1]], np.eye(2), r"K must be symmetric"),
        (np.eye(2), [[1, 2], [0, 1]], r"M must be symmetric"),
        (np.eye(3), np.eye(2), r"K and M must be of one size; got \(3, 3\) and \(2, 2\)"),
        (np.ones((2, 3)), np.eye(2), r"K must be square; got 2 rows and 3 columns"),
        ("stiffness", np.eye(2), r"K must be a SciPy sparse, dense or PETSc matrix; got str"),
        (np.zeros((0, 0)), np.zeros((0, 0)), r"K must be square; got 0 rows"),
    ],
)
@pytest.mark.parametrize("sparse", [False, True])
def test_matrices(K, M, text, sparse):
    if sparse and not isinstance(K, str):
        K, M = (scipy.sparse.csr_matrix(np.asarray(A, dtype=float)) for A in (K, M))
    with refused(text):
        ao.Structure.from_matrices(K, M)


def test_rounding_in_foreign_matrices_is_no_asymmetry():
    """An entry of 1e-12 whose mirror was dropped."""
    K = np.array([[2e4, -1e4, 1e-9], [-1e4, 2e4, -1e4], [0, -1e4, 2e4]])
    assert ao.Structure.from_matrices(scipy.sparse.csr_matrix(K), np.eye(3)).dofs == 3


def test_loose_bodies_in_matrices():
    pairs = np.kron(np.eye(20), 1e4 * np.array([[1, -1], [-1, 1]]))
    with refused(r"null vectors: the matrices hold several loose bodies"):
        ao.Structure.from_matrices(pairs, np.eye(40))


def test_matrices_of_no_structure():
    with refused(r"K must be positive semidefinite; its diagonal has -2 in row 1"):
        ao.Structure.from_matrices(np.diag([1.0, -2.0, 3.0]), np.eye(3))
    with refused(r"M must be positive semidefinite; its diagonal has -1 in row 0"):
        ao.Structure.from_matrices(np.eye(3), np.diag([-1.0, 1.0, 1.0]))
    with refused(r"M is zero: a structure needs stiffness and mass"):
        ao.Structure.from_matrices(np.eye(3), np.zeros((3, 3)))
    with refused(r"K is zero"):
        ao.Structure.from_matrices(np.zeros((3, 3)), np.eye(3))


def hinge(tmp_path: Path) -> ao.Mesh:
    """Two squares that touch in one corner: one turns about the other."""
    points = [*SQUARE, [2, 1, 0], [2, 2, 0], [1, 2, 0]]
    path = write(tmp_path / "hinge.vtu", points, ("quad", [[0, 1, 2, 3], [2, 4, 5, 6]]))
    return ao.read_mesh(path)


@pytest.mark.parametrize("method", ["modes", "krylov"])
@pytest.mark.parametrize("supports", [[ao.Support(lambda x: np.isclose(x[0], 0))], []],
                         ids=["supported", "free"])  # fmt: skip
@pytest.mark.filterwarnings("ignore::antiosc.errors.AntioscWarning")
def test_a_part_that_hangs_on_one_node(tmp_path, supports, method):
    """A mechanism: the factor may pass, but no number made with it may."""
    structure = ao.Structure(hinge(tmp_path), ao.Solid(**parts.STEEL, plane="stress"), supports)
    with refused("hinge", (ao.AccuracyError, ao.NotConvergedError)):
        ao.extract(structure, ao.Site((2.0, 2.0), (-1, 1)), n=3, method=method)


# --- Impacts --------------------------------------------------------------------------------------


def test_impacts():
    model = ao.AntiOscillators(m0=1.0, k0=1e6, m=[1.0], omega=[1e3])
    for duration in (0, -1e-3, np.nan):
        with refused(r"duration must be (> 0|finite)"):
            ao.simulate(model, ao.RigidMass(1.0, 1.0), ao.Hertz(1e9), duration)
    for mass in (0.0, -1.0):
        with refused(r"mass must be > 0 \(in kg\)"):
            ao.RigidMass(mass, 1.0)
    with refused(r"every m must be > 0; m\[0\] = 0"):
        ao.AntiOscillators(m0=1.0, k0=1.0, m=[0.0], omega=[1.0])


# --- No file stays behind -------------------------------------------------------------------------


def test_a_model_that_cannot_be_written_leaves_no_file(tmp_path, monkeypatch):
    model = ao.AntiOscillators(m0=1.0, k0=1e6, m=[1.0], omega=[1e3])

    def interrupted(*arguments, **options):
        arguments[0].write(b"half of it")
        raise KeyboardInterrupt

    monkeypatch.setattr(np, "savez", interrupted)
    with pytest.raises(KeyboardInterrupt):
        model.save(tmp_path / "model.npz")
    assert list(tmp_path.iterdir()) == []


# --- On two ranks ---------------------------------------------------------------------------------


def test_extract_tells_what_it_was_given():
    line = ao.Structure(parts.line(1.0, 4), ao.Beam(**parts.STEEL, section=ao.Section.circle(0.01)))
    with pytest.raises(ao.InputError, match=r"site must be a Site\(point, direction\); got int"):
        ao.extract(line, (0, 0, 0))
    with pytest.raises(ao.InputError, match="structure must be a Structure; got Mesh"):
        ao.extract(parts.line(1.0, 4), ao.Site((0.5, 0), (0, 1)))


RANKS = r"""
import sys, warnings
import numpy as np
sys.path.insert(0, sys.argv[1])
folder = sys.argv[2]
import antiosc as ao
import parts
from antiosc.errors import AntioscWarning
from mpi4py import MPI

warnings.simplefilter("ignore", AntioscWarning)
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
    here = str(TESTS)
    one = run_ranks(1, RANKS, here, str(tmp_path))[0]
    two = run_ranks(2, RANKS, here, str(tmp_path))
    assert "nothing was raised" not in one
    assert two == [one, one]
    assert len(one.splitlines()) == 18
