"""Finished meshes and decks with smaller cells: measures, groups, materials, supports, impacts."""

from __future__ import annotations

import re
import tomllib
import warnings

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import antiosc as ao
from abaqus_decks import tied_cell
from antiosc.base import process
from antiosc.base.errors import InputError, MeshError, OutOfMemoryError
from antiosc.fem.linalg.algebra import multiply
from antiosc.fem.mesh.halving import halved, scheme, with_cells_of
from antiosc.fem.mesh.soundness import sound
from antiosc.fem.mesh.thirds import with_cells_near
from antiosc.fem.platform import compat
from antiosc.fem.structure.structure import on_mesh
from antiosc.io.neutral import KINDS, RawMesh
from antiosc_decks import from_deck
from scene_files import antiosc, numbers

pytestmark = pytest.mark.fem
basix = pytest.importorskip("basix")
#: Linear maps of the cells of the tests, with a shear, so that no two directions are alike.
SHEAR = np.array([[1.0, 0.3, 0.1], [0.0, 0.8, 0.2], [0.0, 0.0, 1.3]])


def one_cell(shape: str, order: int, bend: float = 0.0) -> RawMesh:
    """One cell as a mesh, all facets of it a group; its second-order sides are bent by `bend`."""
    kind = next(k for k in KINDS.values() if (k.shape, k.order) == (shape, order))
    cell = getattr(basix.CellType, shape)
    corners = np.asarray(basix.geometry(cell))
    nodes = [corners[k] for k in range(len(corners))]
    if order == 2:
        between = sorted(compat.nodes_between(shape), key=lambda pair: pair[1])
        nodes += [corners[vertices].mean(axis=0) for vertices, _ in between]
    x = np.array(nodes)
    points = x @ SHEAR[: x.shape[1], : x.shape[1]]
    points[:, 0] += bend * x[:, 1] * (1 - x[:, 1])
    facets = np.array(basix.topology(cell)[kind.dim - 1])
    to_dolfinx = compat.node_order(shape, kind.nodes, "vtk")
    cells = np.arange(kind.nodes)[None, np.argsort(to_dolfinx)]
    of_side = {2: "interval", 3: "triangle", 4: "quadrilateral"}[facets.shape[1]]
    facets = facets[:, np.argsort(compat.node_order(of_side, facets.shape[1], "vtk"))]
    groups = {"skin": {kind.dim - 1: facets}, "all": {kind.dim: cells[:, : kind.vertices]}}
    groups["corner"] = {0: np.array([[0]])}
    return RawMesh(points, cells, kind, "vtk", groups, numbers=np.arange(len(points)))


def measure(raw: RawMesh) -> float:
    """Length, area or volume of a mesh, by quadrature on its curved cells."""
    cell = getattr(basix.CellType, raw.kind.shape)
    element = basix.create_element(basix.ElementFamily.P, cell, raw.kind.order)
    X, weights = basix.make_quadrature(cell, 6)
    gradients = element.tabulate(1, X)[1:, :, :, 0]
    nodes = raw.cells[:, compat.node_order(raw.kind.shape, raw.kind.nodes, raw.convention)]
    J = np.einsum("dqk,cki->cqid", gradients, raw.points[nodes])
    return float((np.abs(np.linalg.det(J)) @ weights).sum())


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("shape", ["triangle", "quadrilateral", "tetrahedron", "hexahedron"])
def test_halves_fill_their_cell_and_groups_follow(shape, order):
    raw = one_cell(shape, order, 0.2 * (order - 1))
    fine = raw
    for count in (1, 2):
        (fine,) = halved([fine])
        assert len(fine.cells) == 2 ** (raw.kind.dim * count)
        assert measure(fine) == pytest.approx(measure(raw), rel=1e-12)  # bent sides stay
        sound(fine, "cells", made_here=False)  # no cracks, no overlaps
        assert len(np.unique(fine.cells)) == len(fine.points)  # common nodes are one
        sides = fine.groups["skin"][raw.kind.dim - 1]
        assert len(sides) == len(raw.groups["skin"][raw.kind.dim - 1]) * 2 ** (
            (raw.kind.dim - 1) * count
        )
        x = np.linalg.solve(SHEAR[: raw.kind.dim, : raw.kind.dim].T, fine.points.T).T
        if order == 1:  # all vertices of the group lie on the skin
            on_skin = np.minimum(np.abs(x), np.abs(1 - x)).min(axis=1) < 1e-12
            on_skin |= np.abs(1 - x.sum(axis=1)) < 1e-12
            assert on_skin[sides].all()
        assert fine.groups["all"][raw.kind.dim].shape[0] == len(fine.cells)
        assert fine.groups["corner"][0].tolist() == [[0]]


