"""The numbers that an impact depends on, each with the impact in which it has another value."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from antiosc import (
    AntiOscillators,
    Contact,
    DampingMatrix,
    History,
    Impactor,
    Motion,
    RigidMass,
    Sphere,
)
from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.engine.damping import from_factors
from antiosc.extension import Impact, assemble_pair, set_initial_forces
from antiosc.impact.assembly import Assembly, assemble_scene

#: Parameters of a model of one site.
OF_MODEL = ("m0", "k0", "m", "omega", "damping")


@dataclass(frozen=True)
class Number:
    """A number of an impact.

    value : its value; size : what steps of it are relative to, > 0.
    posed : function of another value that returns the impact with it.
    """

    value: float
    size: float
    posed: Callable[[float], Assembly]


class Struck:
    """The bodies and contacts of a run, which can be exchanged.

    turn : function of the model "structure", applied to it wherever it comes from.
    """

    def __init__(
        self, hit: History, turn: Callable[[AntiOscillators], AntiOscillators] | None = None
    ) -> None:
        if not isinstance(hit, History):
            raise InputError(
                f"hit must be a History of simulate or Scene.run; got {checks.shown(hit)}."
            )
        if hit.assembly.stretched:
            raise InputError(
                f"{next(iter(hit.assembly.stretched))!r} stretched in this impact: gradients are of"
                " linear bodies; extract it with stretch=False."
            )
        self.scene = hit.assembly.scene
        self.end = float(hit.run.time[-1])
        self.turn = turn
        given = getattr(hit.rerun, "args", ())
        self._pair = given[0] if given and isinstance(given[0], Impact) else None
        self.base = self.posed()
        a, b = self.base.system, hit.assembly.system
        same = a.beta.shape == b.beta.shape and all(map(np.array_equal, a.numbers, b.numbers))
        if turn is None and not same:
            raise InputError("hit must be a whole run, as simulate and Scene.run return it.")

    def posed(
        self,
        bodies: Mapping[str, Any] | None = None,
        contacts: Mapping[int, Contact] | None = None,
        motion: Mapping[str, Any] | None = None,
    ) -> Assembly:
        """The impact with other bodies, contacts or motions at the start."""
        scene = self.scene
        all_bodies = {**scene.bodies, **(bodies or {})}
        all_contacts = [(contacts or {}).get(i, c) for i, c in enumerate(scene.contacts)]
        if self.turn is not None:
            all_bodies["structure"] = self.turn(all_bodies["structure"])

        if self._pair is None:
            starts = {**scene.motion, **(motion or {})}
            changes: dict[str, Any] = {"bodies": all_bodies, "contacts": all_contacts}
            assembly = assemble_scene(replace(scene, **changes, motion=starts), self.end)
        else:
            model, impactor = all_bodies.values()
            (contact,) = all_contacts
            pair = self._pair._replace(
                model=model, impactor=impactor, contact=contact.law, gap=contact.gap
            )
            if motion:
                pair = pair._replace(initial_velocity=motion["structure"])
            assembly = assemble_pair(pair)

        set_initial_forces(assembly)
        return assembly

    def start(self, name: str) -> Any:
        """The motion of a body at the start: a number, a `Motion`, or 0."""
        if self._pair is None:
            return self.scene.motion.get(name, 0.0)
        return self._pair.initial_velocity if name == "structure" else 0.0

    def closing(self, name: str) -> float:
        """Speed [m/s] with which a body closes its first contact at the start."""
        system = self.base.system
        span = self.base.spans[name]
        for row in system.beta[: len(system.laws), span]:
            if row.any():
                return float(row @ system.v[span])
        return 0.0


def of_body(struck: Struck, name: str) -> dict[str, Number | list[Number] | None]:
    """The numbers of a body with one site; None for those that cannot decrease."""
    body = struck.scene.bodies[name]

    def posed(other: Any) -> Assembly:
        return struck.posed(bodies={name: other})

    inner = body.body if isinstance(body, Impactor) else body
    outer = partial(replace, body) if isinstance(body, Impactor) else None

    def posed_inner(other: Any) -> Assembly:
        return posed(other if outer is None else outer(body=other))

    numbers: dict[str, Number | list[Number] | None] = {}
    if isinstance(inner, RigidMass | Sphere):
        speed = inner.velocity
        numbers["mass"] = Number(inner.mass, inner.mass, lambda m: posed_inner(RigidMass(m, speed)))
    elif isinstance(inner, AntiOscillators) and not inner.sites:
        numbers |= _of_model(inner, posed_inner)
    else:
        return {}

    velocity = getattr(body, "velocity", 0.0)
    if isinstance(body, RigidMass | Sphere | Impactor):
        if not isinstance(velocity, Motion) and velocity:
            numbers["velocity"] = Number(
                velocity, abs(velocity), lambda v: posed(_with_speed(body, v))
            )
        return numbers

    start, closing = struck.start(name), struck.closing(name)
    if closing and isinstance(start, int | float | Motion):
        numbers["initial_velocity"] = Number(
            closing,
            abs(closing),
            lambda v: struck.posed(motion={name: _scaled(start, v / closing)}),
        )
    return numbers


def _with_speed(body: Any, speed: float) -> Any:
    """A striker with another velocity."""
    if isinstance(body, Sphere):
        return RigidMass(body.mass, speed)
    return replace(body, velocity=speed)


def _scaled(start: float | Motion, factor: float) -> float | Motion:
    """A motion at the start, times a factor."""
    if not isinstance(start, Motion):
        return start * factor
    velocity, spin = ([factor * x for x in vector] for vector in (start.velocity, start.spin))
    return replace(start, velocity=velocity, spin=spin)


def _of_model(
    model: AntiOscillators, posed: Callable[[AntiOscillators], Assembly]
) -> dict[str, Number | list[Number] | None]:
    """The parameters of a model of one site, and a factor on damping that couples its modes."""
    light = replace(
        model, shapes=None, hidden=None, strain_error=None, strain_misfit=None, stretch=None
    )

    def with_entry(name: str, i: int, value: float) -> Assembly:
        entries = getattr(light, name).copy()
        entries[i] = value
        return posed(replace(light, **{name: entries}))

    numbers: dict[str, Number | list[Number] | None] = {}
    for name in ("m0", "k0"):
        value = float(getattr(light, name))

        def changed(x: float, name: str = name) -> Assembly:
            return posed(replace(light, **{name: x}))  # type: ignore[arg-type]

        numbers[name] = Number(value, value, changed) if value > 0 else None
    for name in ("m", "omega"):
        entries = getattr(light, name).tolist()
        numbers[name] = [Number(x, x, partial(with_entry, name, i)) for i, x in enumerate(entries)]

    damping = model.damping
    if isinstance(damping, DampingMatrix):

        def damped(factor: float) -> Assembly:
            root = np.sqrt(factor)
            factors = [(root * L, tau) for L, tau in damping.factors]
            return posed(replace(light, damping=from_factors(root * damping.factor, factors)))

        numbers["damping"] = Number(1.0, 1.0, damped)
    return numbers


def of_contact(struck: Struck, i: int) -> dict[str, Number]:
    """The numbers of a contact: of its law, its gap, its friction."""
    contact = struck.scene.contacts[i]
    law: Any = contact.law
    depth = float(struck.base.system.depth[i])

    def posed(**changes: Any) -> Assembly:
        return struck.posed(contacts={i: replace(contact, **changes)})

    def with_field(name: str, value: float) -> Assembly:
        return posed(**{name: value})

    def law_with(name: str, value: float) -> Assembly:
        return posed(law=replace(law, **{name: value}))

    numbers: dict[str, Number] = {}
    for name, value in _fields(law):
        numbers[name] = Number(value, abs(value) or 1.0, partial(law_with, name))

    marched = struck.base.laws[i]
    if numbers and hasattr(marched, "compliance") and is_dataclass(marched):

        def with_compliance(value: float) -> Assembly:
            assembly = struck.posed()
            laws = list(assembly.system.laws)
            laws[i] = replace(marched, compliance=value)  # type: ignore[type-var]
            return replace(assembly, laws=laws, system=replace(assembly.system, laws=laws))

        size = marched.compliance or _softness(law, depth)
        numbers["compliance"] = Number(marched.compliance, size, with_compliance)

    ends = (struck.base.bodies[end.partition(":")[0]] for end in (contact.a, contact.b))
    gap = sum(body.gap for body in ends) if contact.gap is None else contact.gap
    numbers["gap"] = Number(gap, max(abs(gap), depth), lambda x: posed(gap=x))
    for name in ("friction", "tangential_stiffness"):
        value = getattr(contact, name)
        if contact.friction > 0 and value is not None:
            numbers[name] = Number(value, value, partial(with_field, name))
    return numbers


def _fields(law: Any) -> Iterator[tuple[str, float]]:
    """Names and values of the numbers that a law is made of, but for its compliance."""
    for field in fields(law) if is_dataclass(law) else ():
        value = getattr(law, field.name)
        if field.init and field.name != "compliance" and type(value) in (int, float):
            yield field.name, float(value)


def _softness(law: Any, depth: float) -> float:
    """Change of indentation over that of force [m/N] of a law at a depth [m]."""
    stiffness = float(law.tangent(depth, 0.0, law.touch(0.0))[0])
    return 1 / stiffness if stiffness > 0 else 1.0


def filled(numbers: Mapping[str, Any], derive: Callable[[str, Number], Array]) -> dict[str, Any]:
    """Results (..., 2, k) of `derive` by name, of lists of numbers along the first axis."""
    results: dict[str, Any] = {}
    for name, number in numbers.items():
        if isinstance(number, list):
            found = [derive(name, one) for one in number]
            results[name] = np.array(found) if found else np.zeros((0, 2, 2))
        elif isinstance(number, dict):
            results[name] = filled(number, derive)
        else:
            results[name] = None if number is None else derive(name, number)
    return results
