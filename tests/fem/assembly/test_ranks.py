"""Assemblies on several ranks: refused in words on all of them, or made by each for itself."""

from __future__ import annotations

import json

import pytest

pytest.importorskip("dolfinx")

from mpi import run_ranks

pytestmark = [pytest.mark.fem, pytest.mark.mpi]

PROGRAM = """
import dolfinx, json
import numpy as np
from mpi4py import MPI
import antiosc as ao

def block(comm):
    box = dolfinx.mesh.create_box(comm, [np.zeros(3), np.ones(3)], [3, 2, 2])
    return ao.Structure(ao.read_mesh(box), ao.Solid(70e9, 0.3, 2700.0), order=1)

said = []
for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
    try:
        part = ao.assemble({"a": block(comm)}, points={}, attached=[ao.PointMass((1, 1, 1), 2.0)])
        said.append(part.mass)
    except ao.InputError as error:
        said.append(str(error))
print(json.dumps(said))
"""


def test_parts_of_several_ranks_are_refused_and_those_of_one_are_joined():
    first, second = (json.loads(text) for text in run_ranks(2, PROGRAM))
    assert first == second
    refused, mass = first
    assert "an assembly runs on one MPI rank" in refused
    assert mass == pytest.approx(2702.0, rel=1e-12)