def test_repeated_halves_of_a_tetrahedron_have_three_shapes_at_most():
    raws = [one_cell("tetrahedron", 1)]
    for _ in range(3):
        raws = halved(raws)
    x = raws[0].points[raws[0].cells]
    pairs = np.triu_indices(4, 1)
    edges = np.sort(np.linalg.norm(x[:, pairs[0]] - x[:, pairs[1]], axis=2), axis=1)
    assert len(np.unique(np.round(edges, 9), axis=0)) <= 3


def test_weights_of_a_cell_are_those_of_its_corners():
    assert scheme("hexahedron").weights[0].sum(axis=-1) == pytest.approx(1.0)
    assert scheme("tetrahedron").weights[0].max() == pytest.approx(0.5)


def test_too_many_cells_are_refused():
    with pytest.raises(MeshError, match="choose a larger size"):
        with_cells_of(1e-4, [one_cell("hexahedron", 1)], "a")


# -- smaller cells around a point


def around(raw: RawMesh, size: float, *points: tuple[float, ...]) -> RawMesh:
    """A mesh with cells of a size around points."""
    return with_cells_near([(point, size) for point in points], [raw], "a")[0]


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("shape", ["triangle", "quadrilateral"])
def test_thirds_fill_their_cells_and_groups_follow(shape, order):
    raw = one_cell(shape, order, 0.2 * (order - 1))
    raw.groups["one"] = {1: raw.groups["skin"][1][:1]}
    for _ in range(3):
        (raw,) = halved([raw])
    point = (0.3, 0.35)
    fine = around(raw, 0.01, point)
    assert measure(fine) == pytest.approx(measure(raw), rel=1e-12)  # bent sides stay
    sound(fine, "cells", made_here=False)  # no cracks, no overlaps
    vertices = np.unique(fine.cells[:, : raw.kind.vertices])
    assert set(vertices) <= set(np.unique(fine.cells))
    assert len(np.unique(fine.points[np.unique(fine.cells)].round(12), axis=0)) == len(
        np.unique(fine.cells)
    )  # common nodes are one
    corners = fine.points[fine.cells[:, : raw.kind.vertices]]
    sides = np.linalg.norm(corners[:, :, None] - corners[:, None], axis=3).max(axis=(1, 2))
    distance = np.linalg.norm(corners.mean(axis=1) - point, axis=1)
    assert sides[distance < 0.02].max() <= 0.01
    assert sides[distance > 0.4].max() > 0.1
    # sides of the mesh are those of one cell; each is covered
    ends = fine.cells[:, : raw.kind.vertices][:, compat.node_order(shape, raw.kind.vertices, "vtk")]
    edges = np.sort(np.vstack([ends[:, e] for e in basix.topology(
        getattr(basix.CellType, shape))[1]]), axis=1)  # fmt: skip
    rows, uses = np.unique(edges, axis=0, return_counts=True)
    skin = np.unique(np.sort(fine.groups["skin"][1], axis=1), axis=0)
    assert skin.tolist() == rows[uses == 1].tolist()
    assert 0 < len(fine.groups["one"][1]) < len(skin)
    assert len(fine.groups["all"][2]) == len(fine.cells)
    assert fine.groups["corner"][0].tolist() == [[0]]


def test_lines_are_divided_around_a_point():
    ends = np.array([[0, 1]])
    raw = RawMesh(np.array([[0.0], [1.0]]), ends, KINDS["line"], "vtk", numbers=np.arange(2))
    fine = around(raw, 0.02, (0.4,))
    x = np.sort(fine.points[:, 0])
    gaps = np.diff(x)
    assert gaps.sum() == pytest.approx(1.0)
    assert gaps[np.abs(x[:-1] - 0.4) < 0.03].max() <= 0.02
    assert len(fine.cells) < 0.6 / 0.02


