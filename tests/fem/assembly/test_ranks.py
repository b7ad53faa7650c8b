"""An assembly works on one rank: parts on several are refused, those of each rank are joined."""

from __future__ import annotations

import pytest

from mpi import START, run_ranks

pytestmark = pytest.mark.mpi


def test_parts_that_each_rank_has_for_itself_are_joined_by_each():
    """Even by one rank alone, which must not wait for the others."""
    script = """
box = dolfinx.mesh.create_box(MPI.COMM_SELF, [np.zeros(3), np.ones(3)], [2, 1, 1])
block = ao.Structure(ao.read_mesh(box), ao.Solid(70e9, 0.3, 2700.0), order=1)
if MPI.COMM_WORLD.rank == 1:
    made = ao.assemble({"a": block}, attached=[ao.PointMass((1, 1, 1), 2.0)])
    print(made.mass)
"""
    printed = run_ranks(2, START + script, timeout=100)
    assert float(printed[1]) == pytest.approx(2702.0, rel=1e-12)


def test_a_part_on_two_ranks_is_refused_on_both():
    script = """
box = dolfinx.mesh.create_box(MPI.COMM_WORLD, [np.zeros(3), np.ones(3)], [2, 1, 1])
block = ao.Structure(ao.read_mesh(box), ao.Solid(70e9, 0.3, 2700.0), order=1)
try:
    ao.assemble({"a": block})
except ao.InputError as error:
    print(error)
"""
    for text in run_ranks(2, START + script, timeout=100):
        assert "one rank" in text
