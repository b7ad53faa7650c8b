"""The arguments of joints: wrong ones are refused when the joint is made, others are stored."""

from __future__ import annotations

from dataclasses import replace

import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
from antiosc.base.errors import InputError
from assemblies import BEAM

pytestmark = pytest.mark.fem

A, B = "a:left", ("b", [1, 2, 3])
#: Makes a joint of two ends and further arguments.
JOINTS = {
    "Tie": lambda a=A, b="b:right", **more: ao.Tie(a, b, **more),
    "Rigid": lambda a=A, b=B, **more: ao.Rigid(a, b, **more),
    "Mean": lambda a=A, b=B, **more: ao.Mean(a, b, **more),
    "Weld": lambda a=A, b=B, **more: ao.Weld(a, b, **more),
    "Ball": lambda a=A, b=B, **more: ao.Ball(a, b, **more),
    "Hinge": lambda a=A, b=B, **more: ao.Hinge(a, b, **more),
    "Slider": lambda a=A, b=B, **more: ao.Slider(a, b, **more),
    "Bolt": lambda a=A, b=B, **more: ao.Bolt(a, b, BEAM, **more),
    "Bushing": lambda a=A, b=B, **more: ao.Bushing(a, b, {"x": 1}, **more),
    "Equation": lambda a=A, b=B, **more: ao.Equation([(a, "x", 1), [b, "y", 2]], **more),
}
WRONG_ENDS = [5, "", None, ("b",), ("", (0, 0, 0)), ("b", (0, 0, 0, 0)), ("b", "here"), ["b", 1.0]]


@pytest.mark.parametrize("name", list(JOINTS))
def test_wrong_ends_and_names_are_refused(name):
    make = JOINTS[name]
    for wrong in WRONG_ENDS:
        for place in ("a", "b"):
            if (name, place, wrong) == ("Rigid", "b", None):  # a rigid group by itself
                continue
            with pytest.raises(InputError):
                make(**{place: wrong})
    for wrong in ("", 3, ["joint"]):
        with pytest.raises(InputError, match="name"):
            make(name=wrong)
    made = make(name="the joint")
    assert made.label(2) == "'the joint'"
    assert make().label(2) == f"joint 2 ({name})"


def test_wrong_values_are_refused():
    for gap in (0.0, -1e-3, "small"):
        with pytest.raises(InputError, match="gap"):
            ao.Tie(A, "b:right", gap=gap)
    assert ao.Tie(A, "b:right", gap=1e-3).gap == 1e-3
    with pytest.raises(InputError, match="beam must be"):
        ao.Bolt(A, B, ao.Section.circle(0.1))
    with pytest.raises(InputError, match="no offset"):
        ao.Bolt(A, B, replace(BEAM, offset=0.01))
    for stiffness in ({"w": 1.0}, {3: 1.0}, {"x": 0.0}, {"x": -1.0}, [("x", 1.0)], {}):
        with pytest.raises(InputError, match=r"Bushing|stiffness along x"):
            ao.Bushing(A, B, stiffness)
    for damping in ({"w": 1.0}, {"x": -1.0}):
        with pytest.raises(InputError, match=r"Bushing|damping along x"):
            ao.Bushing(A, B, {"x": 1.0}, damping=damping)
    made = ao.Bushing(A, B, damping={"x": 2})
    assert (dict(made.stiffness), dict(made.damping)) == ({}, {"x": 2.0})
    for terms in ((), "x", [("a", "x")], [("a", "w", 1.0)], [("a", 3, 1.0)], [("a", "x", "one")],
                  [("a", "x", 0.0), ("b", "y", 0.0)], [None]):  # fmt: skip
        with pytest.raises(InputError):
            ao.Equation(terms)
    assert ao.Equation([["a", "rx", 2], (B, "z", 0)]).terms == (
        ("a", "rx", 2.0),
        (("b", (1.0, 2.0, 3.0)), "z", 0.0),
    )
