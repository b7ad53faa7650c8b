"""Decks of Abaqus and CalculiX as meshes: small decks, one for each feature."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
from antiosc.fem.elements.weak_form import measure
from antiosc.fem.platform import compat
from paths import DECKS

pytestmark = pytest.mark.fem


def volume(mesh: ao.Mesh) -> float:
    return compat.integrate(compat.constant(mesh.dolfinx, 1.0) * measure(mesh, 7), mesh.dolfinx)


def write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


NODES = "*NODE\n1,0,0,0\n2,1,0,0\n3,1,1,0\n4,0,1,0\n5,0,0,1\n6,1,0,1\n7,1,1,1\n8,0,1,1\n"
CUBE = NODES + "*ELEMENT,TYPE=C3D8,ELSET=ALL\n1,1,2,3,4,5,6,7,8\n"


def test_units_scale_the_mesh():
    assert volume(ao.read_mesh(DECKS / "sets.inp", unit="mm")) == pytest.approx(2e-9, rel=1e-12)
    assert volume(ao.read_mesh(DECKS / "sets.inp", unit=0.5)) == pytest.approx(0.25, rel=1e-12)
    with pytest.raises(ao.InputError, match="unit must be one of 'm', 'mm'"):
        ao.read_mesh(DECKS / "sets.inp", unit="miles")


@pytest.mark.slow
def test_curved_cells_keep_their_sides_when_they_are_cut():
    whole, mixed = (ao.read_mesh(DECKS / name) for name in ("tube.inp", "tube_mixed.inp"))
    assert (whole.cell, mixed.cell) == ("hexahedron", "tetrahedron")
    assert whole.order == mixed.order == 2
    exact = np.pi / 8 * (2**2 - 1)
    assert volume(whole) == pytest.approx(exact, rel=2e-5)
    assert volume(mixed) == pytest.approx(exact, rel=2e-4)
    x = mixed.dolfinx.geometry.x
    radius = np.hypot(x[:, 0], x[:, 1])
    outer = np.isclose(radius, 2, atol=5e-3)
    assert outer.sum() > 20
    np.testing.assert_allclose(radius[outer], 2, atol=1e-4)


def test_an_include_through_a_link_out_of_the_folder_is_refused(tmp_path):
    folder = tmp_path / "in" / "deeper"
    folder.mkdir(parents=True)
    write(tmp_path / "secret.inp", CUBE)
    (folder / "link.inp").symlink_to(tmp_path / "secret.inp")
    path = write(folder / "part.inp", "*INCLUDE, INPUT=link.inp\n")
    with pytest.raises(ao.MeshError, match="outside the folder"):
        ao.read_mesh(path)
