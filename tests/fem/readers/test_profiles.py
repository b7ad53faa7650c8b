"""Cross-sections of both kinds of decks against integrals over their areas."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from antiosc.base.errors import MeshError
from antiosc.io.deck import Place
from antiosc_decks import (
    abaqus_sections as abaqus_profiles,
    nastran_beams as nastran_profiles,
    properties as profiles,
)
from antiosc_decks.abaqus_cards import Card
from antiosc_decks.nastran_cards import Entry

PLACE = Place(Path("a deck"), 1)


def nastran(name: str, kind: str, *dimensions: float) -> profiles.Profile:
    """A cross-section of PBARL or PBEAML; its height lies along the plane 1 of Nastran."""
    fields = ["1", "1", "", kind, "", "", "", "", *map(str, dimensions)]
    return beam(name, fields).profile


def beam(name: str, fields: list[str], s: float = 0.0) -> nastran_profiles.BeamProfile:
    return nastran_profiles.BeamProfiles(Entry(name, PLACE, fields)).at(s)


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


def test_constants_of_the_general_sections():
    """PBAR: A, I1 (plane 1), I2, J; *BEAM GENERAL SECTION: A, I11, I12, I22, J about 1 and 2."""
    one = beam("PBAR", ["1", "1", "6.", "4.5", "2.", "4.7", "0.3"])
    bar = one.profile
    assert (bar.A, bar.I, bar.I_side, bar.J, one.extra, one.sheared) == (6, 4.5, 2, 4.7, 0.3, False)
    general = abaqus("GENERAL", 6.0, 2.0, 0.0, 4.5, 4.7)
    assert (general.A, general.I, general.I_side, general.J) == (6, 4.5, 2, 4.7)
    fields = ["1", "1", "6.", "4.5", "2.", "4.7", "0.3", *10 * [""]]
    fields[16:] = [".8", ".6"]
    one = beam("PBAR", fields)
    assert one.sheared
    assert one.profile.shear == pytest.approx(0.7)


def test_unequal_walls_are_refused():
    for walls in ((0.4, 0.2, 0.3, 0.2), (0.4, 0.2, 0.4, 0.3)):
        with pytest.raises(MeshError, match="unequal opposite walls"):
            abaqus("BOX", 3.0, 2.0, *walls)


@pytest.mark.parametrize("name", ["PBAR", "PBEAM"])
def test_a_torsion_constant_that_is_missing_is_told(name):
    """(I1 + I2)/2 stands for it."""
    for J in (0.0, 0.7):
        where = {"PBAR": ["1", "1", "6.", "5.", "2.", f"{J}"],
                 "PBEAM": ["1", "1", "6.", "5.", "2.", "", f"{J}", ""]}  # fmt: skip
        profiles_ = nastran_profiles.BeamProfiles(Entry(name, PLACE, where[name]))
        profile = profiles_.at(0.0).profile
        assert pytest.approx(J or 3.5) == profile.J
        assert any("missing torsion constant J" in one for one in profiles_.told) == (not J)


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


def test_sections_between_the_ends_are_linear():
    """PBEAM with two stations; blank values at the end are those of the start."""
    fields = ["1", "1", "6.", "4.", "2.", "", "1.", "", *8 * [""]]
    fields += ["NO", "1.", "3.", "2.", "", "", "", "", "NO", ".5", "", "4.", "", "", "", "", ".8"]
    at = [beam("PBEAM", fields, s).profile for s in (0.25, 0.75)]
    assert [one.A for one in at] == pytest.approx([5.25, 3.75])
    assert [one.I for one in at] == pytest.approx([4.0, 3.0])
    assert [one.I_side for one in at] == pytest.approx([2.0, 2.0])
    tapered = ["1", "1", "", "ROD", "", "", "", "", ".2", "", "YES", "1.", ".1"]
    assert pytest.approx(np.pi * 0.01) == beam("PBEAML", tapered, 1.0).profile.A


def test_a_tube_with_a_wall_of_its_radius_is_a_bar():
    """Nothing is hollow; a thicker wall is no more than that."""
    full = profiles.ellipse(4.0, 4.0)
    for wall in (2.0, 3.0):
        found = profiles.tube(2.0, wall)
        assert pytest.approx(4 * np.pi, rel=1e-12) == found.A
        assert (found.I, found.I_side) == pytest.approx((4 * np.pi, 4 * np.pi), rel=1e-12)
        assert pytest.approx(found.A) == full.A
