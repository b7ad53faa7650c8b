"""Calls with arguments that a public name does not take, or lacks."""

from __future__ import annotations

import inspect

import pytest

import antiosc as ao


def takes_any(function) -> bool:
    try:
        parameters = inspect.signature(function).parameters.values()
    except ValueError:
        return False
    return any(each.kind is each.VAR_KEYWORD for each in parameters)


@pytest.mark.fem
def test_every_public_name_tells_of_a_keyword_that_it_does_not_take():
    pytest.importorskip("dolfinx")
    told = 0
    for name in ao.__all__:
        value = getattr(ao, name)
        exempt = inspect.isclass(value) and (
            issubclass(value, BaseException) or inspect.isabstract(value)
        )
        if exempt or not callable(value) or getattr(value, "_is_protocol", False):
            continue
        if takes_any(value):
            continue
        with pytest.raises(ao.InputError, match=f"{name} takes no argument 'nosuch'"):
            value(nosuch=1)
        told += 1
    assert told > 80


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: ao.RigidMass(mass=1.0, velocty=2.0), r"RigidMass .*'velocty'.*'velocity'"),
        (lambda: ao.AntiOscillators(m0=1.0, k0=1.0, m=[], omegas=[]), r"'omegas'.*'omega'"),
        (lambda: ao.Hertz.from_radii(radius=1.0), r"from_radii .*'radius'"),
        (lambda: ao.RigidMass(), r"RigidMass: missing .*'mass'"),
        (lambda: ao.RigidMass(1, 2, 3, 4, 5, 6, 7, 8), "RigidMass: too many positional"),
        (lambda: ao.SavedFields(None), "SavedFields: missing .*'cells'"),
        (lambda: ao.Sphere(0.01, 210e9, 0.3, 7850.0).hertz(E=70e9), "hertz: missing .*'nu'"),
        (lambda: ao.Flores(stifness=1e9), r"Flores .*'stifness'.*'stiffness'"),
    ],
)
def test_the_nearest_argument_is_named(call, says):
    with pytest.raises(ao.InputError, match=says) as raised:
        call()
    assert isinstance(raised.value, TypeError)  # what Python itself raises


def test_bodies_that_are_none_and_exchanged_ones_are_told():
    ball, law = ao.RigidMass(1.0, 2.0), ao.Hertz(1e9)
    wall = ao.AntiOscillators(m0=1.0, k0=0.0, m=[], omega=[])
    with pytest.raises(ao.InputError, match="extract"):
        ao.simulate(None, ball, law, 1e-3)
    with pytest.raises(ao.InputError, match="order is simulate"):
        ao.simulate(ball, wall, law, 1e-3)


def test_a_table_is_no_archive(tmp_path):
    bodies = {"b": ao.RigidMass(1.0, -1.0), "w": ao.Obstacle()}
    landing = ao.Scene(bodies, [ao.Contact("b", "w", ao.Linear(1e6))]).run(1e-2)
    with pytest.raises(ao.InputError, match="to_csv"):
        landing.save(tmp_path / "x.csv")
