"""What is refused of models, laws, closed forms and signals, each with its reason."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import antiosc as ao
from antiosc import plotting
from antiosc.engine.contact import Tabulated
from antiosc.models.anti_oscillators import FORMAT_VERSION
from antiosc.models.closed_form import (
    StruckBeam,
    UniformBeam,
    cantilever,
    pinned_pinned,
)  # fmt: skip
from antiosc.models.free_modes import error_bound, from_free_modes, site_models as at_sites_of
from antiosc.models.modal import SiteModes
from antiosc.plot import charts
from refusals import refused
from struck_beams import ARTICLE, UNIT

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
BALL = ao.RigidMass(1.0, 1.0)
MODES = np.array([2.0, 3.0]), np.ones((1, 2)), [1.0], [0.5]


OMEGA, B = [0.0, 2e3], [1.0, 0.5]
INERTIA = ao.Inertia(np.zeros(3), np.eye(6), np.zeros((1, 6)))
SITES = SiteModes(
    OMEGA, [[1.0, 0.2], [0.5, -0.4]], ["a", "b"], shape=np.eye(2), basis=(np.eye(4)[:, :2],),
    r=np.diag([1e-8, 2e-8]), residual=np.diag([1e-8, 2e-8]),
)  # fmt: skip


class Foreign:
    """A body of others: a free mass, and what it says of itself."""

    def __init__(self, **said: object) -> None:
        vars(self).update(said)

    def modal(self) -> ao.ModalBody:
        return ao.ModalBody([0.0], [1.0])


def one(**changed: Any) -> ao.AntiOscillators:
    return ao.AntiOscillators(**{**ONE, **changed})


def two(**changed: Any) -> ao.AntiOscillators:
    return ao.AntiOscillators(**{**TWO, **changed})


def at_sites(columns: int = 2, names: tuple[str, ...] = ("a",), **more: Any) -> SiteModes:
    return SiteModes(OMEGA, np.ones((2, columns)), list(names), **more)


def free(**changed: Any) -> ao.AntiOscillators:
    return from_free_modes(**{"omega": [2.0, 3.0], "b": [1.0, 1.0], "compliance": 1.0, **changed})


def struck(body: Any) -> ao.History:
    return ao.simulate(MODEL, body, ao.Hertz(1e9), 1e-3)


def inertia(matrix: Any) -> ao.Inertia:
    return ao.Inertia(np.zeros(3), matrix, np.zeros((2, 6)))


#: What is refused -> a word of the sentence.
REFUSED: list[tuple[Callable[[], Any], str]] = [
    # parameters of one site
    (lambda: one(omega=[1.0, np.nan]), "finite"),
    (lambda: one(m0=-1.0), "m0 must"),
    (lambda: one(k0=-1.0), "k0"),
    (lambda: one(k0=np.inf), "k0"),
    (lambda: one(participation=[1.0]), "participation"),
    (lambda: one(shapes=np.zeros((4, 2))), "shapes"),
    (lambda: ao.AntiOscillators(m0=0.0, k0=0.0, m=[], omega=[]), "neither mass nor stiffness"),
    (lambda: one(inertia=INERTIA), "a row for each"),
    (lambda: one(hidden=np.zeros((4, 1))), "hidden"),
    (lambda: one(rigid=np.eye(1)), "several"),
    (lambda: one(strain_misfit=np.eye(3)), "missing"),
    (lambda: one(strain_error=np.eye(3), strain_misfit=np.eye(3, k=1)), "symmetric"),
    (lambda: one(strain_error=-np.eye(3)), "semidefinite"),
    (lambda: one(strain_error=np.triu(np.ones((3, 3)))), "strain_error"),
    (lambda: one(damping=0.1), "Damping"),
    (lambda: one(damping=ao.DampingMatrix(np.eye(2))), "3 coordinates"),
    (lambda: one(direction=(0, 0, 0)), "zero vector"),
    (lambda: MODEL.dynamic_stiffness([1.0, np.nan]), "omega"),
    (lambda: MODEL.field([1.0, 2.0, 3.0]), "no shapes"),
    (lambda: MODEL.corrected(), "estimate"),
    # of several sites
    (lambda: two(k0=[[1.0, 2.0], [2.0, 1.0]]), "k0 must be symmetric"),
    (lambda: two(m0=[[1.0, 0.1], [0.2, 1.0]]), "m0 must be symmetric"),
    (lambda: two(m0=np.eye(3)), "m0 must"),
    (lambda: two(k0=np.ones((2, 3))), "square"),
    (lambda: two(P=np.ones((1, 2))), "P must"),
    (lambda: two(P=None), "need P"),
    (lambda: two(m=[1.0]), "not as m"),
    (lambda: two(omega=[0.0]), "omega"),
    (lambda: two(sites=["a"]), "2 columns"),
    (lambda: two(sites=["a", "a"]), "name of its own"),
    (lambda: two(columns={"a": [0], "c": [1]}), "same sites"),
    (lambda: two(radius=[1e-3]), "radius"),
    (lambda: two(local_compliance=[-1.0, 0.0]), "local_compliance"),
    (lambda: two(m0=0 * np.eye(2), k0=0 * np.eye(2), P=[[1.0], [0.0]]), "stiffness or mass"),
    (lambda: two(strain_error=np.eye(1)), "strain_error"),
    (lambda: BOTH.modal(), "Scene"),
    (lambda: ao.simulate(BOTH, BALL, ao.Hertz(1e9), 1e-3), "Scene"),
    (lambda: ao.choose_n(BOTH, lambda model, tol: None), "sites a, b"),
    (lambda: ao.truncation_error(BOTH, lambda model, tol: None), "sites a, b"),
    (lambda: MODEL.site_modes(), "modal()"),
    # superelements
    (lambda: DEPENDENT.to_matrices(), "follow"),
    (lambda: BOTH.to_matrices(nodes=[1, 2**31]), "below 2^31"),
    (lambda: BOTH.to_matrices(nodes=[5, 5], dofs=3), "twice"),
    (lambda: MODEL.to_matrices().save("model.txt"), "model.txt"),
    # bodies in free modes
    (lambda: ao.ModalBody(OMEGA, B, decay=[0, -1]), "negative"),
    (lambda: ao.ModalBody([-1.0], [1.0]), "omega"),
    (lambda: ao.ModalBody(OMEGA, B, basis=(np.ones((2, 1)), np.ones((3, 1)))), "number"),
    (lambda: ao.ModalBody(OMEGA, B, inertia=INERTIA), "2 modes"),
    (lambda: ao.ModalBody([0.0], [1.0]).rigid_motion(ao.Motion((1, 0, 0))), "no known"),
    (lambda: at_sites(1, directions=[(0, 0, 0)]), "zero vector"),
    (lambda: at_sites(1, local_compliance={"b": 1.0}), "no site"),
    (lambda: at_sites(1, basis=(np.eye(3),)), "column"),
    (lambda: at_sites(1, ("a", "b")), "one to three"),
    (lambda: at_sites(2, ("a", "b"), r=[[1, 2], [2, 1]]), "semidefinite"),
    (lambda: struck(Foreign(velocity="fast")), "velocity of impactor"),
    (lambda: struck(Foreign(gap=-1e-3)), "gap of impactor"),
    (lambda: struck(Foreign(local_compliance=-1e-9)), "local_compliance of impactor"),
    # motion and damping
    (lambda: inertia(np.zeros((6, 6))), "mass > 0"),
    (lambda: inertia(-np.eye(6)), "diagonal"),
    (lambda: INERTIA.moved(np.ones(5), np.zeros(3)), "momenta"),
    (lambda: ao.Motion(spin=(0, 0, np.nan)), "spin"),
    (lambda: ao.DampingMatrix(np.eye(2), [([[0.0, 1.0], [1.0, 1.0]], 1.0)]), "semidefinite"),
    (lambda: ao.DampingMatrix(np.eye(1), [(np.eye(1), 0.0)]), "tau"),
    # free modes
    (lambda: free(compliance=1e-12), "static compliance of"),
    (lambda: free(omega=[3.0, 2.0]), "ascend"),
    (lambda: free(omega=[0.0, 2.0]), "rigid-body mode"),
    (lambda: free(b=[1.0]), "b must"),
    (lambda: free(n=0), "n must"),
    (lambda: error_bound(at_sites_of(*MODES), *MODES, 9.0), "last free mode"),
    (lambda: ao.impact_band(ao.Obstacle(), ao.Hertz(1e9)), "velocity > 0"),
    # closed forms and laws
    (lambda: Tabulated([0, 1], [0, 1], 3.0), "unloading"),
    (lambda: UniformBeam(1, 1, 1, kGA=0), "kGA"),
    (lambda: UniformBeam(1, 1, 1, kGA=-np.inf), "kGA"),  # rigid in shear is +inf alone
    (lambda: UniformBeam.timoshenko(**ARTICLE, nu=0.5), "nu"),
    (lambda: StruckBeam(UNIT, "hinged", "free", 1.0), "left"),
    (lambda: cantilever(UNIT, 1.2), "site"),
    (lambda: pinned_pinned(UNIT, 0.0), "support"),
    (lambda: cantilever(UNIT).anti_oscillators(0), "n"),
    # texts, charts, spectra and fields
    (lambda: charts.axes_or_new("top"), "matplotlib"),
    (lambda: charts.panels(1, 1, (0.1, 4.0)), "lengths"),
    (lambda: plotting.plot_force({}), "History"),
    (lambda: plotting.plot_force({"a": None}), "must be a History"),
    (lambda: plotting.plot_masses(ao.AntiOscillators), "AntiOscillators"),
    (lambda: plotting.plot_map(3.0), "ImpactMap"),
]  # fmt: skip


@pytest.mark.parametrize("case", range(len(REFUSED)), ids=lambda i: REFUSED[i][1])
def test_what_cannot_be_is_refused(case: int) -> None:
    call, word = REFUSED[case]
    with refused(None, word, ao.InputError):
        call()


def test_fields_of_a_body_with_several_sites() -> None:
    """u = basis (shape q + residual F): one time, many times."""
    rng = np.random.default_rng(2)
    q, F = rng.normal(size=(7, 2)), rng.normal(size=(7, 2))
    x = SITES.coordinates(q, F)
    np.testing.assert_allclose(x, q + F * [1e-8, 2e-8])
    np.testing.assert_allclose(SITES.coordinates(q[3], F[3]), x[3])
    np.testing.assert_allclose(SITES.field(x)[:, :2], x)
    assert SITES.field(x).shape == (7, 4)


HEADER = {"format": "antiosc-model", "version": FORMAT_VERSION}


@pytest.mark.parametrize(
    ("header", "word"),
    [({**HEADER, "format": "other"}, "other"), ({**HEADER, "version": 99}, "99"), (HEADER, "m0")],
)
def test_files_of_other_formats(tmp_path: Path, header: dict[str, Any], word: str) -> None:
    path = tmp_path / "model.npz"
    np.savez(path, header=np.array(json.dumps(header)), k0=np.array(1.0))
    for name in (path, tmp_path / "none.npz"):
        with refused(None, word if name == path else "no regular file", ao.InputError):
            ao.AntiOscillators.load(name)


def test_a_model_that_its_file_cannot_hold(tmp_path: Path) -> None:
    noted = ao.AntiOscillators(**ONE, info={"of": object()})
    with refused(None, "JSON", ao.InputError):
        noted.save(tmp_path / "model.npz")
    with refused(None, "write", ao.InputError):
        MODEL.save(tmp_path / "none" / "m.npz")
    assert not list(tmp_path.iterdir())
