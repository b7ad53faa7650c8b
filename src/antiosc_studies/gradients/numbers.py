"""The numbers on which an impact depends, each with a function that changes it in the impact."""

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
from antiosc.impact.assembly import Assembly, assemble_scene
from antiosc.impact.two_bodies import Impact, assemble_pair
from antiosc.models.stretch import refuse_stretch

ModelChange = Callable[[AntiOscillators], AntiOscillators]
#: Numbers by name: one, a list of them, a dict of them, or None of one that cannot decrease.
NumberTree = dict[str, Any]


@dataclass(frozen=True)
class VariableNumber:
    """A number on which an impact depends."""

    value: float
    step_scale: float  # what steps of it are relative to, > 0
    assembly_with: Callable[[float], Assembly]  # the impact with another value
    extrapolates: bool = False  # steps are so long that the differences of two are extrapolated


def mapped_leaves(function: Callable[..., Any], first_tree: Any, *other_trees: Any) -> Any:
    """Apply `function` to the leaves at each place of several trees (nested dicts and lists)."""
    trees = (first_tree, *other_trees)
    if isinstance(first_tree, dict):
        return {
            name: mapped_leaves(function, *(tree[name] for tree in trees)) for name in first_tree
        }
    if isinstance(first_tree, list):
        made = [mapped_leaves(function, *row) for row in zip(*trees, strict=True)]
        return np.array(made) if all(isinstance(one, float) for one in made) else made
    return None if first_tree is None else function(*trees)


def relative_number(value: float, assembly_with: Callable[[float], Assembly]) -> VariableNumber:
    """A number with steps relative to its value."""
    return VariableNumber(value, abs(value), assembly_with)


class VariableImpact:
    """The bodies and contacts of a run, which can be replaced.

    change_model : function that changes the model "structure" before every run; None: no change.
    """

    def __init__(self, hit: History, change_model: ModelChange | None = None) -> None:
        checks.instance("hit", hit, History, "a History of simulate or Scene.run")
        if hit.assembly.stretch_forces:
            raise InputError(
                f"{next(iter(hit.assembly.stretch_forces))!r} stretched in this impact: gradients"
                " are of linear bodies; extract it with stretch=False."
            )
        self.scene = hit.assembly.scene
        self.end = hit.run.time[-1]
        self.change_model = change_model
        self._pair: Impact | None = getattr(hit.source, "impact", None)
        self.base = self.assembly_with()

        a, b = self.base.system, hit.assembly.system
        same = a.beta.shape == b.beta.shape and all(map(np.array_equal, a.arrays, b.arrays))
        if change_model is None and not same:
            raise InputError("hit must be a whole run, as simulate and Scene.run return it.")

    def assembly_with(
        self,
        bodies: Mapping[str, Any] | None = None,
        contacts: Mapping[int, Contact] | None = None,
        starts: Mapping[str, float] | None = None,
    ) -> Assembly:
        """The impact with other bodies or contacts, or other initial speeds of models."""
        scene = self.scene
        all_bodies = {**scene.bodies, **(bodies or {})}
        all_contacts = [(contacts or {}).get(i, c) for i, c in enumerate(scene.contacts)]
        if self.change_model is not None:
            all_bodies["structure"] = self.change_model(all_bodies["structure"])

        refuse_stretch(all_bodies)
        if self._pair is None:
            motion = {**scene.motion, **(starts or {})}
            changes: dict[str, Any] = {"bodies": all_bodies, "contacts": all_contacts}
            assembly = assemble_scene(replace(scene, **changes, motion=motion), self.end)
        else:
            model, impactor = all_bodies.values()
            (contact,) = all_contacts
            start = (starts or {}).get("structure", self._pair.initial_velocity)
            moved = self.end, start, self._pair.gravity, contact.gap
            assembly = assemble_pair(Impact(model, impactor, contact.law, *moved))
        set_initial_forces(assembly.system, assembly.scene.preload)
        return assembly

    def initial_speed(self, name: str) -> float:
        """The initial speed [m/s] of a model; 0 if it is at rest or moves in space."""
        if self._pair is None:
            start = self.scene.motion.get(name, 0.0)
        else:
            start = self._pair.initial_velocity if name == "structure" else 0.0
        return start if isinstance(start, int | float) else 0.0


