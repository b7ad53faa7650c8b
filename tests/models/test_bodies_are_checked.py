"""Refusals of models, motions and charts in one sentence; fields of a body of several sites."""

from __future__ import annotations

import json

import numpy as np
import pytest

import antiosc as ao
from antiosc import plotting
from antiosc.charts import figures
from antiosc.errors import InputError
from antiosc.models import model_file

OMEGA, B = [0.0, 2e3], [1.0, 0.5]
MODEL = ao.AntiOscillators(m0=0.1, k0=1e6, m=[0.3], omega=[2e3])
INERTIA = ao.Inertia([0, 0, 0], np.eye(6), np.zeros((1, 6)))
BODY = ao.ModalBody(OMEGA, B, basis=(np.eye(3)[:, :1], np.eye(3)[:, 1:2]))
SITES = ao.SiteModes(
    OMEGA, [[1.0, 0.2], [0.5, -0.4]], ["a", "b"], shape=np.eye(2), basis=(np.eye(4)[:, :2],),
    r=np.diag([1e-8, 2e-8]), residual=np.diag([1e-8, 2e-8]),
)  # fmt: skip

CASES = {
    "damping": (lambda: ao.Damping(ratio=-0.1), "damping ratios must be >= 0"),
    "no damping": (lambda: ao.Damping(ratio=[]), "damping ratios must be >= 0"),
    "frequency": (lambda: ao.ModalBody([-1.0], [1.0]), "omega must be >= 0; its least"),
    "decay": (lambda: ao.ModalBody(OMEGA, B, decay=[0, -1]), "negative damping adds energy"),
    "columns": (lambda: ao.ModalBody(OMEGA, B, basis=np.eye(2)), "basis must list arrays"),
    "vector": (lambda: ao.ModalBody(OMEGA, B, basis=(np.ones(2),)), "basis must list arrays"),
    "rows": (
        lambda: ao.ModalBody(OMEGA, B, basis=(np.ones((2, 1)), np.ones((3, 1)))),
        "with one number of rows",
    ),
    "momenta of modes": (lambda: ao.ModalBody(OMEGA, B, inertia=INERTIA), "one row for each of 2"),
    "coordinates": (lambda: BODY.field(np.ones(3)), r"coordinates must have shape \(..., 2\)"),
    "one coordinate": (lambda: BODY.amplitudes(1.0), "coordinates must have shape"),
    "momenta": (lambda: INERTIA.moved(np.ones(5), np.zeros(3)), r"momenta must have shape \(...,"),
    "frequency of sites": (lambda: ao.SiteModes([-1.0], [[1.0]], ["a"]), "omega must be >= 0"),
    "compliance": (
        lambda: ao.SiteModes(OMEGA, np.ones((2, 2)), ["a", "b"], r=[[1, 2], [2, 1]]),
        "r must be symmetric and positive semidefinite",
    ),
    "skew compliance": (
        lambda: ao.SiteModes(OMEGA, np.ones((2, 2)), ["a", "b"], r=[[1, 0.1], [0, 1]]),
        "r must be symmetric and positive semidefinite",
    ),
    "decay of sites": (
        lambda: ao.SiteModes(OMEGA, np.ones((2, 1)), ["a"], decay=[0, -1]),
        "decay must be >= 0",
    ),
    "momenta of sites": (
        lambda: ao.SiteModes(OMEGA, np.ones((2, 1)), ["a"], inertia=INERTIA),
        "one row for each of the 2 modes",
    ),
    "shapes": (
        lambda: ao.SiteModes(OMEGA, np.ones((2, 1)), ["a"], basis=(np.eye(3),)),
        "one column for each of the 2 coordinates",
    ),
    "unknown patch": (
        lambda: ao.SiteModes(OMEGA, np.ones((2, 1)), ["a"], local_compliance={"b": 1e-9}),
        "local_compliance names .*b",
    ),
    "q of sites": (lambda: SITES.coordinates(np.ones(3), np.ones(2)), "q must have shape"),
    "forces of sites": (lambda: SITES.coordinates(np.ones(2), np.ones(3)), "q must have shape"),
    "field of sites": (lambda: SITES.field(np.ones(3)), "coordinates must have shape"),
    "not axes": (lambda: figures.axes_or_new("top"), "ax must be matplotlib axes"),
    "no hits": (lambda: plotting.plot_force({}), "give at least one History"),
    "not a hit": (
        lambda: plotting.plot_force(3.0),
        "must be a History; got float",
    ),
    "not a named hit": (
        lambda: plotting.plot_force({"a": None}),
        "the History named 'a' must be a History; got None",
    ),
    "a class": (lambda: plotting.plot_masses(ao.AntiOscillators), "must be AntiOscillators"),
    "small": (lambda: figures.panels(1, 1, (0.1, 4.0)), "two lengths from 0.5 to 100 inches"),
    "large": (lambda: figures.panels(1, 1, (4.0, 101.0)), "two lengths from 0.5 to 100 inches"),
}


@pytest.mark.parametrize("case", CASES)
def test_refusals(case):
    call, message = CASES[case]
    with pytest.raises(InputError, match=message) as caught:
        call()
    assert "\n" not in str(caught.value)


def test_fields_of_a_body_with_several_sites():
    """u = basis (shape q + residual F): one time, many times."""
    rng = np.random.default_rng(2)
    q, F = rng.normal(size=(7, 2)), rng.normal(size=(7, 2))
    x = SITES.coordinates(q, F)
    np.testing.assert_allclose(x, q + F * [1e-8, 2e-8])
    np.testing.assert_allclose(SITES.coordinates(q[3], F[3]), x[3])
    np.testing.assert_allclose(SITES.field(x)[:, :2], x)
    assert SITES.field(x).shape == (7, 4)


HEADER = {"format": "antiosc-model", "version": 1}


@pytest.mark.parametrize(
    ("header", "message"),
    [
        ({**HEADER, "format": "other"}, "has format 'other', expected 'antiosc-model'"),
        ({**HEADER, "version": 99}, r"has version 99; this antiosc reads up to \d+"),
    ],
)
def test_files_of_other_formats(tmp_path, header, message):
    path = tmp_path / "model.npz"
    np.savez(path, header=np.array(json.dumps(header)), k0=np.array(1.0))
    with pytest.raises(InputError, match=message):
        model_file.read(path, {"k0"})


def test_a_file_that_lacks_a_number(tmp_path):
    path = tmp_path / "model.npz"
    np.savez(path, header=np.array(json.dumps(HEADER)), k0=np.array(1.0))
    with pytest.raises(InputError, match="lacks m0"):
        model_file.read(path, {"k0", "m0"})


def test_notes_of_a_model_must_fit_its_file(tmp_path):
    noted = ao.AntiOscillators(m0=0.1, k0=1e6, m=[0.3], omega=[2e3], info={"of": object()})
    with pytest.raises(InputError, match=r"model\.info must hold JSON values"):
        noted.save(tmp_path / "model.npz")
    assert not list(tmp_path.iterdir())
