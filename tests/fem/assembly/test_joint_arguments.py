"""The arguments of joints: wrong ones are refused when the joint is made, others are stored."""

from __future__ import annotations

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
