"""Cells at a site that are large against the waves of the contact are told, without error=."""

from __future__ import annotations

import re
import warnings

import numpy as np
import pytest

import antiosc as ao
import parts

ALUMINIUM = {"E": 70e9, "nu": 0.3, "rho": 2700.0}
LAW = ao.Linear(1e7)  # with 10 g a contact of 0.1 ms


def struck(family, size):
    if family == "shell":
        mesh, material = ao.box_mesh((0.3, 0.3), size=size), ao.Shell(**ALUMINIUM, thickness=1e-3)
        site = ao.Site((0.15, 0.15, 0.0), (0, 0, -1), radius=2e-3)
    elif family == "plate in its plane":  # a mesh of two coordinates
        n = round(0.3 / size)
        mesh, material = parts.plate((n, n), (0.3, 0.3)), ao.Shell(**ALUMINIUM, thickness=1e-3)
        site = ao.Site((0.15, 0.15, 0.0), (0, 0, -1), radius=2e-3)
    elif family == "beam":
        mesh = ao.box_mesh((1.0,), size=size)
        material = ao.Beam(**ALUMINIUM, section=ao.Section.rectangle(0.01, 0.01))
        site = ao.Site((0.4, 0.0, 0.0), (0, 0, -1))
    else:
        n = round(0.2 / size)
        mesh, material = parts.box((n, n, 1), (0.2, 0.2, 0.01)), ao.Solid(**ALUMINIUM)
        site = ao.Site((0.1, 0.1, 0.01), (0, 0, -1), radius=0.02)
    ends = ("-x", "+x") if family in ("shell", "beam") else ("left", "right")
    part = ao.Structure(mesh, material, [ao.Support(end) for end in ends])
    return ao.extract(part, site, n=20), part, site


def sentences(run):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        run()
    return [str(one.message) for one in caught if "measures" in str(one.message)]


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    ("family", "coarse", "fine", "thickness"),
    [
        ("shell", 0.06, 0.018, 1e-3),
        ("plate in its plane", 0.06, 0.012, 1e-3),
        ("beam", 0.2, 0.03, 0.01),
        ("solid", 0.1, 0.03, 0.01),
    ],
)
@pytest.mark.slow
def test_a_cell_larger_than_half_a_wave_is_told(family, coarse, fine, thickness):
    ball = ao.RigidMass(0.01, velocity=1.0)
    model = struck(family, coarse)[0]
    (said,) = sentences(lambda: ao.simulate(model, ball, LAW, 3e-4))
    time, wave = re.search(r"contact of ([\d.]+) µs sends out ([\d.]+) mm", said).groups()
    bending = thickness * np.sqrt(ALUMINIUM["E"] / ALUMINIUM["rho"] / 12)
    exact = 2e3 * np.pi * np.sqrt(bending * float(time) * 1e-6 / np.pi)
    assert float(wave) == pytest.approx(exact, rel=0.01)
    assert not sentences(lambda: ao.simulate(struck(family, fine)[0], ball, LAW, 3e-4))
