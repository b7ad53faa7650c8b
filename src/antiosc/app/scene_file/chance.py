"""[monte_carlo]: the impact of a scene with random values of its bodies, law and structure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import antiosc
from antiosc.app.scene_file import struck
from antiosc.app.scene_file.build import Builder, Call, replaced
from antiosc.app.scene_file.locations import Place
from antiosc.app.scene_file.parameters import parameters
from antiosc.app.scene_file.problems import label, listed
from antiosc.app.scene_file.sections import DISTRIBUTIONS, KIND, SECTIONS
from antiosc.app.scene_file.variants import Alone, leaves, variant

#: Sections of bodies and laws, which are made anew in each run, and of the structure.
LIGHT, OF_STRUCTURE = ("impactor", "contact"), ("material", "structure", "parts")
#: The input whose values are models at points of the surface; it takes what `impact_map` does.
POINT = "point"


def monte_carlo(
    build: Builder,
    structure: Call | None,
    model: Call | None,
    impactor: Call | None,
    contact: Call | None,
) -> Call | None:
    """The study of [monte_carlo]; None without it, or after a mistake in it."""
    table = build.data.get("monte_carlo")
    if not isinstance(table, dict):
        return None
    duration = build.part("simulate").get("duration")
    if duration is None:
        build.note(("monte_carlo",), "[monte_carlo] needs [impactor], [contact] and [simulate].")
    drawn = {name: value for name, value in table.items() if isinstance(value, dict)}
    rest = {name: value for name, value in table.items() if name not in drawn}
    point = _surface(build, structure, drawn.pop(POINT)) if POINT in drawn else None
    inputs = _inputs(build, drawn)
    if not inputs and POINT not in table:
        build.note(
            ("monte_carlo",),
            '[monte_carlo] draws nothing, as impactor.velocity = {kind = "normal", mean = 2.0,'
            " sigma = 0.1}.",
        )
    shared = {place: law for place, law in inputs.items() if place[0] not in LIGHT}
    models: Any = point if POINT in table else model
    if shared and POINT in table:
        build.note(("monte_carlo",), "[monte_carlo] draws points, or values of the structure.")
    elif shared:
        models = _nearby(build, structure, shared)
    made = (structure or model, models, impactor, contact, duration)
    if None in made or None in inputs.values() or (POINT in table and point is None):
        return None
    names = {label(place): law for place, law in inputs.items()}
    of_law = str(build.data["contact"].get(KIND, "")).startswith("impactor.")
    scene = Drawn(impactor, contact, duration, of_law, [label(place) for place in shared])  # type: ignore[arg-type]
    given: dict[str, Any] = {"run": Call(_run, {"scene": [scene], "models": models})}
    given["inputs"] = names | ({POINT: point} if POINT in table else {})
    return build.call(SECTIONS["monte_carlo"], rest, ("monte_carlo",), given)


def _inputs(build: Builder, drawn: Mapping[str, Any]) -> dict[Place, Call | None]:
    """The distribution of each value, by its place in the scene."""
    found: dict[Place, Call | None] = {}
    for place, value in leaves(drawn):
        at: Place = ("monte_carlo", *place)
        known = (*LIGHT, *OF_STRUCTURE)
        if place[0] not in known or place[0] not in build.data or len(place) < 2:
            there = listed([n for n in known if n in build.data])
            build.note(
                at, f"[monte_carlo] draws values of {there}, or a point; got {label(place)}."
            )
            continue
        if place[0] in LIGHT:
            kind = build.part(str(place[0])).get(KIND)
            keys = parameters(kind) if kind in SECTIONS[str(place[0])].makes else {}
            if len(place) != 2 or place[1] not in keys:
                build.note(at, f"{label(at)}: [{place[0]}] takes {listed(keys)}.")
                continue
        found[place] = build.call(DISTRIBUTIONS.split(), value, at)
    return found


def _surface(build: Builder, structure: Call | None, table: Any) -> Call | None:
    """The map of the points that are drawn."""
    if structure is None or struck.source(build) not in ("geometry", "deck", "parts"):
        build.note(("monte_carlo", POINT), "points are drawn on a structure with a mesh.")
        return None
    withheld = {"structure": structure}
    return build.call(("impact_map",), table, ("monte_carlo", POINT), withheld)


def _nearby(
    build: Builder, structure: Call | None, inputs: Mapping[Place, Call | None]
) -> Call | None:
    """The models of structures with other values."""
    sites = build.named("sites")
    if structure is None or len(sites) != 1:
        build.note(("monte_carlo",), "values of the structure are drawn where there is one site.")
        return None
    if None in inputs.values():
        return None
    origins = {place: ("monte_carlo", *place) for place in inputs}
    names = {label(place): place for place in inputs}

    def made(**values: float) -> Any:
        other = variant(build, {names[name]: value for name, value in values.items()}, origins)
        call = struck.structure(other, struck.source(other))
        build.problems.raise_if_any()
        return None if call is None else Alone(other, call).made()

    given = {"build": made, "site": next(iter(sites.values()))}
    given["ranges"] = {label(place): law for place, law in inputs.items()}
    if "n" in build.part("extract"):
        given["n"] = build.part("extract")["n"]
    return Call(antiosc.nearby, given, ("monte_carlo",))


@dataclass(frozen=True)
class Drawn:
    """The bodies of a run as calls, whose arguments are drawn."""

    impactor: Call
    contact: Call
    duration: float
    of_law: bool
    structural: list[str]

    def bodies(self, values: Mapping[str, Any]) -> tuple[Any, Any, float]:
        """(impactor, contact, duration) with values by their names, as impactor.velocity."""
        impactor = _again(self.impactor, "impactor", values)
        contact = _again(self.contact, "contact", values, impactor if self.of_law else None)
        return impactor, contact, self.duration


def _again(call: Call, section: str, values: Mapping[str, Any], body: Any = None) -> Any:
    own = {k.partition(".")[2]: v for k, v in values.items() if k.startswith(f"{section}.")}
    if not own and body is None:
        return call.made
    make = call.make if body is None else getattr(body, call.make.__name__)
    return make(**{**replaced(dict(call.arguments), lambda inner: inner.made), **own})


def _run(scene: list[Drawn], models: Any) -> Any:
    """The function of the inputs that `monte_carlo` calls."""
    (one,) = scene

    def run(**values: Any) -> tuple[Any, ...]:
        model = values.get(POINT, models)
        if one.structural:
            model = models(**{name: values[name] for name in one.structural})
        return (model, *one.bodies(values))

    return run
