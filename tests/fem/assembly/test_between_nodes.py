"""Which nodes move as one rigid body, by the constraints that they fulfil."""

from __future__ import annotations

import pytest

pytest.importorskip("dolfinx")

from antiosc.fem.assembly.between_nodes import _in_one_body

pytestmark = pytest.mark.fem


def body(followers: dict[int, int], motions) -> tuple[dict, list]:
    """(dependent, equations) of nodes that follow a leader in some motions."""
    dependent: dict[int, dict[int, int]] = {m: {} for m in motions}
    equations = []
    for node, leader in followers.items():
        for motion in motions:
            dependent[motion][node] = len(equations)
            equations.append([(node, motion, 1.0), (leader, motion, -1.0)])
    return dependent, equations


@pytest.mark.parametrize(("plane", "motions"), [(False, range(6)), (True, (0, 1, 5))])
def test_nodes_of_one_body_follow_one_leader_in_all_motions(plane, motions):
    one = body({1: 9, 2: 9}, motions)
    assert _in_one_body([1, 2], *one, plane)
    assert _in_one_body([1, 9], *one, plane)  # the leader is one of them
    assert not _in_one_body([1, 3], *one, plane)
    assert not _in_one_body([1, 2], *body({1: 9, 2: 8}, motions), plane)
    for lost in motions:
        assert not _in_one_body([1, 2], *body({1: 9, 2: 9}, set(motions) - {lost}), plane)
    assert _in_one_body([1, 2], *body({1: 9, 2: 9}, range(6)), plane)
