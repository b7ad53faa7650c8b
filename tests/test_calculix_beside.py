"""CalculiX beside `tradeoff`: the same mesh, scheme and steps as the unreduced model."""

from __future__ import annotations

import shutil
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
from antiosc.strikes import calculix
from antiosc.strikes.unreduced import Blow, blow_of, newmark
from parts import STEEL, box

needs_ccx = pytest.mark.skipif(shutil.which("ccx") is None, reason="needs CalculiX's ccx")
pytestmark = [
    pytest.mark.fem,
    pytest.mark.filterwarnings("ignore::antiosc.base.errors.AccuracyWarning"),
]
TOP = ao.Site((0.15, 0.02, 0.04), (0.3, 0, -1), radius=0.01)
BALL = ao.RigidMass(0.5, 1.0)
HELD = [ao.Support("left")]
DURATION = 1e-4


def blow(law=None, order=2, cell="tetrahedron", ball=BALL, **more) -> Blow:
    """An impact on a block of two materials."""
    mesh = box((4, 2, 2), cell=cell, groups=HALVES)
    kinds = {"near": ao.Solid(**STEEL), "far": ao.Solid(70e9, 0.33, 2700.0)}
    part = ao.Structure(mesh, kinds, HELD, order=order)
    law = law or ao.Hertz(1e10)
    hit = ao.simulate(ao.extract(part, TOP, n=10), ball, law, DURATION, **more)
    return replace(blow_of(part, TOP, hit, DURATION), step=2e-6)


HALVES = {
    "left": (2, lambda x: np.isclose(x[0], 0)),
    "near": (3, lambda x: x[0] < 0.101),
    "far": (3, lambda x: x[0] > 0.099),
}


@needs_ccx
def test_the_force_is_that_of_the_unreduced_model():
    given = blow(gap=2e-6, gravity=300.0)
    own = newmark(given).curve
    found = calculix.run(given, 60.0)
    assert found.curve.time == pytest.approx(own.time, rel=1e-6)
    assert np.linalg.norm(found.curve.force - own.force) <= 3e-4 * np.linalg.norm(own.force)
    assert found.seconds > 0
    assert found.bytes > 1e6


@needs_ccx
@pytest.mark.slow
def test_it_is_ended_at_the_limit():
    with pytest.raises(ao.AntioscError, match=r"ended after 0\.01 s"):
        calculix.run(replace(blow(), step=2e-8), 0.01)


@needs_ccx
def test_its_error_is_told(monkeypatch):
    monkeypatch.setattr(calculix, "_mean", lambda *_: ["*EQUATION", "1", "7, none"])
    with pytest.raises(ao.AntioscError, match=r"\*ERROR reading \*EQUATION"):
        calculix.run(blow(), 60.0)


@pytest.mark.parametrize(
    ("reason", "given"),
    [
        ("tetrahedra", {"cell": "hexahedron"}),
        ("quadratic", {"order": 1}),
        ("has memory or damping", {"law": ao.Gonthier(1e9, 0.6)}),
        ("impactor vibrates", {"ball": "model"}),
    ],
)
def test_what_the_deck_does_not_describe_is_refused(reason, given, monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda _: "ccx")
    if given.get("ball") == "model":
        other = ao.Structure(box((4, 2, 2)), ao.Solid(**STEEL))
        given = {"ball": ao.Impactor(ao.extract(other, TOP, n=3), 1.0)}
    with pytest.raises(ao.InputError, match=reason):
        calculix.forecast(blow(**given))


def test_without_ccx_a_note_tells_it(monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda _: None)
    part = ao.Structure(box((4, 2, 2), cell="tetrahedron"), ao.Solid(**STEEL), HELD)
    found = ao.tradeoff(part, TOP, BALL, ao.Hertz(1e10), DURATION, tol=0.5, compare=60.0)
    assert [one.method for one in found.others] == ["unreduced"]
    assert found.notes[0] == "CalculiX: ccx is not on the PATH."


@pytest.mark.parametrize("swapped", [False, True])
def test_nodes_of_a_cell_stand_in_the_order_of_calculix(swapped):
    """Its nodes 5 to 10 lie between corners 1-2, 2-3, 3-1, 1-4, 2-4, 3-4; dolfinx sorts edges."""
    corners = np.vstack([np.zeros(3), np.eye(3)])
    if swapped:
        corners = corners[[0, 2, 1, 3]]
    edges = [(2, 3), (1, 3), (1, 2), (0, 3), (0, 2), (0, 1)]
    x = np.vstack([corners, *[corners[list(edge)].mean(axis=0)[None] for edge in edges]])
    (order,) = calculix._oriented(np.arange(10)[None], x)
    found = x[order]
    assert np.linalg.det(found[1:4] - found[0]) > 0
    between = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]
    assert np.array_equal(found[4:], [found[list(pair)].mean(axis=0) for pair in between])
