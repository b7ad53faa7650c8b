"""Beams along x with groups, for tests of parts under load."""

from __future__ import annotations

import dolfinx
import numpy as np

import antiosc as ao
from antiosc.fem.mesh import Mesh
from parts import line
from sheets import at

E, RHO, SIDE, LENGTH = 70e9, 2700.0, 0.01, 1.0
SQUARE = ao.Section.rectangle(SIDE, SIDE)
THIN_BEAM = ao.Beam(E, 0.3, RHO, SQUARE, shear=False)
EI, MASS = E * SIDE**4 / 12, RHO * SIDE**2
UNIT = np.sqrt(EI / MASS)


def at_root(x):
    return x[0] < 1e-9


def at_ends(x):
    return (x[0] < 1e-9) | (x[0] > LENGTH - 1e-9)


def marked(mesh, **groups):
    """The mesh with groups name=(dimension, function of coordinates)."""
    found = {}
    for name, (dim, marker) in groups.items():
        entities = dolfinx.mesh.locate_entities(mesh.dolfinx, dim, marker)
        found[name] = {dim: np.sort(entities).astype(np.int32)}
    return Mesh(mesh.dolfinx, found, "the part")


def beams(n=20, length=LENGTH):
    """A line along x in space, whose cells are "all" and whose end is "tip"."""
    mesh = line(length, n, (1.0, 0.0, 0.0))
    return marked(mesh, all=(1, lambda x: x[0] > -1), tip=(0, at(0, length)))
