"""Files of displacements: what they hold, without dolfinx, and what they refuse."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

import antiosc as ao
from antiosc.fields.pictures import FORMAT, SavedFields
from antiosc.models import model_file

CORNERS = np.array([[x, y, z] for z in (0.0, 1) for y in (0.0, 1) for x in (0.0, 1, 2)])
#: Two cubes side by side, VTK's order.
CUBES = np.array([[0, 1, 4, 3, 6, 7, 10, 9], [1, 2, 5, 4, 7, 8, 11, 10]])


def made(cells=(("hexahedron", CUBES),), **options) -> SavedFields:
    shapes = np.zeros((12, 3, 2))
    shapes[:, 0, 0], shapes[:, 2, 1] = CORNERS[:, 0], CORNERS[:, 1]
    own = {"time": np.array([0.0, 1.0, 3.0]), "factors": np.array([[0, 0], [1, 2], [3, 0.0]])}
    return SavedFields(CORNERS, list(cells), shapes, **{**own, **options})


@pytest.mark.parametrize("at", range(5))
@pytest.mark.parametrize("wrong", [None, "text", [[None]]])
def test_fields_of_other_things_are_refused(at, wrong):
    good = made()
    given = [good.points, good.cells, good.shapes, good.time, good.factors]
    with pytest.raises(ao.InputError):
        SavedFields(*given[:at], wrong, *given[at + 1 :])


@pytest.mark.slow
def test_a_file_is_read_without_finite_elements(tmp_path):
    made().save(tmp_path / "fields.npz")
    script = f"""
import sys
for name in ("dolfinx", "petsc4py", "mpi4py", "ufl"):
    sys.modules[name] = None
from antiosc.fields.pictures import (SavedFields)
fields = SavedFields.load({str(tmp_path / "fields.npz")!r})
print(fields.at(2.0).sum(), fields.cells[0][0], fields.faces.shape)
"""
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout == f"{made().at(2.0).sum()} hexahedron (10, 4)\n"


@pytest.mark.parametrize(
    "change",
    [
        {"points": np.zeros((12, 2))},
        {"points": np.full((12, 3), np.nan)},
        {"time": np.array([0.0, 2.0, 1.0])},
        {"factors": np.zeros((3, 5))},
        {"shapes": np.zeros((11, 3, 2))},
        {"cells0": np.array([[0, 1, 2, 3, 4, 5, 6, 12]])},
        {"cells0": np.array([[0, 1, 2, -3, 4, 5, 6, 7]])},
        {"cells0": np.array([[0, 1, 2]])},
        {"cells0": np.arange(8)},
    ],
)
def test_a_damaged_file_is_told(change, tmp_path):
    fields = made()
    arrays = {"points": fields.points, "shapes": fields.shapes, "time": fields.time}
    arrays |= {"factors": fields.factors, "cells0": CUBES}
    header = {"format": FORMAT, "version": model_file.VERSION, "kinds": ["hexahedron"]}
    model_file.write(tmp_path / "fields.npz", header, {**arrays, **change})
    with pytest.raises(ao.InputError, match="damaged"):
        SavedFields.load(tmp_path / "fields.npz")


@pytest.mark.slow
def test_pictures_of_surfaces_lines_and_nodes(tmp_path):
    pytest.importorskip("matplotlib")
    import matplotlib.image

    kinds = {"solid": CUBES, "bars": np.array([[0, 1], [1, 2]]), "nodes": np.arange(12)[:, None]}
    names = {"solid": "hexahedron", "bars": "line", "nodes": "vertex"}
    for name, cells in kinds.items():
        path = made([(names[name], cells)]).plot(2.0, tmp_path / f"{name}.png", view=(20, 30))
        picture = matplotlib.image.imread(path)[..., :3]
        assert np.mean(np.ptp(picture, axis=2) > 0.2) > 0.01
    colours = made().plot(1.0).axes[1].get_ylim()  # the scale is that of all times
    assert colours == (0.0, pytest.approx(6e3))


@pytest.mark.slow
@pytest.mark.fem
def test_the_file_of_a_run_has_the_field_of_the_run(tmp_path):
    pytest.importorskip("dolfinx")
    import parts

    part = parts.held_sheet()
    site = ao.Site((0.13, 0.06), (0.2, -1), radius=0.035)
    hit = ao.simulate(ao.extract(part, site, 6), ao.RigidMass(0.1, 1.0), ao.Hertz(1e8), 3e-4)
    fields = SavedFields.load(ao.save_fields(part, hit, tmp_path / "fields.npz"))
    assert len(fields.time) == len(np.unique(hit.time))
    t = float(hit.time[len(hit.time) // 2])
    corner = int(np.argmax(fields.points[:, 0] + fields.points[:, 1]))
    there = ao.probe(part, hit, fields.points[corner], times=[t])[0]
    np.testing.assert_allclose(fields.at(t)[corner, :2], there, atol=1e-12)
    assert fields.largest > 1e-6
    with pytest.raises(ao.InputError, match="increasing times"):
        ao.save_fields(part, hit, tmp_path / "other.npz", [1e-4, 0.0])
    assert not (tmp_path / "other.npz").exists()
