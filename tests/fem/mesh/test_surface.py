"""Faces of a mesh: how far curved ones bend."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
from antiosc.fem.mesh.surface import Faces
from paths import MESHES

pytestmark = pytest.mark.fem


def test_a_curved_face_bends_by_the_sagitta_of_its_arc():
    """Sides of the arch: 36 arcs of π/36, inside and outside, and six straight sides.

    The ends of an arc of angle θ lie R (1 − cos θ/2) off the tangent in its middle; over its chord
    2 R sin θ/2 that is tan(θ/4)/2.
    """
    bend = np.sort(Faces(ao.read_mesh(MESHES / "arch.msh"), sheet=False).bend)
    assert not bend[:6].any()
    assert bend[6:] == pytest.approx(np.full(72, np.tan(np.pi / 36 / 4) / 2), rel=1e-6)
