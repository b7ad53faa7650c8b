"""The errors of the strains of shells: energies, fields without errors, torsion, nested meshes."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.impact.histories.bars import QUANTITIES, relative_differences
from sheets import (
    NU,
    RHO,
    SHEET,
    E,
    at,
    edges,
    plate,
    rectangle,
    sheet,
    stack,
)

pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore:the supports leave:antiosc.base.errors.AntioscWarning"),
]

CLAMPED = [ao.Support(edges(0, 1))]


def fold(s, t):
    """Two squares at a right angle."""
    return np.minimum(2 * s, 1.0), t, np.maximum(2 * s - 1, 0.0)


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
    off = relative_differences(hit, exact)
    for quantity in QUANTITIES:
        assert off[quantity] < hit.error_budget[quantity].mesh + 1e-6
        assert hit.error_budget[quantity].mesh < 30 * max(off.values())


@pytest.fixture(scope="module")
def model() -> ao.AntiOscillators:
    site = ao.Site((0.4, 0.3, 0), (0, 0, -1), radius=0.1)
    return ao.extract(plate(3, 0.03), site, n=6, error="estimate")
