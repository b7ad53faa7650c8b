"""The numbers that an impact depends on, each with the impact in which it has another value."""

from __future__ import annotations

from collections.abc import Callable, Mapping
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
from antiosc.base.errors import InputError
from antiosc.engine.damping import from_factors
from antiosc.extension import Impact, assemble_pair, set_initial_forces
from antiosc.impact.assembly import Assembly, assemble_scene

Turn = Callable[[AntiOscillators], AntiOscillators]
#: Numbers by name: one, a list of them, a dict of them, or None of one that cannot decrease.
Numbers = dict[str, Any]


@dataclass(frozen=True)
class Number:
    """A number of an impact.

    value : its value; size : what steps of it are relative to, > 0.
    posed : function of another value that returns the impact with it.
    wide : whether steps are so long that the differences of two are extrapolated.
    """

    value: float
    size: float
    posed: Callable[[float], Assembly]
    wide: bool = False


class Struck:
    """The bodies and contacts of a run, which can be exchanged.

    turn : function of the model "structure", applied to it wherever it comes from.
    """

    def __init__(self, hit: History, turn: Turn | None = None) -> None:
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
        self._pair: Impact | None = getattr(hit.source, "impact", None)
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
            start = (motion or {}).get("structure", self._pair.initial_velocity)
            assembly = assemble_pair(
                self._pair._replace(
                    model=model, impactor=impactor, contact=contact.law, gap=contact.gap,
                    initial_velocity=start,
                )
            )  # fmt: skip
        set_initial_forces(assembly)
        return assembly

    def start(self, name: str) -> Any:
        """The motion of a body at the start: a number, a `Motion`, or 0."""
        if self._pair is None:
            return self.scene.motion.get(name, 0.0)
        return self._pair.initial_velocity if name == "structure" else 0.0

    def closing(self, name: str) -> float:
        """Speed [m/s] with which a body closes its first contact at the start."""
        system, span = self.base.system, self.base.spans[name]
        rows = system.beta[: len(system.laws), span]
        return next((float(row @ system.v[span]) for row in rows if row.any()), 0.0)


def number(value: float, posed: Callable[[float], Assembly]) -> Number:
    """A number whose steps are relative to itself."""
    return Number(value, abs(value), posed)


def of_body(struck: Struck, name: str) -> Numbers:
    """The numbers of a body with one site."""
    body: Any = struck.scene.bodies[name]
    is_impactor = isinstance(body, Impactor)
    inner = body.body if is_impactor else body

    def posed(other: Any) -> Assembly:
        return struck.posed({name: other})

    def posed_inner(other: Any) -> Assembly:
        return posed(replace(body, body=other) if is_impactor else other)

    def moving(v: float) -> Assembly:
        return posed(
            RigidMass(body.mass, v) if isinstance(body, Sphere) else replace(body, velocity=v)
        )

    numbers: Numbers = {}
    if isinstance(inner, RigidMass | Sphere):
        speed = inner.velocity
        numbers["mass"] = number(inner.mass, lambda m: posed_inner(RigidMass(m, speed)))
    elif isinstance(inner, AntiOscillators) and not inner.sites:
        numbers |= _of_model(inner, posed_inner)
    else:
        return {}

    if is_impactor or isinstance(body, RigidMass | Sphere):
        if not isinstance(body.velocity, Motion) and body.velocity:
            numbers["velocity"] = number(body.velocity, moving)
        return numbers

    start, closing = struck.start(name), struck.closing(name)
    if closing and isinstance(start, int | float | Motion):
        numbers["initial_velocity"] = number(
            closing, lambda v: struck.posed(motion={name: _scaled(start, v / closing)})
        )
    return numbers


def _scaled(start: float | Motion, factor: float) -> float | Motion:
    """A motion at the start, times a factor."""
    if not isinstance(start, Motion):
        return start * factor
    velocity, spin = ([factor * x for x in vector] for vector in (start.velocity, start.spin))
    return replace(start, velocity=velocity, spin=spin)


def _of_model(model: AntiOscillators, posed: Callable[[AntiOscillators], Assembly]) -> Numbers:
    """The parameters of a model of one site, and a factor on damping that couples its modes."""
    nothing: Any = dict.fromkeys(("shapes", "hidden", "strain_error", "strain_misfit", "stretch"))
    light = replace(model, **nothing)

    def with_field(name: str, value: Any) -> Assembly:
        return posed(replace(light, **{name: value}))

    def with_entry(name: str, i: int, value: float) -> Assembly:
        entries = getattr(light, name)
        return with_field(name, np.where(np.arange(entries.size) == i, value, entries))

    numbers: Numbers = {}
    for name in ("m0", "k0"):
        value = float(getattr(light, name))
        numbers[name] = number(value, partial(with_field, name)) if value > 0 else None
    for name in ("m", "omega"):
        entries = getattr(light, name).tolist()
        numbers[name] = [number(x, partial(with_entry, name, i)) for i, x in enumerate(entries)]

    damping = model.damping
    if isinstance(damping, DampingMatrix):

        def damped(factor: float) -> Assembly:
            root = np.sqrt(factor)
            factors = [(root * L, tau) for L, tau in damping.factors]
            return with_field("damping", from_factors(root * damping.factor, factors))

        numbers["damping"] = number(1.0, damped)
    return numbers


def of_contact(struck: Struck, i: int) -> Numbers:
    """The numbers of a contact: of its law, its gap, its friction."""
    contact = struck.scene.contacts[i]
    law: Any = contact.law
    marched: Any = struck.base.laws[i]
    depth = float(struck.base.system.depth[i])

    def with_field(name: str, value: Any) -> Assembly:
        return struck.posed(contacts={i: replace(contact, **{name: value})})

    def law_with(name: str, value: float) -> Assembly:
        return with_field("law", replace(law, **{name: value}))

    def with_compliance(value: float) -> Assembly:
        assembly = struck.posed()
        laws = list(assembly.system.laws)
        laws[i] = replace(marched, compliance=value)
        return replace(assembly, laws=laws, system=replace(assembly.system, laws=laws))

    numbers: Numbers = {}
    given = {f.name: getattr(law, f.name) for f in fields(law) if f.init} if _made(law) else {}
    for name, value in given.items():
        if name != "compliance" and type(value) in (int, float):
            numbers[name] = Number(value, abs(value) or 1.0, partial(law_with, name))

    if numbers and _made(marched) and "compliance" in {f.name for f in fields(marched)}:
        stiffness = float(law.tangent(depth, 0.0, law.touch(0.0))[0])
        size = marched.compliance or (1 / stiffness if stiffness > 0 else 1.0)
        numbers["compliance"] = Number(marched.compliance, size, with_compliance)

    ends = (struck.base.bodies[end.partition(":")[0]] for end in (contact.a, contact.b))
    gap = sum(body.gap for body in ends) if contact.gap is None else contact.gap
    numbers["gap"] = Number(gap, max(abs(gap), depth), partial(with_field, "gap"))
    for name in ("friction", "tangential_stiffness"):
        value = getattr(contact, name)
        if contact.friction > 0 and value is not None:
            numbers[name] = number(value, partial(with_field, name))
    return numbers


def _made(law: Any) -> bool:
    """Whether a law is made of fields; one of the user need not be."""
    return is_dataclass(law)
