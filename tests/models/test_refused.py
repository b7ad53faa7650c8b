"""What is refused of models, laws, closed forms and signals, each with its reason."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import antiosc as ao
from antiosc import plotting
from antiosc.base import checks
from antiosc.closed_form import SupportedLaminate, SupportedPlate, zener
from antiosc.contact import Tabulated
from antiosc.models.reduced_matrices import ReducedMatrices
from antiosc.models.resolved import resolved_frequency
from antiosc.models.site_modes import SiteModes
from antiosc.results.saved_fields import FACES, SavedFields

ONE = {"m0": 0.1, "k0": 1e5, "m": [0.2, 0.3], "omega": [900.0, 2e3]}
MODEL = ao.AntiOscillators(**ONE)
TWO = {
    "m0": np.eye(2), "k0": 1e5 * np.eye(2), "P": [[0.4], [0.7]], "omega": [500.0],
    "sites": ["a", "b"],
}  # fmt: skip
BOTH = ao.AntiOscillators(**TWO)
DEPENDENT = ao.AntiOscillators(
    **{**TWO, "sites": ["a", "b", "c"], "dependence": [[1, 0], [0, 1], [0.5, 0.5]]}
)
STIFF = {"A": np.eye(3), "B": np.zeros((3, 3)), "D": np.eye(3), "S": np.eye(2)}
PINNED = ao.Inertia(np.zeros(3), np.eye(6), np.array([[0, 0, 0, 0, 0, 1.0]]))
FIELDS: dict[str, Any] = {
    "points": np.zeros((3, 3)),
    "cells": [("triangle", np.array([[0, 1, 2]]))],
    "shapes": np.zeros((3, 3, 2)),
    "time": np.array([0.0, 1.0]),
    "factors": np.zeros((2, 2)),
}


def laminate(**changed: Any) -> SupportedLaminate:
    return SupportedLaminate(**{"inertia": (1, 0, 0), **STIFF, **changed}, a=1.0, b=1.0)


def fields(**changed: Any) -> SavedFields:
    return SavedFields(**{**FIELDS, **changed})


REFUSED: list[tuple[Callable[[], Any], str]] = [
    (lambda: MODEL.dynamic_stiffness([1.0, np.nan]), "omega must be finite and at most"),
    (lambda: checks.coordinates("point", [1.0]), "point must be 2 or 3 numbers"),
    (lambda: checks.text("a name", ""), "a name must be a name in quotes"),
    (lambda: checks.text("a name", 3), "a name must be a name in quotes; got 3"),
    (lambda: laminate(D=-np.eye(3)), "D must be positive definite; no entry"),
    (lambda: laminate(inertia=(0, 0, 0)), "a mass per area > 0; got 0"),
    (lambda: SupportedPlate(E=2e11, nu=0.3, rho=7800.0, thickness=1e-3, a=0.3, b=0.2)
     .receptance(0.1, 0.1, 0.0), "omega2 must be one number, not 0"),
    (lambda: zener.restitution(1e9), "lam must be at most"),
    (lambda: Tabulated([0, 1], [0, 1], 3.0), r"unloading must be a pair \(indentation, force\)"),
    (lambda: ao.AntiOscillators(**TWO, strain_error=np.eye(3)), "strain_error belongs to a model"),
    (lambda: ao.AntiOscillators(**TWO, strain_misfit=np.eye(3)), "strain_misfit belongs to a mod"),
    (lambda: ao.AntiOscillators(**ONE, rigid=np.eye(1)), "rigid belongs to a model of several"),
    (lambda: ao.AntiOscillators(**ONE, dependence=np.eye(1)), "dependence belongs to a model of"),
    (lambda: ao.AntiOscillators(**ONE, strain_misfit=np.eye(3)), "which is missing"),
    (lambda: ao.AntiOscillators(**ONE, strain_error=np.eye(3), strain_misfit=np.eye(3, k=1)),
     "strain_misfit must be symmetric"),
    (lambda: ao.AntiOscillators(**ONE, strain_error=-np.eye(3)), "positive semidefinite"),
    (lambda: ao.AntiOscillators(**ONE, damping=0.1), "damping must be a Damping"),
    (lambda: ao.AntiOscillators(**ONE, direction=(0, 0, 0)), "must not be the zero vector"),
    (lambda: MODEL.field([1.0, 2.0]), r"must have 3 entries along their last axis, or 3"),
    (lambda: BOTH.modal(), "has the sites a, b: pose its impact as a Scene"),
    (lambda: DEPENDENT.to_matrices(), "some sites follow from others"),
    (lambda: BOTH.to_matrices(nodes=[1]), "must name the 2 site dofs; got 1 nodes and 2 dofs"),
    (lambda: BOTH.to_matrices(dofs=[1, 2, 3]), "got 2 nodes and 3 dofs"),
    (lambda: BOTH.to_matrices(nodes=[1, 2**31]), r"numbers of nodes must be below 2\^31"),
    (lambda: BOTH.to_matrices(nodes=[5, 9], first=9), "the scalar points from first = 9 on meet"),
    (lambda: BOTH.to_matrices(nodes=[5, 5], dofs=3), "nodes and dofs name one dof twice"),
    (lambda: ReducedMatrices(np.eye(1), np.eye(1), np.array([[1.5, 0]])), "labels must be numbers"),
    (lambda: ReducedMatrices(np.eye(1), np.eye(1), np.array([[-1, 0]])), "labels must be numbers"),
    (lambda: ReducedMatrices(np.eye(1), np.eye(1), np.array([[2**31, 0]])), "labels must be numb"),
    (lambda: ReducedMatrices(np.eye(2, k=1), np.eye(2), np.ones((2, 2))), "K must be symmetric"),
    (lambda: ReducedMatrices(np.eye(2), np.eye(2, k=1), np.ones((2, 2))), "M must be symmetric"),
    (lambda: MODEL.to_matrices().save("model.txt"), "matrices are written"),
    (lambda: ao.ModalBody([0.0], [1.0], inertia=PINNED).rigid_motion(ao.Motion((1, 0, 0))),
     "the supports restrain the body: the share 1"),
    (lambda: SiteModes([1.0], [[1.0]], ["a"]).field([1.0]), "no displacement field"),
    (lambda: SiteModes([1.0], [[1.0]], ["a"], basis=(np.ones((2, 1)),)).field([1.0, 2.0]),
     r"coordinates must have shape \(..., 1\)"),
    (lambda: SiteModes([1.0], [[1.0]], ["a"], directions=[(0, 0, 0)]), "not be a zero vector"),
    (lambda: SiteModes([1.0], [[1.0]], ["a"], local_compliance={"b": 1.0}), "no site"),
    (lambda: SiteModes([-1.0], [[1.0]], ["a"]), "omega must be >= 0"),
    (lambda: SiteModes([1.0], [[1.0]], ["a"], r=[[-1.0]]), "positive semidefinite"),
    (lambda: SiteModes([1.0], [[1.0]], ["a"], decay=[-1.0]), "decay must be >= 0"),
    (lambda: SiteModes([1.0], [[1.0]], ["a"], basis=(np.ones((2, 2)),)), "one column for each"),
    (lambda: SiteModes([1.0], [[1.0]], ["a", "b"]), "one to three of the 1 columns"),
    (lambda: resolved_frequency(MODEL), "which frequencies a model resolves"),
    (lambda: ao.Damping(ratio=[-0.1]), "damping ratios must be >= 0"),
    (lambda: ao.Damping(ratio=[]), "damping ratios must be >= 0"),
    (lambda: plotting.plot_map(3.0), "found must be an ImpactMap"),
    (lambda: ao.spectrum([0, 1.0], [0, 1.0]).band(1.0), "share must be below 1; got 1"),
    (lambda: ao.spectrum([0, 1.0], [0, 1.0], pad=0.5), "pad must be 1 or more; got 0.5"),
    (lambda: ao.srs([0, 1.0], [0, 1.0], Q=0.5), "Q must be above 0.5"),
    (lambda: ao.srs([0, 1.0], [0, 1.0], [0.0]), "frequencies must be > 0"),
    (lambda: ao.srs([1.0, 0], [0, 1.0]), "t must ascend"),
    (lambda: ao.srs([1.0, 1.0], [0, 1.0]), "needs two samples or more; got 1"),
    (lambda: fields(shapes=np.zeros((2, 3, 2))), "fields need points"),
    (lambda: fields(factors=np.zeros((2, 3))), "fields need points"),
    (lambda: fields(time=np.array([0.0, 0.0])), "fields need points"),
    (lambda: fields(points=np.zeros((3, 2))), "fields need points"),
    (lambda: fields(cells=[("triangle", np.array([[0, 1, 3]]))]), "fields need points"),
    (lambda: fields(cells=[("triangle", np.array([[0, 1, -1]]))]), "fields need points"),
    (lambda: fields(time=np.zeros(0), factors=np.zeros((0, 2))), "fields need points"),
    (lambda: fields().at(1.5), "known from 0 s to 1 s; got time=1.5"),
    (lambda: fields().at(-0.5), "known from 0 s to 1 s; got time=-0.5"),
]  # fmt: skip


@pytest.mark.parametrize(("call", "words"), REFUSED, ids=[words for _, words in REFUSED])
def test_what_cannot_be_is_refused(call: Callable[[], Any], words: str) -> None:
    with pytest.raises(ao.InputError, match=words):
        call()


def test_a_model_tells_up_to_which_antiresonance_it_has_converged() -> None:
    """In Hz: the last of so many that have, of those that there are; inf of the full model."""
    for facts, expected in (
        ({"converged": 1}, 900.0 / (2 * np.pi)),
        ({"converged": 2}, 2e3 / (2 * np.pi)),
        ({"converged": 9}, 2e3 / (2 * np.pi)),
        ({"converged": 0}, 0.0),
        ({"converged": 0, "method": "full"}, np.inf),
    ):
        model = ao.AntiOscillators(**ONE, info=facts)
        assert resolved_frequency(model) == pytest.approx(expected)
        hit = ao.simulate(model, ao.RigidMass(1.0, 1.0), ao.Linear(1e5), 1e-4)
        assert resolved_frequency(hit) == pytest.approx(expected)


def test_fields_are_linear_between_their_times() -> None:
    rng = np.random.default_rng(1)
    shapes, time = rng.normal(size=(4, 3, 2)), np.array([0.0, 0.5, 2.0])
    factors = rng.normal(size=(3, 2))
    cells = [("tetra", np.array([[0, 1, 2, 3]])), ("line3", np.array([[0, 1, 2]]))]
    found = fields(points=rng.normal(size=(4, 3)), cells=cells, shapes=shapes, time=time,
                   factors=factors)  # fmt: skip
    for t in (0.0, 0.2, 0.5, 1.0, 2.0):
        own = [np.interp(t, time, column) for column in factors.T]
        np.testing.assert_allclose(found.at(t), shapes @ own, rtol=1e-12)
    norms = [np.linalg.norm(shapes @ f, axis=1).max() for f in factors]
    assert found.largest == pytest.approx(max(norms))
    assert sorted(map(sorted, found.faces.tolist())) == [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]
    one = fields(time=np.zeros(1), factors=np.ones((1, 2)), shapes=np.ones((3, 3, 2)))
    np.testing.assert_array_equal(one.at(0.0), np.full((3, 3), 2.0))


CORNERS = {
    "tetra": [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)],
    "pyramid": [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1)],
    "wedge": [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)],
    "hexahedron": [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))],
}
VOLUMES = {"tetra": 1 / 6, "pyramid": 1 / 3, "wedge": 1 / 2, "hexahedron": 1.0}


@pytest.mark.parametrize("kind", FACES)
def test_the_faces_of_a_cell_enclose_it(kind: str) -> None:
    """Each edge is passed twice, in opposite ways; the volume follows from the faces."""
    faces = FACES[kind]
    if kind not in CORNERS:  # a face itself
        (face,) = faces
        assert face == list(range(len(face)))
        return
    edges = [(a, b) for face in faces for a, b in zip(face, [*face[1:], face[0]], strict=True)]
    assert len(set(edges)) == len(edges)
    assert {(b, a) for a, b in edges} == set(edges)
    x = np.array(CORNERS[kind], dtype=float)
    volume = 0.0
    for face in faces:
        for k in range(1, len(face) - 1):
            a, b, c = x[[face[0], face[k], face[k + 1]]]
            volume += a @ np.cross(b, c) / 6
    assert volume == pytest.approx(VOLUMES[kind])
