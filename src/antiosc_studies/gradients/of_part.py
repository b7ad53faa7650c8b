"""The numbers of the part from which a model was extracted, each with a new extraction."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from functools import cache, partial
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from antiosc import AntiOscillators, DampingMatrix, History, Site, Structure, extract
from antiosc.base import checks
from antiosc.base.errors import InputError, without_warnings
from antiosc.fem.structure.structure import refuse_prestress
from antiosc.impact.assembly import Assembly
from antiosc_studies.gradients.numbers import (
    NumberTree,
    VariableImpact,
    VariableNumber,
    mapped_leaves,
)

#: Size of a number over its value, for steps of a hundredth: where a site excites some modes by
#: rounding alone, the highest anti-oscillators of two extractions differ by 1e-4.
INPUT_STEP_SCALE = 100.0
#: The same of an input that is 0.
ZERO_STEP_SCALE = 10.0
#: Largest relative difference of the static masses of the run's model and that extracted again.
STATIC_MASS_TOL = 1e-3
#: Numbers of materials on which K and M do not depend.
UNUSED_MATERIAL_NUMBERS = {"loss", "yield_strength", "tensile", "rate"}

#: A value, the size of its steps, and the model for another value.
VariedInput = tuple[float, float, Callable[[float], AntiOscillators]]


class PartModels:
    """Models with one input of a part changed; `part`: a Structure, or a function of x."""

    def __init__(self, part: Any, x: ArrayLike | None, hit: History) -> None:
        self.name = model_name(hit)
        self._model = cast("Any", hit.assembly.scene.bodies[self.name])
        built, self._tree = part, {}

        if isinstance(part, Structure):
            self._tree = self._inputs_of_structure(part)
        else:
            checks.function("part", part, "a Structure, or a function of x that builds one")
            if x is None:
                raise InputError("part is a function of x: give the x at which the run was made.")
            x = checks.column("x", x)
            built = part(x)
            fine = isinstance(built, AntiOscillators)
            self._tree = {"x": self._inputs_of_function(part, x, fine)}

        self._middle: AntiOscillators = self._extracted_again(built)
        off = np.abs(self._middle.m_st - self._model.m_st).max()
        if off > STATIC_MASS_TOL * np.abs(self._model.m_st).max():
            raise InputError(
                "part must give the model of this run: the mass at its site is another."
            )

    def assembly_again(self, impact: VariableImpact) -> Assembly:
        """The impact on the newly extracted model."""
        return impact.assembly_with({self.name: self._middle})

    def numbers_of_part(self, impact: VariableImpact) -> NumberTree:
        """The numbers of the part by name, each with the impact on the changed part."""

        def number(varied: VariedInput) -> VariableNumber:
            value, size, model = varied

            def assembly_with(changed: float) -> Assembly:
                return impact.assembly_with({self.name: model(changed)})

            return VariableNumber(value, size, assembly_with, extrapolates=size > abs(value))

        return mapped_leaves(number, self._tree)  # type: ignore[no-any-return]

    def _inputs_of_function(
        self, part: Callable[..., object], x: Any, fine: bool
    ) -> list[VariedInput]:
        """The entries of the argument x of a function.

        fine : whether it returns models, so that no extraction limits how small steps may be.
        """

        def model_of(i: int, value: float) -> AntiOscillators:
            return self._extracted_again(part(np.where(np.arange(x.size) == i, value, x)))

        coarse = 1.0 if fine else INPUT_STEP_SCALE
        return [
            (value, coarse * abs(value) or ZERO_STEP_SCALE, cache(partial(model_of, i)))
            for i, value in enumerate(x.tolist())
        ]

    def _inputs_of_structure(self, part: Structure) -> NumberTree:
        """The numbers of a part's material by name; {name: {group: …}} for several materials."""
        refuse_prestress(part, "a gradient by the numbers of a part")
        made_of: tuple[Any, Any, Any] = part.made_of or (None, {}, {})
        mesh, materials, options = made_of
        several = isinstance(materials, Mapping)
        groups = materials if several else {"": materials}

        def model_of(group: str, name: str, value: float) -> AntiOscillators:
            changed = replace(groups[group], **{name: value})
            made = {**groups, group: changed} if several else changed
            return self._extracted_again(Structure(mesh, made, part.supports, **options))

        tree: NumberTree = {}
        for group, material in groups.items():
            for name, value in material_numbers(material).items():
                size = INPUT_STEP_SCALE * abs(value)
                varied = value, size, cache(partial(model_of, group, name))
                if several:
                    tree.setdefault(name, {})[group] = varied
                else:
                    tree[name] = varied

        if not tree:
            raise InputError(
                "this part's materials are not known, or have no numbers of their own, as those of"
                " an assembly, of matrices or of layers: give a function of x that builds the part,"
                " and x."
            )
        return tree

    def _extracted_again(self, built: object) -> AntiOscillators:
        """The model of a part, extracted with the options of the run's model."""
        if isinstance(built, AntiOscillators):
            return built
        part = checks.instance("build(x)", built, Structure, "a Structure, or the model of one")
        model = self._model
        estimate = "estimate" if model.strain_error is not None else None
        method: Any = {"method": "modes"} if model.info.method == "modes" else {"error": estimate}
        with without_warnings():
            found = extract(part, site_of(model), model.n, **method)

        # dampers of the part are in the coordinates of its own model
        coupled = isinstance(found.damping, DampingMatrix)
        return found if coupled else replace(found, damping=model.damping)


def model_name(hit: History) -> str:
    """The name of the only body that is an extracted model."""
    checks.instance("hit", hit, History, "a History of simulate or Scene.run")
    bodies = hit.assembly.scene.bodies
    models = [name for name, body in bodies.items() if isinstance(body, AntiOscillators)]
    if len(models) != 1:
        raise InputError(
            f"part needs a run with one extracted model; this one has {len(models)} models."
        )
    return models[0]


def material_numbers(material: Any) -> dict[str, float]:
    """The numbers of a material on which K and M depend, by name."""
    unused = UNUSED_MATERIAL_NUMBERS
    if getattr(material, "plane", "") is None:
        unused = unused | {"thickness"}
    names = {item.name for item in fields(material) if item.init} - unused
    values = {name: getattr(material, name) for name in sorted(names)}
    return {name: value for name, value in values.items() if value and isinstance(value, float)}


def site_of(model: AntiOscillators) -> Site:
    """The site of an extracted model; InputError if it is unknown."""
    info = model.info
    if model.sites or info.point is None or info.direction is None:
        raise InputError(
            "the place of the site is not known: give a function of x that returns the model."
        )
    return Site(info.point, info.direction, model.patch_radius, snap=True)
