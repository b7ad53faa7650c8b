"""Wrong assemblies are refused, or told, in one sentence with the name, the rule and the remedy."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import antiosc as ao
from assemblies import BEAM, NU, SOLID, E, box, line


@cache
def block() -> ao.Structure:
    return ao.Structure(box((0, 0, 0), (1, 1, 1), (1, 1, 1)), SOLID, order=1)


@cache
def rod() -> ao.Structure:
    return ao.Structure(line((0, 0, 0), (1, 0, 0), 2), BEAM)


@cache
def plane() -> ao.Structure:
    material = ao.Solid(E, NU, 2700.0, plane="stress")
    return ao.Structure(box((0, 0), (1, 1), (1, 1), "quadrilateral"), material)


def two(*joints: ao.Weld, **options: object) -> ao.Structure:
    """Two blocks side by side."""
    return ao.assemble({"a": block(), "b": block()}, joints, {"b": (1, 0, 0)}, **options)


TIE = ao.Tie("a:x1", "b:x0")


def flat(*joints: ao.Rigid, **options: object) -> ao.Structure:
    """Two plane squares side by side."""
    return ao.assemble({"a": plane(), "b": plane()}, [TIE, *joints], {"b": (1, 0)}, **options)


def rods(*joints: ao.Weld) -> ao.Structure:
    """Two rods in line."""
    held = ao.Structure(rod().mesh, BEAM, [ao.Support("start")])
    return ao.assemble({"a": held, "b": rod()}, joints, {"b": (1, 0, 0)})


WELD = ao.Weld("a:end", "b:start")


def nowhere(x: np.ndarray) -> np.ndarray:
    return x[0] > 99


WRONG = [
    (lambda: ao.assemble({"a:b": block()}), "without a colon"),
    (lambda: ao.assemble({"a": two(TIE)}), "is an assembly"),
    (lambda: ao.assemble({"a": block(), "b": plane()}), "is plane"),
    (lambda: ao.assemble({"a": plane()}, at={"a": (0, 0, 1.0)}), "of a plane part"),
    (lambda: ao.assemble({"a": block()}, at={"c": (0, 0, 0)}), "which is no part"),
    (lambda: two(), "'b' is joined to nothing else|'a' is joined to nothing else"),
    (lambda: two(TIE, points={"hub": (0, 0, 0)}), "the reference point 'hub' is joined to nothing"),
    (lambda: two(TIE, points={"a": (0, 0, 0)}), "names both a part and a reference point"),
    (lambda: two(ao.Tie("a:x1", "c:x0")), "no part 'c'; its parts are: 'a', 'b'"),
    (lambda: two(ao.Tie("a:x1", "b:top")), r"no group 'top'; its groups are: 'x0'"),
    (lambda: ao.assemble({"a": block(), "r": rod()}, [ao.Tie("a:x1", "r:start")]), "faces"),
    (lambda: ao.Tie("a:x1", "a:x1"), "to itself"),
    (lambda: ao.Rigid("a:x0", ("b", "here")), "point"),
    (lambda: ao.Mean("a:x0", ("b", (0, 0, 0, 0))), "point must be"),
    (lambda: ao.Bushing("a:x0", "b:x0", {"w": 1.0}), "'w' is not one of them"),
    (lambda: ao.Bushing("a:x0", "b:x0", {}), "needs a stiffness"),
    (lambda: ao.Bushing("a:x0", "b:x0", damping={"x": -1.0}), "damping along x"),
    (lambda: ao.Equation([("a", "x")]), "a term must be"),
    (lambda: ao.Equation([("a", "x", 0.0)]), "a coefficient"),
    (lambda: two(ao.Weld(("a", (1, 0, 0)), ("b", (1, 0, 0)))), "a rotation that 'a' at"),
    (lambda: two(ao.Ball(("a", (1, 0, 0)), ("b", (2, 0, 0)))), "carry"),
    (lambda: two(ao.Ball(("a", (1, 0, 3)), ("b", (2, 0, 0)))), "2 m off the part"),
    (lambda: two(TIE, ao.Rigid("a:x0", ("b", (2, 0, 0)))), "does not rotate"),
    (lambda: ao.assemble({"a": block(), "r": rod()}, [ao.Mean("r:start", "a:x0")]), "several"),
    (lambda: ao.assemble({"r": rod()}, [ao.Rigid("r:start")]), "a single point, which is rigid"),
    (lambda: two(TIE, ao.Bolt("a:x1", "b:x0", BEAM)), "has no length.*use a Weld"),
    (lambda: two(ao.Equation([("a:x0", "w", 1.0)])), "a component is one of x, y, z"),
    (lambda: two(TIE, ao.Equation([(("a", (0, 0, 0)), "rx", 1.0)])), "no component 'rx'"),
    (lambda: two(TIE, ao.Equation([("a:x0", "x", 1.0), ("a:x0", "x", -1.0)], name="e")), "0 = 0"),
    (lambda: two(TIE, supports=[ao.Support("x0")]), 'must be a group, "part:group"'),
    (lambda: two(TIE, attached=[ao.PointMass("hub", 1.0)]), "no reference point 'hub'"),
    (lambda: two(TIE, attached=[ao.Spring((0, 0, 0), {"rx": 1.0})]), "acts on rx"),
    (lambda: two(TIE, ao.Bushing("a:x0", "hub", {"z": 1e5}), points={"hub": (0, 0.5, 0.5)}),
     "resistance"),
    (lambda: ao.assemble(
            {"a": plane(), "b": plane()}, [ao.Slider("a:x1", "b:x0")], {"b": (1, 0, 0)}
        ),
     "slide"),
    (lambda: ao.Hinge("a:x1", "b:x0", axis=(0, 0, 1e-200)), "must not be the zero vector"),
    (lambda: flat(points={"tip": (1, 0.5, 2.0)}), r"points\['tip'\] lies 2 m out of the plane"),
    (lambda: ao.extract(
            flat(ao.Rigid("b:x1", "tip"), points={"tip": (3, 0)}), ao.Site("tip", (0, 1, 1)), n=1
        ),
     "leaves"),
    (lambda: two(TIE, points={"hub": (0, 0, 0, 0)}), r"points\['hub'\] must be 2 or 3 numbers"),
    (lambda: flat(supports=[ao.Support("a:x0", "z")]), "'z' is no component"),
    (lambda: two(TIE, supports=[ao.Support(nowhere)]), "function"),
    (lambda: two(TIE, supports=[ao.Support("a:x0"), ao.Support("a:x1"), ao.Support("b:x1")]),
     "every dof"),
    (lambda: two(ao.Bolt(("a", (1, 0, 0)), "b:x1", BEAM)), "has no rotation, and the end of"),
    (lambda: two(TIE, ao.Bushing("a:x1", "b:x0", {"axial": 1.0})), "an axial spring needs two"),
    (lambda: flat(ao.Bushing("a:x0", "b:x1", {"rx": 1.0})), "acts on rx, a rotation"),
    (lambda: flat(ao.Bushing("a:x1", "b:x0", {"z": 1.0})), "acts on z, a displacement"),
    (lambda: rods(WELD, ao.Ball("a:end", ("a", (1, 0, 0)))), "same point"),
    (lambda: rods(WELD, ao.Rigid("a:end", ("a", (1, 0, 0)))), "follows"),
    (lambda: two(TIE, ao.Mean("a:x0", ("a", (0, 0, 0)))), "mean"),
    (lambda: ao.assemble(
            {
                "a": plane(),
                "b": ao.Structure.from_matrices(
                    np.eye(3), np.eye(3), map=[[1, 1, 1, 0, 0], [1, 2, 1, 0, 0], [1, 3, 1, 0, 0]]
                ),
            },
            [ao.Ball("a:x1", "b:1")],
        ),
     "in space"),
]  # fmt: skip


@pytest.mark.parametrize(("make", "words"), WRONG)
@pytest.mark.filterwarnings("ignore::antiosc.base.errors.AntioscWarning")
def test_it_is_refused_in_one_sentence(make, words):
    with pytest.raises(ao.AntioscError, match=words) as told:
        make()
    sentence = str(told.value)
    assert sentence.endswith(".")
    assert len(sentence) < 400
    assert isinstance(told.value, ao.InputError)
