"""Parts that are known by a model of their sites, or by given matrices, against the full part."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import antiosc as ao
from antiosc.fem.linalg.petsc_algebra import csr
from assemblies import NU, SOLID, box

pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore:.*the compliance under a point"),
    pytest.mark.filterwarnings("ignore:none of the"),
]

#: Corners of the block's bottom, where it stands on the plate.
FEET = {"a": (0, 0), "b": (0.06, 0), "c": (0.06, 0.04), "d": (0, 0.04)}
TOP = (0.03, 0.02, 0.02)
LIFT = ao.Placement((0.05, 0.03, 0.005), (0, 0, 1), 0.3, about=(0.03, 0.02, 0.0))


@cache
def block() -> ao.Structure:
    return ao.Structure(box((0, 0, 0), (0.06, 0.04, 0.02), (2, 2, 1)), ao.Solid(3e9, NU, 1500.0))


@cache
def plate() -> ao.Structure:
    held = [ao.Support("x0")]
    return ao.Structure(box((0, 0, 0), (0.2, 0.12, 0.005), (5, 4, 1)), SOLID, held)


def condensed(n: int, **options: bool) -> ao.AntiOscillators:
    """The block by its feet, and the middle of its top, which is struck."""
    options = {"tangential": True, **options}
    sites = {name: ao.Site((*xy, 0), (0, 0, -1), **options) for name, xy in FEET.items()}
    return ao.extract(block(), {**sites, "top": ao.Site(TOP, (0, 0, -1))}, n=n)


def on_plate(part: object, ends: dict, at: object = LIFT) -> ao.Structure:
    joints = [ao.Ball(("plate", _above(name)), end) for name, end in ends.items()]
    return ao.assemble({"plate": plate(), "ecu": part}, joints, {"ecu": at})


@cache
def whole() -> ao.Structure:
    return on_plate(block(), {name: ("ecu", _above(name)) for name in FEET})


def named(model: ao.AntiOscillators) -> ao.Structure:
    return on_plate(model, {name: f"ecu:{name}" for name in FEET})


CORNER = ao.Site((0.2, 0.12, 0.005), (0, 0, -1), part="plate")
OMEGA = np.linspace(300.0, 9000.0, 7)


def test_a_model_of_sites_gives_the_full_part_within_its_truncation():
    reference = ao.extract(whole(), CORNER, n=60).dynamic_stiffness(OMEGA)
    errors = []
    for n in (0, 12, 60):
        found = ao.extract(named(condensed(n)), CORNER, n=60).dynamic_stiffness(OMEGA)
        errors.append(np.abs(found / reference - 1).max())
    assert errors[0] > 10 * errors[1]
    assert errors[1] < 1e-3
    assert errors[2] < 1e-6


@pytest.mark.filterwarnings("ignore:the facets at the site")
def test_a_site_that_is_struck_keeps_its_patch():
    feet = {name: ao.Site((*xy, 0), (0, 0, -1), tangential=True) for name, xy in FEET.items()}
    model = ao.extract(block(), {**feet, "top": ao.Site(TOP, (0, 0, -1), radius=8e-3)}, n=4)
    struck = ao.extract(named(model), ao.Site("ecu:top", (0, 0, -1)), n=4)
    assert struck.radius == 8e-3
    assert struck.local_compliance == model.local_compliance[-1] > 0


def test_a_free_assembly_with_a_superelement_keeps_six_rigid_motions():
    loose = ao.Structure(plate().mesh, SOLID)
    joints = [ao.Ball(("plate", _above(name)), f"ecu:{name}") for name in FEET]
    part = ao.assemble({"plate": loose, "ecu": condensed(10)}, joints, {"ecu": LIFT})
    assert part.rigid_modes.shape[1] == 6
    with pytest.raises(ao.InputError, match="mass of the part 'ecu' is not known"):
        _ = part.mass


def given(free: ao.Structure) -> ao.Structure:
    """The block's matrices as another program gives them."""
    member = ao.assemble({"block": free}).layout.members["block"]
    n, components = free.size, member.part.form.components
    node, dof, x = np.zeros(n, dtype=int), np.zeros(n, dtype=int), np.zeros((n, 3))
    for k, name in enumerate("xyz"):
        rows = np.arange(components[name][0], n, member.block)
        node[rows], dof[rows], x[rows] = np.arange(len(rows)) + 1, k + 1, member.nodes
    return ao.Structure.from_matrices(csr(free.K), csr(free.M), map=(node, dof, x))


def _above(name: str) -> tuple[float, ...]:
    return tuple(LIFT.placed(np.array([[*FEET[name], 0.0]]))[0])


def with_dampers(model: ao.AntiOscillators) -> ao.AntiOscillators:
    count = len(model.k0) + model.n
    return replace(model, m=None, damping=ao.DampingMatrix(np.eye(count)))


WRONG = [
    (lambda: ao.extract(block(), ao.Site(TOP, (0, 0, -1)), n=2), "a model of named sites"),
    (
        lambda: replace(condensed(2), m=None, damping=ao.Damping(ratio=0.01)),
        "without damping",
    ),
    (lambda: with_dampers(condensed(2)), "without damping"),
    (lambda: ao.Structure.from_matrices([[1.0]], [[1.0]]), "no mesh, and its matrices no map"),
    (
        lambda: ao.Structure.from_matrices([[1.0]], [[1.0]], map=[[1, 3]]),
        "need coordinates",
    ),
]


@pytest.mark.parametrize(("make", "words"), WRONG)
def test_what_is_no_superelement_is_refused(make, words):
    with pytest.raises(ao.InputError, match=words):
        ao.assemble({"plate": plate(), "ecu": make()}, [])


def test_one_direction_is_joined_by_a_bushing_or_an_equation():
    """A site with one direction is joined along it, as between two plates that slide."""
    model = condensed(8, tangential=False)
    with pytest.raises(ao.InputError, match="a displacement that 'ecu:a' does not have"):
        named(model)
    at = {"ecu": LIFT}
    joints = [
        ao.Equation([(("plate", _above(name)), "z", 1.0), (f"ecu:{name}", "z", -1.0)])
        for name in FEET
    ]
    part = ao.assemble({"plate": plate(), "ecu": model}, joints, at)
    soft = ao.assemble(
        {"plate": plate(), "ecu": model},
        [ao.Bushing(("plate", _above(name)), f"ecu:{name}", {"z": 1e12}) for name in FEET],
        at,
    )
    first, second = (ao.extract(one, CORNER, n=10).dynamic_stiffness(OMEGA) for one in (part, soft))
    np.testing.assert_allclose(first, second, rtol=1e-4)
    for joint, words in (
        (ao.Equation([("ecu:a", "x", 1.0)]), "no component 'x'"),
        (ao.Bushing(("plate", _above("a")), "ecu:a", {"x": 1e5}), "acts on x, a displacement"),
        (ao.Bushing("plate:x1", "ecu:a", {"axial": 1e5}), "a displacement that"),
    ):
        with pytest.raises(ao.InputError, match=words):
            ao.assemble({"plate": plate(), "ecu": model}, [joint, *joints], at)
