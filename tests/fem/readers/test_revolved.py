"""Axisymmetric decks, revolved into solids, against closed forms of rings and discs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import antiosc as ao
from antiosc.base.errors import MeshError
from antiosc_decks.from_deck import outline_of_deck

pytestmark = pytest.mark.filterwarnings("ignore::antiosc.errors.AntioscWarning")
E, NU, RHO = 210e9, 0.3, 7850.0
INNER, OUTER, HEIGHT = 0.02, 0.05, 0.01
#: Type -> nodes of its cells, in steps of half a cell from a corner of a rectangle.
CORNERS = [(0, 0), (2, 0), (2, 2), (0, 2)]
MIDDLES = [(1, 0), (2, 1), (1, 2), (0, 1)]
HALVES = [[0, 1, 2], [0, 2, 3]]
TYPES = {
    "CAX4": [CORNERS],
    "CAX8R": [CORNERS + MIDDLES],
    "CAX3": [[CORNERS[k] for k in half] for half in HALVES],
    "CAX6": [
        [*(CORNERS[k] for k in HALVES[0]), (1, 0), (2, 1), (1, 1)],
        [*(CORNERS[k] for k in HALVES[1]), (1, 1), (1, 2), (0, 1)],
    ],
}


def deck(kind: str, inner: float, supports: str = "", more: str = "", columns: int = 6) -> str:
    """A ring of rectangles, two along its height; sets RIM, AXIS and BOTTOM."""
    rows = 2
    used = {
        (2 * i + a, 2 * j + b)
        for i in range(columns)
        for j in range(rows)
        for cell in TYPES[kind]
        for a, b in cell
    }
    label = {node: k for k, node in enumerate(sorted(used), 1)}
    text = "*NODE\n"
    for (i, j), k in label.items():
        radius = inner + (OUTER - inner) * i / (2 * columns)
        text += f"{k}, {radius:.15g}, {HEIGHT * j / (2 * rows):.15g}\n"
    text += f"*ELEMENT, TYPE={kind}, ELSET=ALL\n"
    cells = [
        [label[2 * i + a, 2 * j + b] for a, b in cell]
        for i in range(columns)
        for j in range(rows)
        for cell in TYPES[kind]
    ]
    text += "".join(f"{k}, {', '.join(map(str, c))}\n" for k, c in enumerate(cells, 1))
    sides = {"AXIS": (0, 0), "RIM": (0, 2 * columns), "BOTTOM": (1, 0)}
    for name, (axis, place) in sides.items():
        members = [k for node, k in label.items() if node[axis] == place]
        text += f"*NSET, NSET={name}\n" + "".join(f"{k},\n" for k in members)
    text += f"*MATERIAL, NAME=STEEL\n*ELASTIC\n{E}, {NU}\n*DENSITY\n{RHO}\n"
    text += "*SOLID SECTION, ELSET=ALL, MATERIAL=STEEL\n"
    return text + more + (f"*BOUNDARY\n{supports}" if supports else "")


def part_of(folder: Path, *args: object, **options: object) -> ao.Structure:
    path = folder / "ring.inp"
    path.write_text(deck(*args, **options))  # type: ignore[arg-type]
    return ao.read_model(path, unit="m")


@pytest.mark.parametrize("kind", TYPES)
@pytest.mark.parametrize("inner", [0.0, INNER])
def test_a_revolved_ring_has_the_mass_of_its_closed_form(tmp_path, kind, inner):
    part = part_of(tmp_path, kind, inner)
    mass = RHO * np.pi * (OUTER**2 - inner**2) * HEIGHT
    assert part.mass == pytest.approx(mass, rel=1e-4)  # arcs of two second-order edges a quarter


@pytest.mark.parametrize("kind", TYPES)
def test_a_revolved_ring_has_the_strain_energy_of_lame(tmp_path, kind):
    # u_r = A r + B / r, u_z = 0: the plane strain of a tube under pressure
    part = part_of(tmp_path, kind, INNER)
    A, B = 1e-3, 4e-7
    x = part.form.space.tabulate_dof_coordinates()
    radius = np.hypot(x[:, 0], x[:, 2])
    u = x * [1, 0, 1] * (A + B / radius**2)[:, None]
    v = part.K.createVecRight()
    v.array = u.ravel()
    shear, lame = E / (2 * (1 + NU)), E * NU / ((1 + NU) * (1 - 2 * NU))
    uniform = (2 * lame + 2 * shear) * A**2 * (OUTER**2 - INNER**2)
    exact = np.pi * HEIGHT * (uniform + 2 * shear * B**2 * (INNER**-2 - OUTER**-2))
    assert v.dot(part.K * v) / 2 == pytest.approx(exact, rel=2e-3)


def held(part: ao.Structure, where: object) -> list[bool]:
    """Whether x, y, z are held in all nodes of a place."""
    x = part.form.space.tabulate_dof_coordinates()
    fixed = np.zeros(3 * len(x), dtype=bool)
    fixed[part.fixed] = True
    assert where(x).any()  # type: ignore[operator]
    return fixed.reshape(-1, 3)[where(x)].all(axis=0).tolist()  # type: ignore[operator]


def on_bottom(x: np.ndarray) -> np.ndarray:
    return np.abs(x[:, 1]) < 1e-6 * HEIGHT


def on_rim(x: np.ndarray) -> np.ndarray:
    return np.hypot(x[:, 0], x[:, 2]) > 0.9999 * OUTER


@pytest.mark.parametrize("kind", TYPES)
def test_what_is_held_is_held_all_around(tmp_path, kind):
    rim = part_of(tmp_path, kind, INNER, "RIM, 1\n")
    assert held(rim, on_rim) == [True, False, True]
    below = part_of(tmp_path, kind, INNER, "BOTTOM, 2\n")
    assert held(below, on_bottom) == [False, True, False]
    assert below.rigid_modes.shape[1] == 3  # along x and z, and about y


def test_the_axis_is_not_a_support(tmp_path):
    assert part_of(tmp_path, "CAX8R", 0.0, "AXIS, 1\n").rigid_modes.shape[1] == 6


@pytest.mark.slow
def test_a_disc_struck_in_the_middle_and_one_of_solids_meet_the_same_force(tmp_path):
    disc = part_of(tmp_path, "CAX8R", 0.0, "RIM, 1, 2\n", columns=10)
    gmsh = pytest.importorskip("gmsh")
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Verbosity", 0)
        gmsh.model.occ.addCylinder(0, 0, 0, 0, HEIGHT, 0, OUTER)
        gmsh.model.occ.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.005)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(2)
        gmsh.write(str(tmp_path / "disc.msh"))
    finally:
        gmsh.finalize()
    steel = ao.Solid(E, NU, RHO)
    rim = ao.Support(lambda x: np.hypot(x[0], x[2]) > 0.9999 * OUTER)
    free = ao.Structure(ao.read_mesh(tmp_path / "disc.msh"), steel, [rim])
    site = ao.Site(point=(0, HEIGHT, 0), direction=(0, -1, 0), radius=0.004)
    k0 = [ao.extract(part, site, n=10).k0 for part in (disc, free)]
    assert k0[0] == pytest.approx(k0[1], rel=0.02)


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        ("*EQUATION\n2\n1, 1, 1., 2, 1, -1.\n", r"line \d+ of ring.inp: \*EQUATION of an axisymm"),
        ("*NODE\n900, -0.01, 0.\n", "at a radius"),
        ("*NODE\n900, 0.01, 0., 0.02\n", "at z = 0.02"),
        ("*ELEMENT, TYPE=MASS, ELSET=M\n900, 1\n*MASS, ELSET=M\n1.\n", "has MASS elements beside"),
        (
            "*ELASTIC, TYPE=ENGINEERING CONSTANTS\n1e9, 1e9, 2e9, .1, .1, .1, 5e8, 5e8,\n5e8\n",
            "iso",
        ),
    ],
)
def test_what_cannot_be_revolved_is_refused(tmp_path, more, sentence):
    text = deck("CAX4", INNER)
    cards = text.replace("*SOLID SECTION", f"{more}*SOLID SECTION")
    (tmp_path / "ring.inp").write_text(cards)
    with pytest.raises(MeshError, match=sentence):
        ao.read_model(tmp_path / "ring.inp", unit="m")


@pytest.mark.slow
def test_more_elements_than_solids_need_are_made_coarser(tmp_path):
    """3002 elements are 24 016 solids and 580 000 dofs on 8 sectors alone."""
    path = tmp_path / "ring.inp"
    path.write_text(deck("CAX4", INNER, "RIM, 1\n", columns=1501))
    names, (raw,) = outline_of_deck(path)
    assert raw.kind.shape == "hexahedron"
    assert len(raw.cells) <= 20_000
    x = raw.points[np.unique(raw.cells)]
    radius = np.hypot(x[:, 0], x[:, 2])
    assert (radius.min(), radius.max()) == pytest.approx((INNER, OUTER))
    group = next(name for name in names if name.startswith("fixed"))
    sides = raw.points[raw.groups[group][2]]
    assert np.hypot(sides[..., 0], sides[..., 2]) == pytest.approx(OUTER)
    across = np.cross(sides[:, 2] - sides[:, 0], sides[:, 3] - sides[:, 1])  # twice the chords
    area = np.linalg.norm(across, axis=1).sum() / 2
    assert area == pytest.approx(2 * np.pi * OUTER * HEIGHT, rel=2e-3)


def test_ties_of_more_elements_are_refused(tmp_path):
    text = deck("CAX4", INNER, columns=1501)
    ties = "*SURFACE, NAME=A\n3, S2\n*SURFACE, NAME=B\n4, S4\n*TIE, NAME=T\nB, A\n"
    (tmp_path / "ring.inp").write_text(text + ties)
    with pytest.raises(MeshError, match=r"line \d+ of ring.inp: .*TIE"):
        ao.read_model(tmp_path / "ring.inp", unit="m")


def test_its_mesh_alone_stays_plane(tmp_path):
    (tmp_path / "ring.inp").write_text(deck("CAX4", INNER))
    assert ao.read_mesh(tmp_path / "ring.inp", unit="m").tdim == 2


@pytest.mark.parametrize("axial", [2, 3])
def test_a_mesh_drawn_in_x_and_z_is_that_in_x_and_y(tmp_path, axial):
    plane = deck("CAX8R", INNER, "BOTTOM, 2\n")
    lines = plane.replace("BOTTOM, 2\n", f"BOTTOM, {axial}\n").split("*ELEMENT")
    nodes = [row.split(",") for row in lines[0].splitlines()[1:]]
    upright = "".join(f"{n}, {x}, 0., {y}\n" for n, x, y in nodes)
    (tmp_path / "upright.inp").write_text("*NODE\n" + upright + "*ELEMENT" + lines[1])
    (tmp_path / "ring.inp").write_text(plane)
    parts = [ao.read_model(tmp_path / f"{name}.inp", unit="m") for name in ("ring", "upright")]
    assert parts[1].mass == pytest.approx(RHO * np.pi * (OUTER**2 - INNER**2) * HEIGHT, rel=1e-4)
    assert held(parts[1], on_bottom) == [False, True, False]
    x = [part.form.space.tabulate_dof_coordinates() for part in parts]
    np.testing.assert_allclose(x[0], x[1], atol=1e-12 * OUTER)


def test_two_rings_that_are_tied_vibrate_as_one(tmp_path):
    """The outer ring has nodes of its own where the rings meet, in the same places."""
    one = part_of(tmp_path, "CAX4", INNER, columns=4)
    nodes, cells = deck("CAX4", INNER, columns=4).split("*ELEMENT", 1)
    labels = {}
    for row in nodes.splitlines()[1:]:
        number, x, y = row.split(",")
        labels[round((float(x) - INNER) / (OUTER - INNER) * 4), round(float(y) / HEIGHT * 2)] = (
            number
        )
    copies = {labels[2, j]: str(900 + j) for j in range(3)}
    nodes += "".join(
        f"{copy}, {row.partition(',')[2]}\n"
        for row in nodes.splitlines()[1:]
        for number, copy in copies.items()
        if row.startswith(f"{number},")
    )
    rows, rest = cells.split("*NSET", 1)
    head, *rows = rows.splitlines()
    outer = [",".join(copies.get(n.strip(), n) for n in row.split(",")[1:]) for row in rows[4:]]
    rows[4:] = [f"{k}, {row}" for k, row in enumerate(outer, 5)]
    ties = "*SURFACE, NAME=A\n3, S2\n4, S2\n*SURFACE, NAME=B\n5, S4\n6, S4\n*TIE, NAME=T\nB, A\n"
    text = nodes + "*ELEMENT" + "\n".join([head, *rows]) + "\n*NSET" + rest + ties
    (tmp_path / "tied.inp").write_text(text)
    tied = ao.read_model(tmp_path / "tied.inp", unit="m")
    assert tied.mass == pytest.approx(one.mass, rel=1e-12)
    sites = [
        ao.Site(point=(0.03, HEIGHT, 0), direction=(0, -1, 0), radius=0.004, part=part)
        for part in (None, "solids")
    ]
    k0 = [ao.extract(part, site, n=10).k0 for part, site in zip((one, tied), sites, strict=True)]
    assert k0[1] == pytest.approx(k0[0], rel=1e-3)