def test_solids_around_a_point_are_refused():
    with pytest.raises(MeshError, match="size makes all elements smaller"):
        around(one_cell("hexahedron", 1), 0.1, (0.5, 0.5, 0.5))


@pytest.mark.parametrize("shape", ["triangle", "quadrilateral"])
def test_constant_strains_and_curvatures_pass_through_cells_of_unlike_size(tmp_path, shape):
    """No forces inside a plate in any of the six states, over the forces at its edges."""
    path = tmp_path / "plate.inp"
    i, j = (c.ravel() for c in np.meshgrid(range(9), range(5)))
    inside = (i % 8 > 0) & (j % 4 > 0)
    nodes = (
        np.stack([i, j], axis=1) / 20
        + 0.01 * np.stack([np.sin(7 * j), np.cos(5 * i)]).T * (inside[:, None])
    )
    first = np.flatnonzero((i < 8) & (j < 4)) + 1
    cells = np.stack([first, first + 1, first + 10, first + 9], axis=1)
    if shape == "triangle":
        cells = np.vstack([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]])
    rows = [f"{k + 1}, {a!r}, {b!r}, 0." for k, (a, b) in enumerate(nodes.tolist())]
    elements = [f"{k + 1}, {', '.join(map(str, cell))}" for k, cell in enumerate(cells.tolist())]
    card = f"*ELEMENT, TYPE=S{cells.shape[1]}, ELSET=ALL"
    path.write_text("\n".join(["*NODE", *rows, card, *elements]) + "\n")
    shell = ao.Shell(E=70e9, nu=0.33, rho=2700.0, thickness=0.02)
    mesh = ao.read_mesh(path, gdim=3, refine=[((0.23, 0.09, 0.0), 0.006)])
    assert mesh.cell == shape
    part = on_mesh(ao.Structure(mesh, shell))
    x, y, _ = part.form.space.tabulate_dof_coordinates().T
    on_edge = (np.abs(x - 0.2) > 0.2 - 1e-9) | (np.abs(y - 0.1) > 0.1 - 1e-9)
    zero = np.zeros_like(x)
    bent = [  # w, its derivatives by y and minus by x: the rotations
        (x * x / 2, zero, -x),
        (y * y / 2, y, zero),
        (x * y, x, -y),
    ]
    states = [(zero, zero, w, *turns, zero) for w, *turns in bent]
    states += [(x, zero, *4 * [zero]), (zero, y, *4 * [zero]), (y, x, *4 * [zero])]
    assert mesh.n_cells > 200
    for state in states:
        forces = multiply(part.K, np.stack(state, axis=1).reshape(-1, 1)).reshape(-1, 6)
        assert np.abs(forces[~on_edge]).max() < 1e-7 * np.abs(forces[on_edge]).max()


# -- decks


