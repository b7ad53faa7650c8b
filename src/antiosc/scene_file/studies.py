"""Many impacts of one scene: [sweep], one for each value, and [map], one at each point."""

from __future__ import annotations

from typing import Any

from antiosc.scene_file.build import KIND, Mistake
from antiosc.scene_file.kinds import DATA, Kind
from antiosc.scene_file.parameters import Parameter, parameters
from antiosc.scene_file.problems import label, listed
from antiosc.scene_file.program import Call, ForEach, Name, Statement
from antiosc.scene_file.sections import SECTIONS
from antiosc.scene_file.tables import Tables
from antiosc.scene_file.trial import tried

#: Sections whose values a sweep may vary.
VARIED = ("impactor", "contact", "simulate")
#: Most impacts of a sweep.
MOST_IMPACTS = 100_000


def sweep(tables: Tables, model: list[Statement], strike: list[Statement]) -> list[Statement]:
    """Statements that make `batch`; none without [sweep], or after a mistake in it."""
    table = tables.part(tables.data, "sweep", dict)
    if "sweep" not in tables.data:
        return []
    made = {each.variable: each.expression for each in strike}
    if not model or "impactor" not in made or "simulate" not in tables.data:
        tables.problems.add(
            ("sweep",), "[sweep] varies [impactor], [contact] and [simulate]; give all three."
        )
        return []
    values = _values(tables, table)
    sizes = {f"{one}.{name}": len(v) for one, each in values.items() for name, v in each.items()}
    if len(set(sizes.values())) > 1:
        text = ", ".join(f"{name}: {size}" for name, size in sizes.items())
        tables.problems.add(("sweep",), f"the lists of [sweep] must be equally long; got {text}.")
        return []
    if not table:
        tables.problems.add(
            ("sweep",), "[sweep] holds no list of values, as impactor.velocity = [1.0, 2.0]."
        )
    impactor, contact = made["impactor"], made["contact"]
    if not sizes or impactor is None or contact is None:
        return []
    size = next(iter(sizes.values()))
    impactors = _varied(tables, impactor, values.get("impactor", {}), size)
    if contact.on is not None and "impactor" in values:
        law = Call(contact.function, contact.arguments, contact.place, Name("impactor"))
        laws = Statement("contacts", ForEach(law, "impactors"))
    else:
        laws = _varied(tables, contact, values.get("contact", {}), size)
    names = ("model", impactors.variable, laws.variable)
    batch = Statement("batch", _batch(tables, values.get("simulate", {}), names))
    statements = [impactors, laws, batch]
    return [] if any(each.expression is None for each in statements) else statements


def _values(tables: Tables, table: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Section -> its parameters with their lists."""
    found: dict[str, dict[str, Any]] = {}
    for section, lists in table.items():
        if section not in VARIED or not isinstance(lists, dict):
            tables.problems.add(
                ("sweep", section),
                f"[sweep] has lists of {listed(VARIED)}, as impactor.velocity = [1.0, 2.0]; got"
                f" {section!r}.",
            )
            continue
        known = _known(tables, section)
        if not known:
            tables.problems.add(
                ("sweep", section),
                f"[sweep] cannot vary [{section}], whose kind is wrong or a law of the impactor;"
                ' give a law by itself, as kind = "Hertz".',
            )
            continue
        for key, value in lists.items():
            place = ("sweep", section, key)
            if key not in known:
                tables.build.no_key(("sweep", section), key, known)
                continue
            each = Parameter(key, (Kind("list", items=known[key].kinds),), True, None, "")
            try:
                entries = [
                    tables.build.value(known[key], entry, (*place, i))
                    for i, entry in enumerate(tables.build.value(each, value, place))
                ]
            except Mistake:
                continue
            if not 0 < len(entries) <= MOST_IMPACTS:
                tables.problems.add(
                    place,
                    f"{label(place)} must have 1 to {MOST_IMPACTS} values; got {len(entries)}.",
                )
                continue
            found.setdefault(section, {})[key] = tuple(entries)
    return found


def _known(tables: Tables, section: str) -> dict[str, Parameter]:
    """What a section of this scene takes."""
    if section == "simulate":
        batch, one = parameters("simulate_many"), parameters("simulate")
        return {name: one[name] for name in batch if name in one and DATA in batch[name].kinds}
    kind = tables.part(tables.data, section, dict).get(KIND)
    if kind not in SECTIONS[section].makes():
        return {}
    return dict(parameters(kind))


def _varied(tables: Tables, call: Call, values: dict[str, Any], size: int) -> Statement:
    """Objects with one value of each list: `ao.sweep(ao.Sphere, radius=…, velocity=(…))`.

    One object for all, where there is no list.
    """
    one = call.place[0]
    if not values:
        return Statement(str(one), call)
    fixed = {
        name: (value,) * size if isinstance(value, tuple) else value
        for name, value in call.arguments.items()
    }
    arguments = {"*make": Name(call.function), **fixed, **values}
    made = Call("ao.sweep", arguments, ("sweep", *call.place))
    return Statement(f"{one}s", tried(tables.problems, made))


def _batch(tables: Tables, values: dict[str, Any], names: tuple[str, ...]) -> Call | None:
    """`ao.simulate_many` with what [simulate] says and the lists of [sweep]."""
    withheld = ("models", "impactors", "contacts")
    known = [name for name in parameters("simulate_many") if name not in withheld]
    table = dict(tables.data["simulate"])
    lost = [name for name in table if name not in known]
    if lost:
        tables.problems.add(
            ("simulate", lost[0]),
            f"[simulate] has {lost[0]!r}, which a sweep does not take; it takes {listed(known)}.",
        )
        return None
    given: dict[str, Any] = {f"*{k}": Name(n) for k, n in zip(withheld, names, strict=True)}
    rest = {k: v for k, v in table.items() if k not in values}
    return tables.build.call(
        ("simulate_many",), rest, ("simulate",), given={**given, **values}, withheld=withheld
    )


def surface(tables: Tables, source: str, strike: list[Statement]) -> Statement | None:
    """The statement that makes `found`, of [map]."""
    if not isinstance(tables.data.get("map"), dict):
        return None
    if source not in ("geometry", "deck", "parts"):
        tables.problems.add(("map",), "[map] needs a structure of [geometry], [deck] or [parts].")
    section = SECTIONS["map"]
    given: dict[str, Any] = {"*structure": Name("structure")}
    table = dict(tables.data["map"])
    if {"impactor", "contact"} <= {each.variable for each in strike}:
        given |= {"impactor": Name("impactor"), "contact": Name("contact")}
        simulate = tables.part(tables.data, "simulate", dict)
        if "duration" not in table and "duration" in simulate:
            table["duration"] = simulate["duration"]
        if "duration" not in table:
            tables.problems.add(("map",), "[map] lacks 'duration', of each impact in s.")
    call = tables.build.call(section.makes(), table, ("map",), given=given, withheld=section.given)
    return None if call is None else Statement("found", call)
