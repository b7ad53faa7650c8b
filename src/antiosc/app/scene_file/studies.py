"""Many impacts of one scene: [sweep], one for each value, and [map], one at each point."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import antiosc
from antiosc.app.scene_file.build import Builder, Call, Mistake, refused, replaced
from antiosc.app.scene_file.kinds import DATA, Kind
from antiosc.app.scene_file.locations import Place
from antiosc.app.scene_file.parameters import Parameter, parameters
from antiosc.app.scene_file.problems import label, listed
from antiosc.app.scene_file.sections import KIND, SECTIONS, VARIED
from antiosc.app.scene_file.variants import leaves, model_of, structural, variant
from antiosc.base.errors import AntioscError

#: Most impacts of a sweep, and most structures.
MOST_IMPACTS, MOST_MODELS = 100_000, 1000
#: What the other sections give to a batch.
_GIVEN = ("models", "impactors", "contacts")


def sweep(
    build: Builder, model: Call | None, impactor: Call | None, contact: Call | None
) -> Call | None:
    """The batch; None without [sweep], or after a mistake in it."""
    if "sweep" not in build.data:
        return None
    if not all(name in build.data for name in VARIED):
        build.note(
            ("sweep",), "[sweep] varies [impactor], [contact] and [simulate]; give all three."
        )
        return None
    if not build.part("sweep"):
        build.note(
            ("sweep",), "[sweep] holds no list of values, as impactor.velocity = [1.0, 2.0]."
        )
    own = [name for name in build.part("sweep") if name in structural(build)]
    values = {n: _values(build, n) for n in build.part("sweep") if n not in own}
    varied = {place: v for name in own for place, v in _of_structure(build, name)}
    sizes = {f"{one}.{name}": len(v) for one, each in values.items() for name, v in each.items()}
    sizes |= {label(place): len(v) for place, v in varied.items()}
    if len(set(sizes.values())) > 1:
        text = ", ".join(f"{name}: {size}" for name, size in sizes.items())
        build.note(("sweep",), f"the lists of [sweep] must be equally long; got {text}.")
        return None
    if not sizes or model is None or impactor is None or contact is None:
        return None
    models = model if not varied else _models(build, varied, next(iter(sizes.values())))
    impactors = _varied(build, impactor, values.get("impactor", {}))
    if build.data["contact"].get(KIND, "").startswith("impactor.") and isinstance(impactors, list):
        arguments = replaced(contact.arguments, lambda call: call.made)
        method = contact.make.__name__
        contacts: Any = [getattr(each, method)(**arguments) for each in impactors]
    else:
        contacts = _varied(build, contact, values.get("contact", {}))
    return _batch(build, values.get("simulate", {}), (models, impactors, contacts))


def _of_structure(build: Builder, section: str) -> list[tuple[Place, list[Any]]]:
    """The lists of a section that says what is struck, each with its place in the scene."""
    table = build.data["sweep"][section]
    if not isinstance(table, dict):
        build.note(("sweep", section), f"[sweep] has lists, as {section}.KEY = […].")
        return []
    found = []
    for place, value in leaves({section: table}):
        if isinstance(value, list) and 0 < len(value) <= MOST_MODELS:
            found.append((place, value))
        else:
            build.note(
                ("sweep", *place),
                f"sweep.{label(place)} must be a list of 1 to {MOST_MODELS} values.",
            )
    return found


def _models(build: Builder, varied: Mapping[Place, list[Any]], count: int) -> Any:
    """One model for each value; None after a mistake."""
    models = []
    for i in range(count):
        values = {place: each[i] for place, each in varied.items()}
        made = variant(build, values, {place: ("sweep", *place, i) for place in varied})
        models.append(model_of(made))
    return None if None in models else models


def _values(build: Builder, section: str) -> dict[str, Any]:
    """The parameters of a section with their lists in [sweep]."""
    lists = build.data["sweep"][section]
    if section not in VARIED or not isinstance(lists, dict):
        build.note(
            ("sweep", section),
            f"[sweep] has lists of {listed([*VARIED, *structural(build)])}, as impactor.velocity ="
            f" [1.0, 2.0]; got {section!r}.",
        )
        return {}
    known = _known(build, section)
    if not known:
        build.note(
            ("sweep", section),
            f"[sweep] cannot vary [{section}], whose kind is wrong or a law of the impactor;"
            ' give a law by itself, as kind = "Hertz".',
        )
        return {}
    found = {}
    for key, value in lists.items():
        place = ("sweep", section, key)
        try:
            if key not in known:
                build.no_key(place[:2], key, known)
            each = Parameter(key, (Kind("list", items=known[key].kinds),))
            entries = build.value(each, value, place)
            found[key] = tuple(
                build.value(known[key], entry, (*place, i)) for i, entry in enumerate(entries)
            )
        except Mistake:
            continue
        if not 0 < len(entries) <= MOST_IMPACTS:
            build.note(
                place, f"{label(place)} must have 1 to {MOST_IMPACTS} values; got {len(entries)}."
            )
            del found[key]
    return found


def _known(build: Builder, section: str) -> Mapping[str, Parameter]:
    """What a section of this scene takes in a sweep."""
    if section == "simulate":
        batch, one = parameters("simulate_many"), parameters("simulate")
        return {name: one[name] for name in batch if name in one and DATA in batch[name].kinds}
    kind = build.part(section).get(KIND)
    return parameters(kind) if kind in SECTIONS[section].makes else {}


def _varied(build: Builder, call: Call, values: Mapping[str, Any]) -> Any:
    """Objects with one value of each list: `ao.sweep(ao.Sphere, radius=…, velocity=(…))`.

    The one object for all, where there is no list; None after a mistake.
    """
    if not values:
        return call
    size = len(next(iter(values.values())))
    own = replaced(dict(call.arguments), lambda inner: inner.made)
    fixed = {name: (one,) * size if isinstance(one, tuple) else one for name, one in own.items()}
    try:
        return antiosc.sweep(call.make, **{**fixed, **values})
    except AntioscError as error:
        arguments = {**call.arguments, **values}
        build.note(*refused(Call(call.make, arguments, ("sweep", *call.place)), error))
        return None


def _batch(build: Builder, values: Mapping[str, Any], made: tuple[Any, ...]) -> Call | None:
    """`ao.simulate_many` with what [simulate] says and the lists of [sweep]."""
    known = [name for name in parameters("simulate_many") if name not in _GIVEN]
    table = build.part("simulate")
    lost = [name for name in table if name not in known]
    if lost:
        build.note(
            ("simulate", lost[0]),
            f"[simulate] has {lost[0]!r}, which a sweep does not take; it takes {listed(known)}.",
        )
        return None
    given = {**dict(zip(_GIVEN, made, strict=True)), **values}
    rest = {name: value for name, value in table.items() if name not in values}
    return build.call(("simulate_many",), rest, ("simulate",), given)


def surface(
    build: Builder, source: str, structure: Call | None, impactor: Any, contact: Any
) -> Call | None:
    """The map of [map]."""
    if not isinstance(build.data.get("map"), dict):
        return None
    if source not in ("geometry", "deck", "parts"):
        build.note(("map",), "[map] needs a structure of [geometry], [deck] or [parts].")
    given: dict[str, Any] = {"structure": structure}
    table = dict(build.data["map"])
    if {"impactor", "contact"} & set(build.data):
        given |= {"impactor": impactor, "contact": contact}
        if "duration" not in table and "duration" in build.part("simulate"):
            table["duration"] = build.part("simulate")["duration"]
        if "duration" not in table:
            build.note(("map",), "[map] lacks 'duration', of each impact in s.")
    return build.section("map", given, table)
