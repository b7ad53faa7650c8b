"""Pictures of deformed parts: the skin, the arrow and the view."""

from __future__ import annotations

import dolfinx
import numpy as np
import pytest
from mpi4py import MPI

import antiosc as ao
import parts
from antiosc.results import fields


@pytest.fixture(scope="module")
def hit():
    plane = ao.Solid(**parts.STEEL, plane="stress", thickness=0.01)
    sheet = parts.plate((6, 3), (0.2, 0.06), "quadrilateral")
    structure = ao.Structure(sheet, plane, [ao.Support("left")])
    model = ao.extract(structure, ao.Site((0.13, 0.06), (0.2, -1), radius=0.035), n=4)
    return structure, ao.simulate(model, ao.RigidMass(0.1, 1.0), ao.Hertz(1e9), 1e-3)


def test_the_skin_is_the_surface_and_moves_with_the_part():
    """Its area is that of a block of 200 × 50 × 40 mm, and each of its points moves as probed."""
    from antiosc.results.fields import skin

    block = ao.Structure(parts.box((8, 2, 2)), ao.Solid(**parts.STEEL), [ao.Support("left")])
    model = ao.extract(block, ao.Site((0.1, 0.025, 0.04), (0, 0, -1), radius=0.025), n=4)
    hit = ao.simulate(model, ao.RigidMass(0.1, 1.0), ao.Linear(1e7), 3e-4)
    points, faces, moved = skin(block, hit, 2e-4)
    assert faces.shape == (2 * (8 * 2 + 8 * 2 + 2 * 2), 4)
    a, b, c, d = points[faces].transpose(1, 0, 2)
    across = np.cross(c - a, d - b)
    area = np.linalg.norm(across, axis=1).sum() / 2
    assert area == pytest.approx(2 * (0.2 * 0.05 + 0.2 * 0.04 + 0.05 * 0.04), rel=1e-12)
    for i in (int(faces.max()), int(faces[7, 2])):
        probed = ao.probe(block, hit, points[i], [2e-4])[0]
        np.testing.assert_allclose(moved[i], probed, atol=1e-9 * np.abs(moved).max())


def test_the_picture_of_a_moved_sheet(hit, tmp_path):
    pytest.importorskip("matplotlib")
    from antiosc.plotting import plot_deformed

    structure, history = hit
    path = plot_deformed(
        structure, history, tmp_path / "sheet.png", point=(0.13, 0.06, 0), direction=(0.2, -1, 0)
    )
    assert path.stat().st_size > 3000
    with pytest.raises(ao.InputError, match="point"):
        plot_deformed(structure, history, path, point=(0.13, 0.06, 0))
    with pytest.raises(ao.InputError, match="within the run"):
        plot_deformed(structure, history, path, time=1.0)


@pytest.mark.slow
def test_a_flat_sheet_read_as_plane_deflects_across_its_plane(tmp_path):
    """A shell on a mesh with two coordinates moves along z: probe and series show it."""
    flat = dolfinx.mesh.create_rectangle(MPI.COMM_SELF, [np.zeros(2), np.array([0.2, 0.1])], [4, 2])
    clamp = ao.Support(lambda x: np.isclose(x[0], 0.0))
    part = ao.Structure(ao.read_mesh(flat), ao.Shell(70e9, 0.3, 2700.0, 2e-3), [clamp])
    model = ao.extract(part, ao.Site((0.15, 0.05, 0.0), (0, 0, -1)), n=4)
    hit = ao.simulate(model, ao.RigidMass(0.01, 1.0), ao.Linear(1e5), 2e-3)
    tip = ao.probe(part, hit, (0.15, 0.05))
    assert tip.shape == (len(hit.time), 3)
    assert -tip[:, 2] == pytest.approx(hit.displacement, abs=0.05 * hit.displacement.max())
    _, _, moved = fields.skin(part, hit, float(hit.time[-1]))
    assert np.abs(moved[:, 2]).max() > 0.5 * np.abs(tip[-1, 2])


@pytest.mark.sample
@pytest.mark.parametrize("scale", [1.0, 10.0])
def test_the_arrow_of_a_picture_ends_at_the_site_and_the_view_is_the_given_one(scale):
    """It is a quarter as long as the part, along the direction, in mm or in m."""
    art3d = pytest.importorskip("mpl_toolkits.mplot3d.art3d")
    from antiosc.plotting import plot_deformed

    sides = scale * np.array([0.2, 0.1])
    flat = dolfinx.mesh.create_rectangle(MPI.COMM_SELF, [np.zeros(2), sides], [2, 2])
    clamp = ao.Support(lambda x: np.isclose(x[0], 0.0))
    part = ao.Structure(ao.read_mesh(flat), ao.Shell(70e9, 0.3, 2700.0, 2e-3), [clamp])
    at, along = (*(0.5 * sides), 0.0), np.array([2.0, -1.0, -2.0]) / 3
    model = ao.extract(part, ao.Site(at, (0, 0, -1)), n=2)
    hit = ao.simulate(model, ao.RigidMass(0.01, 1.0), ao.Linear(1e5), 5e-4)
    figure = plot_deformed(part, hit, point=at, direction=tuple(7 * along), view=(70.0, 10.0))
    axes = figure.axes[0]
    assert (axes.elev, axes.azim) == (70.0, 10.0)
    lines = [c for c in axes.collections if isinstance(c, art3d.Line3DCollection)]
    shaft = max((np.asarray(s) for c in lines for s in c._segments3d), key=np.ptp)
    unit = 1e3 if sides.max() < 1 else 1.0
    tip, length = unit * np.array(at), 0.25 * unit * sides[0]
    ends = shaft[np.argsort(np.linalg.norm(shaft - tip, axis=1))]
    np.testing.assert_allclose(ends, [tip, tip - length * along], atol=1e-9 * length)
