"""Calls with arguments that a public name does not take, or lacks."""

from __future__ import annotations

import inspect
import pickle

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
        (lambda: ao.Flores(stifness=1e9), r"Flores .*'stifness'.*'stiffness'"),
    ],
)
def test_the_nearest_argument_is_named(call, says):
    with pytest.raises(ao.InputError, match=says) as raised:
        call()
    assert isinstance(raised.value, TypeError)  # what Python itself raises


def test_other_errors_and_pickles_are_as_before():
    class Own(ao.Linear):
        def __init__(self) -> None:
            super().__init__("stiff" + 1)  # type: ignore[operator]

    with pytest.raises(TypeError, match="concatenate"):
        Own()
    assert pickle.loads(pickle.dumps(ao.simulate)) is ao.simulate
    assert inspect.signature(ao.RigidMass).parameters.keys() >= {"mass", "velocity"}
