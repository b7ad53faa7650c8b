"""Cross-sections against integrals over their areas; ends of beams, released, or tapered."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import antiosc as ao
import nastran_decks as bdf
from antiosc_decks import (
    abaqus_sections as abaqus_profiles,
    nastran_beams as nastran_profiles,
    properties as profiles,
)
from antiosc_decks.abaqus_cards import Card
from antiosc_decks.entries import DeckPlace
from antiosc_decks.nastran_beams import RIGID_SHEAR_FACTOR, BeamProfiles
from antiosc_decks.nastran_cards import Entry

PLACE = DeckPlace(Path("a deck"), 1)


def nastran(name: str, kind: str, *dimensions: float) -> profiles.Profile:
    """A cross-section of PBARL or PBEAML; its height lies along the plane 1 of Nastran."""
    fields = ["1", "1", "", kind, "", "", "", "", *map(str, dimensions)]
    return beam(name, fields).profile


def beam(name: str, fields: list[str]) -> nastran_profiles.BeamProfile:
    return nastran_profiles.BeamProfiles(Entry(name, PLACE, fields)).mean()


def abaqus(section: str, *dimensions: float) -> profiles.Profile:
    """A cross-section of *BEAM SECTION; its height lies along the direction 1 of Abaqus."""
    data = ", ".join(map(str, dimensions))
    return abaqus_profiles.profile_of(
        Card("BEAMSECTION", {"SECTION": section}, PLACE, [data], [PLACE])
    )


def rectangle(height, width, x, y):
    return (abs(x) < height / 2) & (abs(y) < width / 2)


def disc(a, b, x, y):
    return (x / a) ** 2 + (y / b) ** 2 < 1


#: (cross-section, whether a point at x along the height and y across belongs to it)
SECTIONS = {
    "BAR": (nastran("PBARL", "BAR", 2.0, 3.0), lambda x, y: rectangle(3, 2, x, y)),
    "BEAM BAR": (nastran("PBEAML", "BAR", 2.0, 3.0), lambda x, y: rectangle(3, 2, x, y)),
    "ROD": (nastran("PBARL", "ROD", 1.5), lambda x, y: disc(1.5, 1.5, x, y)),
    "TUBE": (
        nastran("PBARL", "TUBE", 1.5, 1.1),
        lambda x, y: disc(1.5, 1.5, x, y) & ~disc(1.1, 1.1, x, y),
    ),
    # the third dimension is the wall above and below, the fourth that of the sides
    "BOX of Nastran": (
        nastran("PBARL", "BOX", 2.0, 3.0, 0.4, 0.2),
        lambda x, y: rectangle(3, 2, x, y) & ~rectangle(2.2, 1.6, x, y),
    ),
    "RECT": (abaqus("RECT", 3.0, 2.0), lambda x, y: rectangle(3, 2, x, y)),
    "RECT, one side": (abaqus("RECT", 2.0), lambda x, y: rectangle(2, 2, x, y)),
    "CIRC": (abaqus("CIRC", 1.5), lambda x, y: disc(1.5, 1.5, x, y)),
    "CIRC of CalculiX": (abaqus("CIRC", 3.0, 2.0), lambda x, y: disc(1.5, 1, x, y)),
    "PIPE": (abaqus("PIPE", 1.5, 0.4), lambda x, y: disc(1.5, 1.5, x, y) & ~disc(1.1, 1.1, x, y)),
    "BOX of Abaqus": (
        abaqus("BOX", 3.0, 2.0, 0.4, 0.2, 0.4, 0.2),
        lambda x, y: rectangle(3, 2, x, y) & ~rectangle(2.2, 1.6, x, y),
    ),
}


def slab(low, high, left, right):
    return lambda x, y: (x > low) & (x < high) & (y > left) & (y < right)


def union(*parts):
    return lambda x, y: np.any([part(x, y) for part in parts], axis=0)


#: type -> (a point at x upward and y sideward belongs to it, dimensions after the figures of the
#: Nastran manuals)
WALLS = {
    "I": (
        union(slab(-1.5, -1.2, -1, 1), slab(-1.2, 1.1, -0.1, 0.1), slab(1.1, 1.5, -0.6, 0.6)),
        [3.0, 2.0, 1.2, 0.2, 0.3, 0.4],
    ),
    "I1": (
        union(slab(-1.5, -1.2, -1, 1), slab(-1.2, 1.2, -0.1, 0.1), slab(1.2, 1.5, -1, 1)),
        [1.8, 0.2, 2.4, 3.0],
    ),
    "T": (union(slab(1.1, 1.5, -1, 1), slab(-1.5, 1.1, -0.15, 0.15)), [2.0, 3.0, 0.4, 0.3]),
    "T1": (union(slab(-1.5, 1.5, -1, -0.6), slab(-0.15, 0.15, -0.6, 1.4)), [3.0, 2.0, 0.4, 0.3]),
    "T2": (union(slab(-1.5, -1.1, -1, 1), slab(-1.1, 1.5, -0.15, 0.15)), [2.0, 3.0, 0.4, 0.3]),
    "CHAN": (
        union(slab(-1.5, 1.5, -1, -0.8), slab(-1.5, -1.2, -1, 1), slab(1.2, 1.5, -1, 1)),
        [2.0, 3.0, 0.2, 0.3],
    ),
    "CHAN1": (
        union(slab(-1.5, 1.5, -1, -0.8), slab(-1.5, -1.2, -1, 1), slab(1.2, 1.5, -1, 1)),
        [1.8, 0.2, 2.4, 3.0],
    ),
    "CHAN2": (
        union(slab(-1, 1, -1.5, -1.2), slab(-1, 1, 1.2, 1.5), slab(-1, -0.8, -1.5, 1.5)),
        [0.3, 0.2, 2.0, 3.0],
    ),
    "H": (
        union(slab(-1, 1, -1.5, -1.2), slab(-1, 1, 1.2, 1.5), slab(-0.1, 0.1, -1.2, 1.2)),
        [2.4, 0.6, 2.0, 0.2],
    ),
    "CROSS": (union(slab(-1.5, 1.5, -0.1, 0.1), slab(-0.2, 0.2, -1, 1)), [1.8, 0.2, 3.0, 0.4]),
    "HAT": (
        union(
            slab(0.8, 1, -0.8, 0.8),
            *(slab(-0.8, 0.8, a, a + 0.2) for a in (-0.8, 0.6)),
            *(slab(-1, -0.8, a, a + 0.9) for a in (-1.5, 0.6)),
        ),
        [2.0, 0.2, 1.6, 0.7],
    ),
    "BOX1": (
        lambda x, y: slab(-1.5, 1.5, -1, 1)(x, y) & ~slab(-1.3, 1.1, -0.9, 0.7)(x, y),
        [2.0, 3.0, 0.4, 0.2, 0.1, 0.3],
    ),
    "HEXA": (lambda x, y: (abs(x) < 0.75) & (abs(y) < 1.5 - abs(x) / 0.75 * 0.6), [0.6, 3.0, 1.5]),
}


SECTIONS |= {kind: (nastran("PBARL", kind, *sizes), at) for kind, (at, sizes) in WALLS.items()}


@pytest.mark.parametrize("name", SECTIONS)
def test_area_and_second_moments_are_integrals(name):
    profile, inside = SECTIONS[name]
    n = 1600
    at = (np.arange(n) + 0.5) / n * 4 - 2
    within = inside(at[:, None], at) * (4 / n) ** 2
    x, y, A = within.sum(axis=1), within.sum(axis=0), within.sum()
    assert pytest.approx(A, rel=3e-3) == profile.A
    assert pytest.approx(at**2 @ x - (at @ x) ** 2 / A, rel=4e-3) == profile.I
    assert profile.I_side == pytest.approx(at**2 @ y - (at @ y) ** 2 / A, rel=4e-3)
    assert profile.height == pytest.approx(np.ptp(at[x > 0]), rel=3e-3)
    if name not in WALLS:
        assert profile.width == pytest.approx(np.ptp(at[y > 0]), rel=3e-3)
    turned = profile.rotated()
    assert (turned.I, turned.I_side) == (profile.I_side, profile.I)
    assert (turned.height, turned.width) == (profile.width, profile.height)


def prandtl(inside, n: int = 64) -> float:
    """J = 2 ∫ ψ of a solid section, ∇²ψ = −2 with ψ = 0 on its rim, on a grid over 4 × 4."""
    from scipy.sparse import diags, eye, kron
    from scipy.sparse.linalg import spsolve

    h = 4 / n
    at = np.arange(1, n) * h - 2
    D = diags([1.0, -2.0, 1.0], [-1, 0, 1], shape=(n - 1, n - 1)) / h**2
    laplace = (kron(D, eye(n - 1)) + kron(eye(n - 1), D)).tocsr()
    free = np.flatnonzero(inside(at[:, None], at).ravel())
    return float(2 * h**2 * spsolve(-laplace[free][:, free], np.full(free.size, 2.0)).sum())


@pytest.mark.parametrize("name", ["RECT", "RECT, one side"])
def test_torsion_of_rectangles_is_prandtls(name):
    profile, inside = SECTIONS[name]
    assert pytest.approx(prandtl(inside), rel=5e-3) == profile.J


#: K1 and K2 of PBEAM, blank 1 and 0 rigid in shear; of PBAR, blank is 0.
@pytest.mark.parametrize(
    ("name", "K", "wanted"),
    [
        ("PBEAM", ("", ""), (1, 1)),
        ("PBEAM", ("", ".3"), (1, 0.3)),
        ("PBEAM", (".3", "0."), (0.3, RIGID_SHEAR_FACTOR)),
        ("PBEAM", ("0.", ".3"), (RIGID_SHEAR_FACTOR, 0.3)),
        ("PBEAM", ("0.", "0."), None),
        ("PBAR", ("", ""), None),
        ("PBAR", ("", ".3"), (RIGID_SHEAR_FACTOR, 0.3)),
        ("PBAR", (".3", "0."), (0.3, RIGID_SHEAR_FACTOR)),
    ],
)
def test_shear_coefficients_that_are_blank_or_0(name, K, wanted):
    fields = ["1", "1", "6.", "4.5", "2.", "", "4.7", *9 * [""], *K]
    if name == "PBAR":
        fields[5:7] = ["4.7", ""]
    one = beam(name, fields)
    assert one.sheared == bool(wanted)
    assert not wanted or one.profile.shear_coefficients == wanted


@pytest.mark.slow
@pytest.mark.fem
@pytest.mark.parametrize("v", ["0.,0.,1.", "0.,.6,.8"])
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(("name", "K2"), [("PBEAM", 0.25), ("PBAR", 0.25), ("PBEAM", 0.0)])
def test_a_cantilever_bends_and_shears_in_both_planes(tmp_path, v, turned, name, K2):
    """L³/3EI + L/GKA (Timoshenko) in plane 1 and in plane 2, also of a beam that is turned about
    its axis, and whichever of the planes is the first.
    """
    L, A, I, K = 0.4, 2e-3, (9e-7, 3e-7), (0.7, K2)  # noqa: E741
    height = np.array([float(word) for word in v.split(",")])
    across = np.cross([1.0, 0, 0], height)
    exact = [
        L**3 / (3 * E * i) + (L / (k * E / 2.6 * A) if k else 0) for i, k in zip(I, K, strict=True)
    ]
    if turned:  # plane 2 becomes plane 1
        v = ",".join(f"{x!r}" for x in across.tolist())
        I, K = I[::-1], K[::-1]  # noqa: E741
    moments = f"{I[0]},{I[1]},," if name == "PBEAM" else f"{I[0]},{I[1]},"
    path = tmp_path / "arm.bdf"
    path.write_text(
        f"GRID,1,,0.,0.,0.\nGRID,2,,{L},0.,0.\nC{name[1:]},1,1,1,2,{v}\n"
        f"{name},1,1,{A},{moments}1.-7\n,,,,,,,,,\n,{K[0]},{K[1]}\n"
        f"MAT1,1,{E},,.3,7800.\nSPC1,1,123456,1\n"
    )
    part = ao.read_model(path)
    for direction, flexibility in zip((height, across), exact, strict=True):
        k0 = ao.extract(part, ao.Site((L, 0, 0), tuple(direction)), n=2).k0
        assert 1 / k0 == pytest.approx(flexibility, rel=1e-5)


def test_torsion_of_hollow_sections():
    """Bredt: 4 A²/∮ds/t with the area A within the middle line; round, it is the polar moment."""
    for name in ("TUBE", "PIPE"):
        tube = SECTIONS[name][0]
        assert pytest.approx(np.pi / 2 * (1.5**4 - 1.1**4)) == tube.J
    for name in ("BOX of Nastran", "BOX of Abaqus"):
        around = 2 * 1.8 / 0.4 + 2 * 2.6 / 0.2  # two walls 0.4 thick, two 0.2
        assert pytest.approx(4 * (2.6 * 1.8) ** 2 / around) == SECTIONS[name][0].J


@pytest.mark.parametrize("name", ["ROD", "CIRC", "CIRC of CalculiX"])
def test_torsion_of_ellipses_is_saint_venants(name):
    """4 I₁I₂/(I₁ + I₂); on a circle the polar moment."""
    profile = SECTIONS[name][0]
    first, second = profile.I, profile.I_side
    assert pytest.approx(4 * first * second / (first + second)) == profile.J


RNG = np.random.default_rng(43)
X = np.round(RNG.uniform(-1, 1, (4, 3)), 3)
W = np.round(0.2 * RNG.uniform(-1, 1, (2, 3)), 3)
#: The system of node 2: its axes x, y, z are y, z and x of the deck.
CYCLIC = "CORD2R,5,,0.,0.,0.,1.,0.,0.,\n,0.,1.,0.\n"
MAT = "MAT1,1,2.+11,,.3,7800.\nPBAR,7,1,1.-4,3.-9,2.-9,2.-9\nPBAR,8,1,1.-4,3.-9,2.-9,2.-9\n"
V = (0.1, 0.2, 0.9)


def read(folder, cards: str):
    text = CYCLIC + MAT
    for k, x in enumerate(X, 1):
        text += f"GRID,{k},,{','.join(map(str, x))}{',5' if k == 2 else ''}\n"
    text += "CBAR,9,8,2,3,.1,.2,.9\nCBAR,10,8,3,4,.1,.2,.9\n"
    return bdf.read(folder, text + cards, unit="m")


def words(values) -> str:
    return ",".join(map(str, values))


def rows(model, count: int) -> np.ndarray:
    """Equations (n, nodes, 6); nodes of no element have negative numbers and places."""
    loose = [int(np.argmin(np.linalg.norm(X - x, axis=1))) for x in model["joints"]["points"]]
    found = np.zeros((len(model["joints"]["equations"]), count, 6))
    for row, terms in zip(found, model["joints"]["equations"], strict=True):
        for node, motion, value in terms:
            row[node if node >= 0 else loose[-1 - node], motion] += value
    return found


PINS = {"": [], "45": [3, 4], "456": [3, 4, 5], "1": [0], "5": [4]}


@pytest.mark.parametrize("first", PINS)
@pytest.mark.parametrize("second", ["", "5"])
def test_ends_follow_their_nodes_but_for_what_is_released(tmp_path, first, second):
    """Offsets along the axes of each node's own motions; pins along the axes of the beam."""
    card = f"CBAR,1,7,1,2,{words(V)}\n,{first},{second},{words(W[0])},{words(W[1])}\n"
    model, deck = read(tmp_path, card)
    ends = np.array([X[0] + W[0], X[1] + W[1] @ np.eye(3)[[1, 2, 0]]])
    np.testing.assert_allclose(deck.points[4:], ends, atol=1e-12)
    (beam,) = (block for block in deck.blocks if len(block) == 3)
    assert beam.corners[2].tolist() == [4, 5]
    assert model["apart"] == [4, 5]
    found = rows(model, 6)
    held = [[c for c in range(6) if c not in PINS[pins]] for pins in (first, second)]
    assert len(found) == sum(map(len, held))
    line = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    v = np.array(V) - (np.array(V) @ line) * line
    v /= np.linalg.norm(v)
    axes = np.stack([line, v, np.cross(line, v)])
    for k in (0, 1):
        own = found[np.abs(found[:, 4 + k]).max(axis=1) > 0]
        # a motion of the end against its node is held if a part of it is along a held axis
        released = [c for c in range(6) if c not in held[k]]
        for c in range(6):
            moved = np.zeros(6)
            moved[3 * (c // 3) : 3 * (c // 3) + 3] = axes[c % 3]
            assert (np.abs(own[:, 4 + k] @ moved).max() < 1e-12) == (c in released)
        U, turn = RNG.normal(size=(2, 3))
        u = np.zeros((6, 6))
        u[k], u[4 + k] = (*U, *turn), (*(U + np.cross(turn, ends[k] - X[k])), *turn)
        assert np.abs(np.einsum("enc,nc->e", own, u)).max() < 1e-12
    assert np.linalg.matrix_rank(found.reshape(len(found), -1)) == len(found)


def profile(kind: str, *dimensions: float):
    fields = ["1", "1", "", kind, *[""] * 4, *map(str, dimensions)]
    return BeamProfiles(Entry("PBARL", DeckPlace("a deck", 1), fields)).mean().profile


#: Lengths and thicknesses of the walls after the figures of the manuals.
OPEN = {
    ("I", 3.0, 2.0, 1.2, 0.2, 0.3, 0.4): [(2.0, 0.3), (1.2, 0.4), (2.3, 0.2)],
    ("HAT", 2.0, 0.2, 1.6, 0.7): [(1.6, 0.2), (1.6, 0.2), (1.6, 0.2), (0.9, 0.2), (0.9, 0.2)],
}


@pytest.mark.parametrize("case", OPEN)
def test_thin_open_sections_have_the_torsion_of_their_walls(case):
    """Σ l t³/3; the shear coefficient is that of thin walls."""
    found = profile(*case)
    assert pytest.approx(sum(length * t**3 for length, t in OPEN[case]) / 3) == found.J
    assert pytest.approx(sum(length * t for length, t in OPEN[case])) == found.A
    assert found.shear_coefficient == 0.5


# --- Beams whose neutral axis lies beside the shear centre, against closed forms ------------------


E = 2e11


@pytest.mark.slow
@pytest.mark.fem
@pytest.mark.filterwarnings("ignore:the density of a Beam")
def test_a_beam_bends_at_its_shear_centre(tmp_path):
    """A mass on the node of a massless channel: no twist, and the moment of the axial force."""
    L, I, A, N, m = 1.0, 1e-6, 1e-3, 0.1, 5.0  # noqa: E741
    path = tmp_path / "channel.bdf"
    path.write_text(
        f"GRID,1,,0.,0.,0.\nGRID,2,,{L},0.,0.\nCBEAM,1,1,1,2,0.,1.,0.\nCONM2,3,2,,{m}\n"
        f"PBEAM,1,1,{A},{I},2.-6,,1.-8,,\n,,,,,,,,,\n,0.,0.,,,,,,,\n,,,,,{N}\n"
        f"MAT1,1,{E},,.3\nSPC1,1,123456,1\n"
    )
    with pytest.warns(ao.AntioscWarning, match="couples twist with sway"):
        part = ao.read_model(path)
    found = ao.natural_modes(part, 3).frequency
    flexibility = np.array([[L**3 / 3, N * L**2 / 2], [N * L**2 / 2, I * L / A + N**2 * L]])
    values = 1 / np.linalg.eigvalsh(m * flexibility / (E * I))
    wanted = np.sqrt(sorted([*values, 3 * E * 2e-6 / (m * L**3)])) / (2 * np.pi)
    np.testing.assert_allclose(found, wanted, rtol=1e-4)
