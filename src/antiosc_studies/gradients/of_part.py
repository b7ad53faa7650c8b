"""The numbers of the part that a model was extracted from: each with the model extracted again."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from functools import cache, partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from antiosc import AntiOscillators, DampingMatrix, History, Site, Structure, extract
from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError, without_warnings
from antiosc.extension import refuse_prestress
from antiosc.impact.assembly import Assembly
from antiosc_studies.gradients.numbers import Number, Struck

if TYPE_CHECKING:
    pass


#: Size of a number over its value, for steps of a hundredth: where a site excites some modes by
#: rounding alone, the highest anti-oscillators of two extractions differ by 1e-4.
COARSE = 100.0
#: The same of an angle [degree], and of an input that is 0.
ROTATED, OF_ZERO = 5000.0, 10.0
#: Largest relative difference of the static masses of the run's model and that extracted again.
SAME_MODEL = 1e-3
#: Numbers of materials, sections and layers on which K and M do not depend.
IDLE = {"loss", "yield_strength", "yield_range", "tensile", "rate", "outline"}
#: Numbers of a laminate's layers that are design parameters; the others belong to its materials.
OF_LAYERS = {"thickness", "angle"}


class Varied(NamedTuple):
    """A number of a part: its value, the size of its steps, and the model for another value."""

    value: float
    size: float
    model: Callable[[float], AntiOscillators]


class Models:
    """The models of a part, or of a function of x, with one of its numbers changed."""

    def __init__(self, part: Any, x: ArrayLike | None, hit: History) -> None:
        self.name = model_name(hit)
        model: Any = hit.assembly.scene.bodies[self.name]

        def extracted(built: object) -> AntiOscillators:
            return _extracted(built, model)

        if isinstance(part, Structure):
            self._tree = _numbers_of(part, extracted)
            self._middle = extracted(part)
        else:
            checks.function("part", part, "a Structure, or a function of x that builds one", 1)
            if x is None:
                raise InputError("part is a function of x: give the x at which the run was made.")
            values = checks.column("x", x)
            self._tree = {"x": _entries(part, values, extracted)}
            self._middle = extracted(part(values))

        size = np.abs(model.m_st).max()
        if np.abs(self._middle.m_st - model.m_st).max() > SAME_MODEL * size:
            raise InputError(
                "part must give the model of this run: the mass at its site is another."
            )

    def posed(self, struck: Struck) -> Assembly:
        """The impact on the model that is extracted again."""
        return struck.posed(bodies={self.name: self._middle})

    def numbers(self, struck: Struck) -> dict[str, Any]:
        """The numbers of the part, each with the impact on the part with another value."""

        def posed(one: Any) -> Any:
            if isinstance(one, dict):
                return {name: posed(inner) for name, inner in one.items()}
            if isinstance(one, Varied):
                return Number(
                    one.value, one.size, lambda v: struck.posed(bodies={self.name: one.model(v)})
                )
            return [posed(inner) for inner in one]

        return posed(self._tree)  # type: ignore[no-any-return]


def model_name(hit: History) -> str:
    """The name of the only body that is an extracted model."""
    bodies = hit.assembly.scene.bodies
    models = [name for name, body in bodies.items() if isinstance(body, AntiOscillators)]
    if len(models) != 1:
        raise InputError(
            f"part needs a run with one extracted model; this one has {len(models)} models."
        )
    return models[0]


def _entries(
    part: Callable[[Array], object], x: Array, extracted: Callable[[object], AntiOscillators]
) -> list[Varied]:
    """The entries of the argument x of a function that builds a part."""

    def model(i: int, value: float) -> AntiOscillators:
        return extracted(part(np.where(np.arange(x.size) == i, value, x)))

    return [
        Varied(value, COARSE * abs(value) or OF_ZERO, cache(lambda v, i=i: model(i, v)))
        for i, value in enumerate(x.tolist())
    ]


def _numbers_of(part: Structure, extracted: Callable[[object], AntiOscillators]) -> dict[str, Any]:
    """The numbers of a part's materials by name; of several materials {name: {group: …}}."""
    if part.made_of is None:
        raise InputError(
            "the materials of an assembly, or of matrices, are not known: give a function of x that"
            " builds the part, and x."
        )
    refuse_prestress(part, "a gradient by the numbers of a part")
    mesh, materials, options = part.made_of
    is_grouped = isinstance(materials, Mapping)
    groups = dict(materials) if isinstance(materials, Mapping) else {"": materials}

    def model(group: str, vary: Callable[[float], Any], value: float) -> AntiOscillators:
        changed = {**groups, group: vary(value)}
        one = changed if is_grouped else changed[""]
        return extracted(Structure(mesh, one, part.supports, **options))

    tree: dict[str, Any] = {}
    for group, material in groups.items():
        for name, value, vary in _varied(material):
            size = ROTATED if name == "angle" else COARSE * abs(value)
            number = Varied(value, size, cache(partial(model, group, vary)))
            place = tree.setdefault(name, {}) if is_grouped else tree
            key = group if is_grouped else name
            if hasattr(material, "layers"):
                place.setdefault(key, []).append(number)
            else:
                place[key] = number
    return tree


def _varied(
    item: Any, wanted: Container[str] = ()
) -> Iterator[tuple[str, float, Callable[[float], Any]]]:
    """Yields (name, value, function) for each parameter of a material.

    The function of another value returns the material with it. `wanted`: only these names, if
    given.
    """
    for name, value in values_of(item).items():
        if wanted and name not in wanted:
            continue
        if is_dataclass(value) and name == "section":
            for inner, number, vary in _varied(value):
                yield inner, number, lambda x, n=name, m=vary: replace(item, **{n: m(x)})  # type: ignore[misc]
        elif name == "layers":
            for k, layer in enumerate(value):
                for inner, number, vary in _varied(layer, OF_LAYERS):
                    yield (
                        inner,
                        number,
                        lambda x, k=k, m=vary: replace(  # type: ignore[misc]
                            item, layers=(*item.layers[:k], m(x), *item.layers[k + 1 :])
                        ),
                    )
        elif isinstance(value, float) and (value or name == "angle"):
            yield name, value, lambda x, n=name: replace(item, **{n: x})  # type: ignore[misc]


def values_of(material: Any) -> dict[str, Any]:
    """The numbers of a material, a section or a layer on which K and M depend, by name."""
    unused_names = IDLE if getattr(material, "plane", "") is not None else IDLE | {"thickness"}
    names = {item.name for item in fields(material) if item.init} - unused_names
    return {name: getattr(material, name) for name in sorted(names)}


def _extracted(built: object, model: AntiOscillators) -> AntiOscillators:
    """The model of a part, extracted with the options of `model`."""
    if isinstance(built, AntiOscillators):
        return built
    part = checks.instance("build(x)", built, Structure, "a Structure, or the model of one")
    with without_warnings():
        if model.info.method == "modes":
            model_of_part = extract(part, site_of(model), model.n, "modes")
        else:
            has_estimate = model.strain_error is not None
            model_of_part = extract(
                part, site_of(model), model.n, error="estimate" if has_estimate else None
            )
    # dampers of the part are in the coordinates of its own model
    coupled = isinstance(model_of_part.damping, DampingMatrix)
    if coupled:
        return model_of_part
    return replace(model_of_part, damping=model.damping)


def site_of(model: AntiOscillators) -> Site:
    """The site of an extracted model; InputError if it is unknown."""
    info = model.info
    if model.sites or info.point is None or info.direction is None:
        raise InputError(
            "the place of the site is not known: give a function of x that returns the model."
        )
    return Site(info.point, info.direction, model.patch_radius, snap=True)