def deck(path, n: int, beam: str = "", more: str = "") -> str:
    """A sheet of 0.4 m x 0.2 m in 2n x n quadrilaterals: two thicknesses, an edge clamped; with a
    rib along its middle, a post of n elements in its middle, a fold and an offset, with fibres
    across its thin part, or triangles in a corner.
    """
    # the columns beside the fold are of unlike widths: halves of one are nearest to the middle of
    # the other, where the fibres and the side of the offset differ
    fold = beam == "fold"
    columns = np.interp(
        np.arange(2 * n + 1) * 2 / n, range(5), [0, 0.02 if fold else 0.1, 0.2, 0.3, 0.4]
    )
    heights = 4.0 * np.abs(columns - 0.02) * fold
    a, b = 2 * n + 1, n + 1
    lines = ["*NODE"]
    lines += [
        f"{1 + i + a * j}, {columns[i]:.17g}, {0.2 * j / n!r}, {heights[i]:.17g}"
        for j in range(b)
        for i in range(a)
    ]
    lines += [f"{5000 + k}, 0.2, 0.1, {0.1 * k / n!r}" for k in range(1, n + 1)]
    for name, cells in (("THIN", range(n)), ("THICK", range(n, 2 * n))):
        triangles = beam == "triangles" and name == "THICK"
        lines.append(f"*ELEMENT, TYPE=S4, ELSET={name}")
        for j in range(n):
            for i in cells:
                first = 1 + i + a * j
                corners = f"{first}, {first + 1}, {first + 1 + a}, {first + a}"
                if not (triangles and i >= 3 * n // 2 and j < n // 4):
                    lines.append(f"{1 + i + 2 * n * j}, {corners}")
    if beam == "triangles":
        lines.append("*ELEMENT, TYPE=S3, ELSET=THICK")
        for j in range(n // 4):
            for i in range(3 * n // 2, 2 * n):
                first = 1 + i + a * j
                lines += [
                    f"{20_000 + first}, {first}, {first + 1}, {first + 1 + a}",
                    f"{30_000 + first}, {first + 1 + a}, {first + a}, {first}",
                ]
    if beam in ("rib", "post"):
        lines.append("*ELEMENT, TYPE=B31, ELSET=RIB")
        middle = 1 + a * (n // 2)
        nodes = [middle + i for i in range(2 * n + 1)]
        if beam == "post":
            nodes = [middle + n, *range(5001, 5001 + n)]
        lines += [f"{10000 + k}, {nodes[k]}, {nodes[k + 1]}" for k in range(len(nodes) - 1)]
        lines += ["*BEAM SECTION, ELSET=RIB, MATERIAL=M, SECTION=RECT", "0.01, 0.004", "0., 1., 0."]
    lines += ["*NSET, NSET=EDGE", *(f"{1 + a * j}," for j in range(b))]
    lines += ["*MATERIAL, NAME=M", "*ELASTIC", "70e9, 0.33", "*DENSITY", "2700."]
    thicknesses = (2e-2, 4e-2) if fold else (1e-3, 2e-3)
    for name, thickness in zip(("THIN", "THICK"), thicknesses, strict=True):
        card = f"*SHELL SECTION, ELSET={name}"
        if fold and name == "THIN":
            lines += [
                f"{card}, COMPOSITE, ORIENTATION=O, OFFSET=0.5",
                f"{thickness}, 3, FIBRES, 0.",
            ]
        elif fold:
            lines += [f"{card}, MATERIAL=M, OFFSET=0.5", f"{thickness}"]
        else:
            lines += [f"{card}, MATERIAL=M", f"{thickness}"]
    if fold:
        lines += ["*ORIENTATION, NAME=O", "1., 1., 0., -1., 1., 0.", "3, 0."]
        lines += ["*MATERIAL, NAME=FIBRES", "*DENSITY", "1600."]
        lines += ["*ELASTIC, TYPE=LAMINA", "140e9, 10e9, 0.3, 5e9, 5e9, 5e9"]
    lines += ["*BOUNDARY", "EDGE, 1, 6", more]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")
    return str(path)


def held_end(n: int, kind: str) -> str:
    """A body of 50 g before the free end of a `deck`, whose nodes it holds."""
    held = [f"{(2 * n + 1) * (1 + j)}," for j in range(n + 1)]
    joints = {
        "rigid": ["*RIGID BODY, NSET=END, REF NODE=7000"],
        "coupling": [
            "*SURFACE, NAME=FACE, TYPE=NODE",
            "END,",
            "*COUPLING, REF NODE=7000, SURFACE=FACE, CONSTRAINT NAME=C",
            "*KINEMATIC",
            "1, 6",
        ],
        "beams": ["*MPC", *(f"BEAM, {(2 * n + 1) * (1 + j)}, 7000" for j in range(n + 1))],
    }
    body = ["*NODE", "7000, 0.45, 0.05, 0.03", "*ELEMENT, TYPE=MASS, ELSET=BODY", "7001, 7000"]
    return "\n".join([*body, "*MASS, ELSET=BODY", "0.05", "*NSET, NSET=END", *held, *joints[kind]])


@pytest.mark.parametrize("kind", ["rigid", "coupling", "beams"])
@pytest.mark.slow
def test_new_nodes_between_held_ones_follow_the_body_that_holds_these(tmp_path, kind):
    site = ao.Site((0.25, 0.15, 0.0), (0.0, 0.0, -1.0))
    structures = []
    for n, size in ((2, 0.06), (4, 0.06), (8, None)):
        path = deck(tmp_path / f"{n}.inp", n, more=held_end(n, kind))
        structures.append(ao.read_model(path, "m", size=size))
    fine = ao.extract(structures[-1], site, n=10)
    for part in structures[:-1]:
        halves = ao.extract(part, site, n=10)
        assert halves.k0 == pytest.approx(fine.k0, rel=1e-7)
        assert halves.omega == pytest.approx(fine.omega, rel=1e-7)


@pytest.mark.filterwarnings("ignore:.*the area of the offset surface")
@pytest.mark.parametrize("beam", ["", "rib", "post", "fold"])
def test_a_halved_deck_is_the_deck_of_halved_elements(tmp_path, beam):
    z = 0.92 if beam == "fold" else 0.0
    site = ao.Site((0.25, 0.15, z), (0.0, 0.0, -1.0), part="faces" if beam == "post" else None)
    structures = [
        ao.read_model(deck(tmp_path / "coarse.inp", 2, beam), "m", size=0.2 if z else 0.06),
        ao.read_model(deck(tmp_path / "fine.inp", 8, beam), "m"),
    ]
    assert structures[0].dofs == structures[1].dofs
    assert structures[0].mass == pytest.approx(structures[1].mass, rel=1e-12)
    a, b = (ao.extract(part, site, n=10) for part in structures)
    # the nodes have other numbers: rounding differs, the more the thinner a sheet is
    assert a.k0 == pytest.approx(b.k0, rel=1e-7)
    assert a.omega == pytest.approx(b.omega, rel=1e-7)


@pytest.mark.parametrize("beam", ["triangles", "rib", "post", "rigid"])
def test_the_mesh_error_of_a_deck_of_several_families_is_that_of_the_finer_deck(tmp_path, beam):
    """The static flexibility of a deck with elements of half the size, and its impact."""
    site = ao.Site((0.25, 0.15, 0.0), (0.0, 0.0, -1.0), part="faces" if beam == "post" else None)
    ball = ao.RigidMass(mass=1e-2, velocity=1e-3)
    models, forces = [], []
    for n in (4, 8):
        more = held_end(n, beam) if beam == "rigid" else ""
        part = ao.read_model(deck(tmp_path / f"{n}.inp", n, beam, more), "m")
        models.append(ao.extract(part, site, n=60, error="estimate"))
        forces.append(ao.simulate(models[-1], ball, ao.Linear(1e5), duration=4e-3))
    (coarse, fine), (hit, finer_hit) = models, forces
    energy = coarse.k0**2 / fine.k0 - coarse.k0
    found = coarse.strain_error[0, 0] + coarse.strain_misfit[0, 0]
    assert found == pytest.approx(4 / 3 * energy, rel=1e-4)
    assert abs(finer_hit.peak_force / hit.peak_force - 1) < hit.error_budget["peak_force"].mesh


def on_infinite_plate(mass: float, stiffness: float, end: float) -> float:
    """Largest force [N] of a mass of 1 m/s and a spring on a plate of 2 mm without edges."""
    bending, area = 70e9 * 2e-3**3 / 12 / (1 - 0.33**2), 2700 * 2e-3
    impedance = 8 * np.sqrt(area * bending)
    found = solve_ivp(
        lambda _, y: [-y[1] / mass, stiffness * (y[0] - y[1] / impedance)],
        (0.0, end), [1.0, 0.0], rtol=1e-9, atol=1e-9, max_step=1e-6,
    )  # fmt: skip
    return float(found.y[1].max())


@pytest.mark.slow
def test_a_blow_on_a_halved_deck_is_that_on_an_infinite_plate(tmp_path):
    """A mass and a spring on the impedance 8 √(m″ D), while no wave has come back from the edge."""
    path = deck(tmp_path / "a.inp", 2)
    mass, stiffness, end = 1e-3, 1e5, 2.5e-4
    exact = on_infinite_plate(mass, stiffness, end)
    errors = []
    for size in (None, 0.06, 0.02):
        part = ao.read_model(path, "m", size=size)
        model = ao.extract(part, ao.Site((0.3, 0.1, 0.0), (0, 0, -1.0)), n=min(100, part.dofs // 8))
        ball = ao.RigidMass(mass=mass, velocity=1.0)
        hit = ao.simulate(model, ball, ao.Linear(stiffness), duration=end)
        errors.append(abs(hit.peak_force / exact - 1))
    assert errors[0] > 0.03
    assert errors[1] < 2e-3
    assert errors[2] < 6e-4


@pytest.mark.slow
def test_a_blow_on_a_deck_with_smaller_cells_at_the_site_is_that_on_an_infinite_plate(tmp_path):
    """As above, with a fourth of the cells that halving all of them takes; and with a bar."""
    path = deck(tmp_path / "a.inp", 4)
    mass, stiffness, end, place = 1e-3, 1e5, 2.5e-4, (0.31, 0.11, 0.0)
    exact = on_infinite_plate(mass, stiffness, end)
    hits, cells = [], []
    for options in ({}, {"refine": [(place, 0.01)]}, {"size": 0.01}):
        part = ao.read_model(path, "m", **options)
        error = None if "size" in options else "estimate"
        model = ao.extract(part, ao.Site(place, (0, 0, -1.0)), n=100, error=error)
        ball = ao.RigidMass(mass=mass, velocity=1.0)
        hits.append(ao.simulate(model, ball, ao.Linear(stiffness), duration=end))
        cells.append(on_mesh(part).mesh.n_cells)
    coarse, near, all_small = (hit.peak_force / exact - 1 for hit in hits)
    assert abs(coarse) > 5e-3
    assert abs(near) < 2e-3
    assert abs(near - all_small) < 2e-3
    assert 4 * cells[1] < cells[2]
    assert abs(near) < hits[1].error_budget["peak_force"].total < 0.1


def everywhere(n: int, size: float) -> list[tuple[tuple[float, ...], float]]:
    """A size around the middle of each cell of a `deck`."""
    x, y = ((np.arange(count) + 0.5) * 0.2 / n for count in (2 * n, n))
    return [((a, b, 0.0), size) for a in x for b in y]


@pytest.mark.filterwarnings("ignore:.*changes nothing")
@pytest.mark.parametrize("beam", ["", "rib", "triangles", "rigid"])
def test_a_deck_divided_everywhere_is_the_deck_of_thirds(tmp_path, beam):
    """Its parts, joints and supports follow; triangles have another diagonal in the corner."""
    site = ao.Site((0.1, 0.15, 0.0), (0.0, 0.0, -1.0))
    structures = []
    for n, options in ((4, {"refine": everywhere(4, 0.045)}), (12, {})):
        more = held_end(n, beam) if beam == "rigid" else ""
        path = deck(tmp_path / f"{n}.inp", n, beam, more)
        structures.append(ao.read_model(path, "m", **options))
    assert structures[0].dofs == structures[1].dofs
    assert structures[0].mass == pytest.approx(structures[1].mass, rel=1e-12)
    a, b = (ao.extract(part, site, n=10) for part in structures)
    assert a.k0 == pytest.approx(b.k0, rel=1e-7)
    assert a.omega == pytest.approx(b.omega, rel=1e-6)


@pytest.mark.slow
def test_a_new_scene_with_a_size_is_that_of_the_deck_of_halved_elements(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    forces, texts = [], []
    for name, n, more in (("coarse", 2, ["--size", "0.06"]), ("fine", 8, [])):
        deck(tmp_path / f"{name}.inp", n)
        assert antiosc("new", f"{name}.toml", f"{name}.inp", *more) == 0
        scene = (tmp_path / f"{name}.toml").read_text()
        lines = [line for line in scene.replace(name, "part").splitlines() if "size = " not in line]
        texts.append(lines)
        assert tomllib.loads(scene)["deck"].get("size") == (0.06 if more else None)
        (tmp_path / f"{name}.toml").write_text(
            re.sub(r"duration = 0.1 ", "duration = 2e-3 ", scene.replace('n = "auto"', "n = 20"))
        )
        for _ in range(2 if more else 1):
            assert antiosc("run", f"{name}.toml", "--out", "out") == 0
            forces.append(numbers(tmp_path / "out")["result"]["peak_force"])
    assert texts[0] == texts[1]
    assert forces[0] == forces[1]
    assert forces[0] == pytest.approx(forces[2], rel=1e-6)


@pytest.mark.filterwarnings("ignore:.*the area of the offset surface")
@pytest.mark.slow
def test_fibres_and_offsets_of_divided_elements_are_those_of_their_elements(tmp_path):
    """Around the fold, where neighbours have other fibres, against a deck of finer elements."""
    site = ao.Site((0.03, 0.12, 0.04), (0.0, 0.0, -1.0))
    near = [(site.point, 0.02)]
    stiffness = [
        ao.extract(
            ao.read_model(deck(tmp_path / f"{n}.inp", n, "fold"), "m", **options), site, n=5
        ).k0
        for n, options in ((4, {"refine": near}), (24, {}))
    ]
    assert stiffness[0] == pytest.approx(stiffness[1], rel=0.03)


def test_smaller_cells_beside_a_tie_leave_its_edge_and_tell_it_at_the_tie(tmp_path):
    """A site away from the tie has its cells; the tied cell goes on to hang on the whole edge."""
    tied = tied_cell({15: (0.4, 0.2), 10: (0.4, 0.1)}, (0.1, 0.0), "THICK")
    path = deck(tmp_path / "a.inp", 2, more=tied)
    site = ao.Site((0.15, 0.05, 0.0), (0.0, 0.0, -1.0))
    ties, frequencies = [], []
    for options in ({}, {"refine": [(site.point, 0.02)]}, {"refine": [((0.38, 0.15, 0.0), 0.02)]}):
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            part = ao.read_model(path, "m", **options)
        stays = [one for one in told if "stay at (0.38, 0.15, 0) m" in str(one.message)]
        assert bool(stays) == ("(0.38" in str(options))
        ties.append(part.dofs)
        frequencies.append(ao.extract(part, site, n=10).omega[0])
    assert ties[0] < ties[1]
    assert frequencies[1:] == pytest.approx([frequencies[0]] * 2, rel=0.02)


def test_a_divided_deck_that_does_not_fit_is_refused_before_it_is_assembled(tmp_path, monkeypatch):
    """Before any structure is made, with what it needs and what is free."""
    path = deck(tmp_path / "a.inp", 2)
    made, structure = [], ao.Structure

    def assembled(*given, **options):
        made.append(given)
        return structure(*given, **options)

    monkeypatch.setattr(from_deck, "Structure", assembled)
    monkeypatch.setattr(process, "free_memory", lambda: 2e8)
    for options in ({"size": 2e-3}, {"refine": [((0.2, 0.1, 0.0), 2e-3)], "size": 4e-3}):
        with pytest.raises(OutOfMemoryError, match=r"needs about .* GB and 0.2 GB are free"):
            ao.read_model(path, "m", **options)
    assert made == []
    ao.read_model(path, "m", size=0.05)
    assert len(made) == 1


def test_decks_that_cannot_be_halved_say_why(tmp_path):
    tied = tied_cell({15: (0.4, 0.2), 10: (0.4, 0.1)}, (0.1, 0.0), "THICK")
    path = deck(tmp_path / "a.inp", 2, more=tied)
    with pytest.raises(InputError, match="12 equations tie nodes"):
        ao.read_model(path, "m", size=0.05)
    bars = tmp_path / "bars.inp"
    bars.write_text(
        "*NODE\n1, 0., 0., 0.\n2, 1., 0., 0.\n3, 0., 1., 0.\n4, 0., 0., 1.\n"
        "*ELEMENT, TYPE=T3D2, ELSET=ALL\n1, 1, 2\n2, 1, 3\n3, 1, 4\n4, 2, 3\n5, 3, 4\n6, 2, 4\n"
        "*MATERIAL, NAME=M\n*ELASTIC\n210e9, 0.3\n*DENSITY\n7850.\n"
        "*SOLID SECTION, ELSET=ALL, MATERIAL=M\n1e-4\n",
        encoding="ascii",
    )
    for options in ({"size": 0.5}, {"refine": [((0, 0, 0), 0.1)]}):
        with pytest.raises(InputError, match="hinges at their ends"):
            ao.read_model(bars, "m", **options)
