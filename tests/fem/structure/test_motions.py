"""Motions of bodies in words, and the inertia of masses that are attached."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
from antiosc.fem.structure.rigid_body_modes import of_body
from parts import STEEL, box, named, plate

pytestmark = pytest.mark.fem

CENTRE, SIZE = np.array([0.5, 0.2, 0.1]), 2.0
X, Y, Z = np.eye(3)


def turning(axis: np.ndarray, through: np.ndarray, pitch: float = 0.0) -> np.ndarray:
    """A unit rotation about an axis through a point, and a translation along it."""
    axis = axis / np.linalg.norm(axis)
    velocity = np.cross(axis, CENTRE - through) + pitch * axis
    return np.concatenate([velocity, axis * SIZE])


def moving(*direction: float) -> np.ndarray:
    return np.array([*direction, 0, 0, 0])


#: Motions, and what they are called.
WORDS = [
    ([moving(0, 2, 0)], "translation along y"),
    ([moving(3, 4, 0)], "translation along (0.6, 0.8, 0)"),
    ([moving(1, 1, 0), moving(1, -1, 0)], "translation along x and translation along y"),
    ([turning(Z, np.array([1, 2, 0.1]))], "rotation about z through (1, 2, 0.1) m"),
    ([turning(-Z, np.array([1, 2, 0.1]))], "rotation about z through (1, 2, 0.1) m"),
    ([turning(Y, CENTRE)], "rotation about y through (0.5, 0.2, 0.1) m"),
    ([turning(X, np.array([0.5, 0, 3]), 0.3)], "a screw motion along x through (0.5, 0, 3) m"),
    (
        [turning(Y + Z, np.array([2, 0.2, 0.1]))],
        "rotation about (0, 0.707, 0.707) through (2, 0.2, 0.1) m",
    ),
    (
        [turning(Z, np.array([1, 2, 0.1])), moving(0, 0, 1)],
        "translation along z and rotation about z through (1, 2, 0.1) m",
    ),
    (
        [moving(1, 0, 0), moving(0, 1, 0), turning(Z, np.array([7, 8, 0.1]))],
        "translation along x, translation along y and rotation about z",
    ),
    (
        [turning(X, CENTRE), turning(Y, CENTRE), turning(Z, CENTRE)],
        ", ".join(f"rotation about {a} through (0.5, 0.2, 0.1) m" for a in "xy")
        + " and rotation about z through (0.5, 0.2, 0.1) m",
    ),
]


@pytest.mark.parametrize(("motions", "words"), WORDS)
def test_motions_have_their_names_whatever_their_basis(motions, words):
    columns = np.column_stack(motions).astype(float)
    count = columns.shape[1]
    rng = np.random.default_rng(4)
    for mix in (np.eye(count), rng.normal(size=(count, count)) + 2 * np.eye(count)):
        mixed = columns @ mix
        assert of_body(mixed / np.linalg.norm(mixed, axis=0), CENTRE, SIZE) == words


@pytest.mark.parametrize("direction", [(1, 0, 0), (0, 0.6, 0.8)])
def test_uniform_inertia_holds_what_is_attached(direction):
    """eᵀMe is the mass of the part and of the masses on it; on springs there is none."""
    attached = [ao.PointMass((0.2, 0.05, 0.04), 3.0), ao.Spring((0.2, 0.05, 0.04), {"x": 1e5})]
    part = ao.Structure(box(), ao.Solid(**STEEL), attached=attached)
    e = np.array(direction)
    uniform = np.tile(e, part.rows // 3)
    assert part.mass == pytest.approx(7850 * 0.2 * 0.05 * 0.04 + 3.0)
    assert uniform @ part.uniform_inertia(e) == pytest.approx(part.mass, rel=1e-9)


def test_every_cell_has_one_material():
    """Cells of no group, of two, groups that are none, and families side by side."""
    solid, other = (ao.Solid(E, 0.3, 7850.0, plane="stress") for E in (2e11, 1e11))
    shell = ao.Shell(2e11, 0.3, 7850.0, 0.01)
    groups = {
        "one": (2, lambda x: x[0] < 0.1 + 1e-9),
        "two": (2, lambda x: x[0] > 0.1 - 1e-9),
        "all": (2, lambda x: x[0] < 9),
        "edge": (1, lambda x: x[0] < 1e-9),
    }
    mesh = named(plate((2, 1), (0.2, 0.1), "triangle").dolfinx, groups)
    for given, words in (
        ({"one": solid}, "of 4 cells 2 have none and 0 more than one; .* are 'one'"),
        ({"one": solid, "all": other}, "of 4 cells 0 have none and 2 more than one"),
        ({"one": solid, "edge": other}, "group 'edge' holds no cells"),
        ({"one": solid, "three": other}, "no group 'three'"),
        ({"one": solid, "two": shell}, "must be of one family"),
        ({}, "an empty dict"),
        ({"one": "steel", "two": other}, "must be a Solid, .* got str"),
        (ao.Solid, "must be a Solid, .* got type"),
    ):
        with pytest.raises(ao.InputError, match=words):
            ao.Structure(mesh, given, order=1)
    both = ao.Structure(mesh, {"one": solid, "two": other}, order=1)
    assert both.mass == pytest.approx(7850 * 0.2 * 0.1)
