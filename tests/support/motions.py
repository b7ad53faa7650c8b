"""Rows of motions of nodes, as the joints of decks have them, and those of a rigid body."""

from __future__ import annotations

import numpy as np

MOTIONS = ["x", "y", "z", "rx", "ry", "rz"]


def row_of(terms, count: int) -> np.ndarray:
    """The coefficients (count, 6) of a sum of motions of so many nodes."""
    row = np.zeros((count, 6))
    for node, motion, value in terms:
        row[node, motion] += value
    return row


def rigid(x: np.ndarray) -> np.ndarray:
    """Motions (nodes, 6, 6) of the nodes at `x` in the six of a rigid body."""
    motions = np.zeros((len(x), 6, 6))
    motions[:, :3, :3] = motions[:, 3:, 3:] = np.eye(3)
    for k in range(3):
        motions[:, :3, 3 + k] = np.cross(np.eye(3)[k], x)
    return motions


def matrix(terms_and_values, count: int) -> np.ndarray:
    """Σ value (Σ coefficient × motion)²."""
    rows = [np.sqrt(value) * row_of(terms, count).ravel() for terms, value in terms_and_values]
    return sum((np.outer(row, row) for row in rows), np.zeros((6 * count, 6 * count)))


def node_at(x: np.ndarray, point) -> int:
    distance = np.linalg.norm(x - point, axis=1)
    assert distance.min() < 1e-12
    return int(np.argmin(distance))


def stiffness(model: dict, x: np.ndarray) -> np.ndarray:
    """N/m and Nm of the springs of a model between nodes at `x` (m) and to the ground."""
    K = matrix(model["joints"]["springs"], len(x))
    for point, given in model["springs"]:
        for name, k in given.items():
            one = 6 * node_at(x, point) + MOTIONS.index(name)
            K[one, one] += k
    return K
