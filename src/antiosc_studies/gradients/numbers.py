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
from antiosc.engine.equilibrium import set_initial_forces
from antiosc.extension import Impact, assemble_pair
from antiosc.impact.assembly import Assembly, assemble_scene
from antiosc.models.stretch import refuse_stretch

ModelChange = Callable[[AntiOscillators], AntiOscillators]
#: Numbers by name: one, a list of them, a dict of them, or None of one that cannot decrease.
Numbers = dict[str, Any]


@dataclass(frozen=True)
class Number:
    """A number that an impact depends on."""

    value: float  # its value
    size: float  # what steps of it are relative to, > 0
    posed: Callable[[float], Assembly]  # function of another value that returns the impact with it
    wide: bool = False  # whether steps are so long that the differences of two are extrapolated


def mapped(pick: Callable[..., Any], first: Any, *others: Any) -> Any:
    """Apply `pick` to the leaves at each place of several trees (nested dicts and lists)."""
    if isinstance(first, dict):
        return {
            name: mapped(pick, value, *(tree[name] for tree in others))
            for name, value in first.items()
        }
    if isinstance(first, list):
        made = [mapped(pick, *row) for row in zip(first, *others, strict=True)]
        return np.array(made) if all(isinstance(one, float) for one in made) else made
    return None if first is None else pick(first, *others)


def number(value: float, posed: Callable[[float], Assembly]) -> Number:
    """A number whose steps are relative to its own value."""
    return Number(value, abs(value), posed)


class VariableImpact:
    """The bodies and contacts of a run, which can be exchanged.

    turn : function that changes the model "structure" before every run; None: it stays.
    """

    def __init__(self, hit: History, turn: ModelChange | None = None) -> None:
        checks.instance("hit", hit, History, "a History of simulate or Scene.run")
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
        starts: Mapping[str, float] | None = None,
    ) -> Assembly:
        """The impact with other bodies or contacts, or other speeds of models at the start."""
        scene = self.scene
        all_bodies = {**scene.bodies, **(bodies or {})}
        all_contacts = [(contacts or {}).get(i, c) for i, c in enumerate(scene.contacts)]
        if self.turn is not None:
            all_bodies["structure"] = self.turn(all_bodies["structure"])

        refuse_stretch(all_bodies)
        if self._pair is None:
            motion = {**scene.motion, **(starts or {})}
            changes: dict[str, Any] = {"bodies": all_bodies, "contacts": all_contacts}
            assembly = assemble_scene(replace(scene, **changes, motion=motion), self.end)
        else:
            model, impactor = all_bodies.values()
            (contact,) = all_contacts
            start = (starts or {}).get("structure", self._pair.initial_velocity)
            pair = Impact(
                model, impactor, contact.law, self.end, start, self._pair.gravity, contact.gap
            )
            assembly = assemble_pair(pair)
        set_initial_forces(assembly.system, assembly.scene.preload)
        return assembly

    def start(self, name: str) -> float:
        """The speed [m/s] of a model at the start; 0: it rests, or moves in space."""
        if self._pair is None:
            start = self.scene.motion.get(name, 0.0)
        else:
            start = self._pair.initial_velocity if name == "structure" else 0.0
        return start if isinstance(start, int | float) else 0.0


def of_body(struck: VariableImpact, name: str) -> Numbers:
    """The numbers of a body with one site."""
    body: Any = struck.scene.bodies[name]
    is_impactor = isinstance(body, Impactor)
    inner = body.body if is_impactor else body

    def posed(other: Any) -> Assembly:
        return struck.posed({name: replace(body, body=other) if is_impactor else other})

    def moving(v: float) -> Assembly:
        sphere = isinstance(body, Sphere)
        return struck.posed(
            {name: RigidMass(body.mass, v) if sphere else replace(body, velocity=v)}
        )

    numbers: Numbers = {}
    if isinstance(inner, RigidMass | Sphere):
        numbers["mass"] = number(inner.mass, lambda m: posed(RigidMass(m, inner.velocity)))
    elif isinstance(inner, AntiOscillators) and not inner.sites:
        numbers |= _of_model(inner, posed)
        if start := struck.start(name):
            numbers["initial_velocity"] = number(start, lambda v: struck.posed(starts={name: v}))
    else:
        return {}

    speed = getattr(body, "velocity", 0.0)
    if not isinstance(speed, Motion) and speed:
        numbers["velocity"] = number(speed, moving)
    return numbers


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


def of_contact(struck: VariableImpact, i: int) -> Numbers:
    """The numbers of a contact: of its law, its gap, its friction."""
    contact = struck.scene.contacts[i]
    law: Any = contact.law

    def with_field(name: str, value: Any) -> Assembly:
        return struck.posed(contacts={i: replace(contact, **{name: value})})

    def law_with(name: str, value: float) -> Assembly:
        return with_field("law", replace(law, **{name: value}))

    numbers: Numbers = {}
    for item in fields(law) if is_dataclass(law) else ():
        value = getattr(law, item.name)
        if item.init and type(value) in (int, float) and value:
            numbers[item.name] = number(value, partial(law_with, item.name))

    ends = (struck.base.bodies[end.partition(":")[0]] for end in (contact.a, contact.b))
    gap = sum(body.gap for body in ends) if contact.gap is None else contact.gap
    size = max(abs(gap), float(struck.base.system.depth[i]))
    numbers["gap"] = Number(gap, size, partial(with_field, "gap"))
    for name in ("friction", "tangential_stiffness"):
        value = getattr(contact, name)
        if contact.friction > 0 and value is not None:
            numbers[name] = number(value, partial(with_field, name))
    return numbers
