"""Patches on meshes much finer than they are: nodal forces against integrals of the pressure."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
from antiosc.fem.platform import compat
from antiosc.fem.site.functionals import functional
from parts import STEEL, box, plate

pytestmark = pytest.mark.fem


def forces(part: ao.Structure, site: ao.Site, axis: str) -> tuple[np.ndarray, np.ndarray]:
    """(nodal forces along an axis, their nodes)."""
    dofs, x = compat.dof_coordinates(part.form.space, part.form.components[axis])
    return functional(part, site).b[dofs], x


def test_a_segment_with_many_elements():
    n, a = 200, 0.05
    mesh = plate((n, 1), (0.12, 0.01))
    part = ao.Structure(mesh, ao.Solid(**STEEL, plane="stress"), [ao.Support("left")], order=1)
    b, x = forces(part, ao.Site((0.06, 0.01), (0, 1), radius=a), "y")
    b, x = b[x[:, 1] > 0.009], x[x[:, 1] > 0.009]
    fine = np.linspace(-1, 1, 20_001)
    pressure = 2 / np.pi * np.sqrt(1 - fine**2)
    hats = np.maximum(0.0, 1 - np.abs(0.06 + a * fine - x[:, :1]) / (0.12 / n))
    exact = hats @ pressure * (fine[1] - fine[0])
    assert np.abs(b - exact).max() < 0.05 * exact.max()


def test_a_disc_with_many_elements():
    n, a = 26, 0.05
    part = ao.Structure(
        box((n, n, 1), (0.12, 0.12, 0.01)), ao.Solid(**STEEL), [ao.Support("left")], order=1
    )
    b, x = forces(part, ao.Site((0.06, 0.06, 0.01), (0, 0, 1), radius=a), "z")
    line = (np.arange(800) + 0.5) / 400 - 1
    X, Y = np.meshgrid(line, line)
    inside = X**2 + Y**2 < 1
    weight = np.where(inside, np.sqrt(np.maximum(1 - X**2 - Y**2, 0.0)), 0.0)
    weight /= weight.sum()
    top = x[:, 2] > 0.009
    distance = [np.abs(0.06 + a * line - x[top, k : k + 1]) for k in (0, 1)]
    along, across = (np.maximum(0.0, 1 - each * n / 0.12) for each in distance)
    exact = np.einsum("nx,yx,ny->n", along, weight, across, optimize=True)
    assert np.abs(b[top] - exact).max() < 0.05 * exact.max()
