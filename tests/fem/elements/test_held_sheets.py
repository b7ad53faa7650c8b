"""Sheets that are struck beyond linear theory: which are told, and how much they stretch."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
import parts

pytestmark = pytest.mark.fem

SIZE = (0.5, 0.3)
RIM = {
    "rim": (1, lambda x: np.isclose(abs(x[0] - 0.25), 0.25) | np.isclose(abs(x[1] - 0.15), 0.15)),
    "left": (1, lambda x: np.isclose(x[0], 0.0)),
}


def model_of(thickness, *held, laminate=False):
    mesh = parts.plate((10, 6), SIZE, groups=RIM)
    mesh = ao.read_mesh(mesh.dolfinx) if not held else mesh
    sheet = ao.Shell(E=70e9, nu=0.33, rho=2700.0, thickness=thickness)
    if laminate:
        layer = ao.Layer.isotropic(70e9, 0.33, 2700.0, thickness / 2)
        sheet = ao.Laminate([layer, layer])
    plate = ao.Structure(mesh, sheet, [ao.Support(where) for where in held])
    return ao.extract(plate, ao.Site((0.25, 0.15, 0.0), (0, 0, -1)), n=10)


def struck(model):
    return ao.simulate(model, ao.RigidMass(0.2, 5.0), ao.Linear(1e6), 0.02)


@pytest.mark.parametrize("laminate", [False, True])
def test_a_clamped_thin_plate_is_told_of(laminate):
    model = model_of(1.5e-3, "rim", laminate=laminate)
    assert model.info.thickness == pytest.approx(1.5e-3)
    with pytest.warns(ao.AccuracyWarning, match=r"thickness 1\.5 mm of its sheet.*nonlinear"):
        hit = struck(model)
    times = abs(hit.displacement).max() / 1.5e-3
    assert 5 < times < 9
    assert f"{times:.2g}" in hit.message


def test_a_stiff_plate_a_cantilever_and_a_free_plate_are_not():
    assert "deflects" not in struck(model_of(20e-3, "rim")).message
    cantilever = model_of(1.5e-3, "left")
    assert cantilever.info.thickness is None
    hit = struck(cantilever)
    assert abs(hit.displacement).max() > 5 * 1.5e-3
    assert "deflects" not in hit.message
    assert "deflects" not in struck(model_of(1.5e-3)).message