def numbers_of_body(impact: VariableImpact, name: str) -> NumberTree:
    """The numbers of a body with one site."""
    body: Any = impact.scene.bodies[name]
    is_impactor = isinstance(body, Impactor)
    inner = body.body if is_impactor else body

    def with_body(other: Any) -> Assembly:
        return impact.assembly_with({name: replace(body, body=other) if is_impactor else other})

    def with_mass(m: float) -> Assembly:
        return with_body(RigidMass(m, inner.velocity))

    def with_speed(v: float) -> Assembly:
        sphere = isinstance(body, Sphere)
        moved = RigidMass(body.mass, v) if sphere else replace(body, velocity=v)
        return impact.assembly_with({name: moved})

    def with_start(v: float) -> Assembly:
        return impact.assembly_with(starts={name: v})

    numbers: NumberTree = {}
    if isinstance(inner, RigidMass | Sphere):
        numbers["mass"] = relative_number(inner.mass, with_mass)
    elif isinstance(inner, AntiOscillators) and not inner.sites:
        numbers |= _numbers_of_model(inner, with_body)
        if start := impact.initial_speed(name):
            numbers["initial_velocity"] = relative_number(start, with_start)
    else:
        return {}

    speed = getattr(body, "velocity", 0.0)
    if not isinstance(speed, Motion) and speed:
        numbers["velocity"] = relative_number(speed, with_speed)
    return numbers


def _numbers_of_model(
    model: AntiOscillators, posed: Callable[[AntiOscillators], Assembly]
) -> NumberTree:
    """The parameters of a model of one site, and a factor on damping that couples its modes."""
    nothing: Any = dict.fromkeys(("shapes", "hidden", "strain_error", "strain_misfit", "stretch"))
    light = replace(model, **nothing)

    def with_field(name: str, value: Any) -> Assembly:
        return posed(replace(light, **{name: value}))

    def with_entry(name: str, i: int, value: float) -> Assembly:
        entries = getattr(light, name)
        return with_field(name, np.where(np.arange(entries.size) == i, value, entries))

    numbers: NumberTree = {}
    for name in ("m0", "k0"):
        value = float(getattr(light, name))
        numbers[name] = relative_number(value, partial(with_field, name)) if value > 0 else None
    for name in ("m", "omega"):
        entries = enumerate(getattr(light, name).tolist())
        numbers[name] = [relative_number(x, partial(with_entry, name, i)) for i, x in entries]

    damping = model.damping
    if isinstance(damping, DampingMatrix):

        def with_damping_factor(factor: float) -> Assembly:
            root = np.sqrt(factor)
            factors = [(root * L, tau) for L, tau in damping.factors]
            return with_field("damping", from_factors(root * damping.factor, factors))

        numbers["damping"] = relative_number(1.0, with_damping_factor)
    return numbers


def numbers_of_contact(impact: VariableImpact, i: int) -> NumberTree:
    """The numbers of a contact: parameters of its law, gap, friction."""
    contact = impact.scene.contacts[i]
    law: Any = contact.law

    def with_field(name: str, value: Any) -> Assembly:
        return impact.assembly_with(contacts={i: replace(contact, **{name: value})})

    def law_with(name: str, value: float) -> Assembly:
        return with_field("law", replace(law, **{name: value}))

    numbers: NumberTree = {}
    for item in fields(law) if is_dataclass(law) else ():
        value = getattr(law, item.name)
        if item.init and type(value) in (int, float) and value:
            numbers[item.name] = relative_number(value, partial(law_with, item.name))

    ends = (impact.base.bodies[end.partition(":")[0]] for end in (contact.a, contact.b))
    gap = sum(body.gap for body in ends) if contact.gap is None else contact.gap
    size = max(abs(gap), impact.base.system.contacts["expected_depth"][i])
    numbers["gap"] = VariableNumber(gap, size, partial(with_field, "gap"))
    for name in ("friction", "tangential_stiffness"):
        value = getattr(contact, name)
        if contact.friction > 0 and value is not None:
            numbers[name] = relative_number(value, partial(with_field, name))
    return numbers
