"""Ends of a contact of a Scene must meet: distances and angles that are off are told."""

from __future__ import annotations

import re
import warnings

import numpy as np
import pytest

import antiosc as ao

LAW = ao.Linear(1e6)
POINT, DOWN = np.array([1.0, 0.5, 0.2]), np.array([0.0, 0.0, -1.0])


def body(point, direction):
    return ao.RigidBody(1.0, (1e-3, 1e-3, 1e-3), {"tip": (point, direction)}, point)


def sentences(lower, upper, gap=0.0):
    scene = ao.Scene(
        {"lower": lower, "upper": upper},
        [ao.Contact("lower:tip", "upper:tip", LAW, gap)],
        motion={"upper": ao.Motion((0, 0, -1.0))},
    )
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        history = scene.run(1e-3)
    said = [str(one.message) for one in caught if "of a contact" in str(one.message)]
    assert all(sentence in history.message for sentence in said)
    return said


@pytest.mark.parametrize("shift", [(0.2, 0, 0), (0, 0.12, -0.16), (0, 0, 0.2), (0, 0, -0.2)])
def test_ends_apart_are_told_with_their_distance(shift):
    (said,) = sentences(body(POINT, DOWN), body(POINT + shift, -DOWN))
    assert re.search(r"lie 0\.2 m apart besides the gap of 0 m", said)


@pytest.mark.parametrize("angle", [10.0, 30.0, 150.0])
def test_ends_along_other_lines_are_told_with_their_angle(angle):
    turned = (np.sin(np.radians(angle)), 0.0, np.cos(np.radians(angle)))
    (said,) = sentences(body(POINT, DOWN), body(POINT, turned))
    assert f"{min(angle, 180 - angle):.3g}° off one line" in said


@pytest.mark.parametrize("drawn", [0.0, 0.1])
def test_a_gap_may_be_drawn_or_not(drawn):
    assert not sentences(body(POINT, DOWN), body(POINT - drawn * DOWN, -DOWN), 0.1)
    (said,) = sentences(body(POINT, DOWN), body(POINT + 0.05 * DOWN, -DOWN), 0.1)
    assert "lie 0.05 m apart besides the gap of 0.1 m" in said


@pytest.mark.filterwarnings("ignore:.*oscillators:antiosc.AccuracyWarning")
@pytest.mark.parametrize("apart", [0.0, 0.2])
def test_sites_of_models_have_places_and_bodies_without_have_none(apart):
    pytest.importorskip("dolfinx")
    steel = ao.Beam(E=210e9, nu=0.3, rho=7800.0, section=ao.Section.rectangle(0.01, 0.01))

    def beam(x):
        mesh = ao.box_mesh((1.0,), size=0.05)
        part = ao.Structure(mesh, steel, [ao.Support("-x")])
        return ao.extract(part, ao.Site((x, 0.0, 0.0), DOWN), n=10)

    tip = ao.RigidBody(0.01, (1e-6, 1e-6, 1e-6), {"tip": ((1.0 - apart, 0, 0), -DOWN)}, (1, 0, 0))
    contact = ao.Contact("beam", "other:tip", LAW)
    down = {"other": ao.Motion((0, 0, -1.0))}
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        ao.Scene({"beam": beam(1.0), "other": tip}, [contact], motion=down).run(1e-4)
        ball = ao.RigidMass(0.01, velocity=1.0)
        ao.Scene({"beam": beam(1.0), "other": ball}, [ao.Contact("beam", "other", LAW)]).run(1e-4)
    said = [str(one.message) for one in caught if "lie 0.2 m apart" in str(one.message)]
    assert len(said) == (apart > 0)
