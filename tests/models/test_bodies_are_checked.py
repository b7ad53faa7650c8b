"""Refusals of models, motions and charts in one sentence; fields of a body of several sites."""

from __future__ import annotations

import json

import numpy as np
import pytest

import antiosc as ao
from antiosc import plotting
from antiosc.base.charts import figures
from antiosc.base.errors import InputError
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
    "damping": (lambda: ao.Damping(ratio=-0.1), "ratios"),
    "no damping": (lambda: ao.Damping(ratio=[]), "ratios"),
    "frequency": (lambda: ao.ModalBody([-1.0], [1.0]), "omega"),
    "decay": (lambda: ao.ModalBody(OMEGA, B, decay=[0, -1]), "negative"),
    "columns": (lambda: ao.ModalBody(OMEGA, B, basis=np.eye(2)), "arrays"),
    "vector": (lambda: ao.ModalBody(OMEGA, B, basis=(np.ones(2),)), "arrays"),
    "rows": (lambda: ao.ModalBody(OMEGA, B, basis=(np.ones((2, 1)), np.ones((3, 1)))), "number"),
    "momenta of modes": (lambda: ao.ModalBody(OMEGA, B, inertia=INERTIA), "row"),
    "coordinates": (lambda: BODY.field(np.ones(3)), "coordinates"),
    "one coordinate": (lambda: BODY.amplitudes(1.0), "coordinates"),
    "momenta": (lambda: INERTIA.moved(np.ones(5), np.zeros(3)), "momenta"),
    "frequency of sites": (lambda: ao.SiteModes([-1.0], [[1.0]], ["a"]), "omega"),
    "compliance": (
        lambda: ao.SiteModes(OMEGA, np.ones((2, 2)), ["a", "b"], r=[[1, 2], [2, 1]]), "definite"),
    "skew compliance": (
        lambda: ao.SiteModes(OMEGA, np.ones((2, 2)), ["a", "b"], r=[[1, 0.1], [0, 1]]),
        "symmetric"),
    "decay of sites": (lambda: ao.SiteModes(OMEGA, np.ones((2, 1)), ["a"], decay=[0, -1]), "decay"),
    "momenta of sites": (
        lambda: ao.SiteModes(OMEGA, np.ones((2, 1)), ["a"], inertia=INERTIA), "modes"),
    "shapes": (lambda: ao.SiteModes(OMEGA, np.ones((2, 1)), ["a"], basis=(np.eye(3),)), "column"),
    "unknown patch": (
        lambda: ao.SiteModes(OMEGA, np.ones((2, 1)), ["a"], local_compliance={"b": 1e-9}),
        "local_compliance"),
    "q of sites": (lambda: SITES.coordinates(np.ones(3), np.ones(2)), "shape"),
    "forces of sites": (lambda: SITES.coordinates(np.ones(2), np.ones(3)), "shape"),
    "field of sites": (lambda: SITES.field(np.ones(3)), "coordinates"),
    "not axes": (lambda: figures.axes_or_new("top"), "matplotlib"),
    "no hits": (lambda: plotting.plot_force({}), "History"),
    "not a hit": (lambda: plotting.plot_force(3.0), "float"),
    "not a named hit": (lambda: plotting.plot_force({"a": None}), "named"),
    "a class": (lambda: plotting.plot_masses(ao.AntiOscillators), "AntiOscillators"),
    "small": (lambda: figures.panels(1, 1, (0.1, 4.0)), "lengths"),
    "large": (lambda: figures.panels(1, 1, (4.0, 101.0)), "lengths"),
}  # fmt: skip


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
