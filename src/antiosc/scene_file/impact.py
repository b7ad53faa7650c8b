"""The impact: one impactor on one site, or a scene of several bodies and contacts."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from antiosc.scene_file import struck
from antiosc.scene_file.build import KIND
from antiosc.scene_file.locations import Place
from antiosc.scene_file.parameters import parameters, resolved
from antiosc.scene_file.problems import label
from antiosc.scene_file.program import Call, Name, Statement
from antiosc.scene_file.sections import SECTIONS, bodies, laws
from antiosc.scene_file.tables import Tables

#: The name of the structure among the bodies of a scene.
STRUCTURE = "structure"


def simulation(tables: Tables, source: str) -> tuple[list[Statement], Statement | None]:
    """Statements that pose the impact, and the one that makes `history`."""
    single = [n for n in ("impactor", "contact", "simulate", "strike") if n in tables.data]
    many = [n for n in ("contacts", "bodies", "run") if n in tables.data]
    for name in ("scene", "loads", "base", "motion"):
        if name in tables.data and not many:
            tables.problems.add(
                (name,), f"[{name}] belongs to a scene of several contacts: give [[contacts]]."
            )
    if single and many:
        tables.problems.add(
            (many[0],),
            f"[{single[0]}] describes one impact and [{many[0]}] a scene of several contacts;"
            " keep one of the two.",
        )
    if many:
        return _scene(tables, source)
    return _impact(tables, source) if single else ([], None)


def _impact(tables: Tables, source: str) -> tuple[list[Statement], Statement | None]:
    for name in ("impactor", "contact"):
        if name not in tables.data:
            tables.problems.add(
                (), f"the scene has no [{name}], {SECTIONS[name].about}: give its kind."
            )
    impactor = tables.table("impactor")
    contact = tables.table("contact", on=own_laws("impactor", tables.data.get("impactor")))
    strike = [Statement("impactor", impactor), Statement("contact", contact)]
    if "strike" in tables.data:
        return strike, _strike(tables, source)
    names = {"*model": "model", "*impactor": "impactor", "*contact": "contact"}
    given = {key: Name(name) for key, name in names.items()}
    call = tables.table("simulate", given=given)
    return strike, None if call is None else Statement("history", call)


def _strike(tables: Tables, source: str) -> Statement | None:
    """The impact to a tolerance."""
    for name in ("simulate", "extract"):
        if name in tables.data:
            tables.problems.add(
                (name,), f"[strike] chooses what [{name}] says; keep one of the two."
            )
    sites = tables.named("sites")
    if len(tables.part(tables.data, "sites", dict)) != 1 or source in ("", "model"):
        tables.problems.add(("strike",), "[strike] needs a structure and one site, [sites.NAME].")
        return None
    given = {**struck.to_strike(tables, source), "*site": next(iter(sites.values()), None)}
    given |= {"*impactor": Name("impactor"), "*contact": Name("contact")}
    order = ["*source", "*site", "*impactor", "*contact", "material", "supports"]
    call = tables.table("strike", given={key: given[key] for key in order if key in given})
    return None if call is None else Statement("history", call)


def own_laws(variable: str, table: Any) -> dict[str, tuple[str, Name]]:
    """Contact laws that a body makes itself: "impactor.hertz" -> ("Sphere.hertz", the body).

    Of a body whose kind is wrong, those of any body: its own mistake is enough. Of one that a
    function makes, too: its class shows when it is made.
    """
    kind = str(table.get(KIND)) if isinstance(table, dict) else ""
    known = kind in bodies() and inspect.isclass(resolved(kind))
    target = Name(variable) if variable == "impactor" else Name("bodies", variable)
    return {
        f"{variable}.{method}": (f"{each}.{method}", target)
        for each in ([kind] if known else bodies())
        for method in dir(resolved(each))
        if not method.startswith("_") and _makes_law(getattr(resolved(each), method))
    }


def _scene(tables: Tables, source: str) -> tuple[list[Statement], Statement | None]:
    named = tables.named("bodies")
    if STRUCTURE in tables.part(tables.data, "bodies", dict) and source:
        tables.problems.add(
            ("bodies", STRUCTURE), f"the body {STRUCTURE!r} is the structure of this scene."
        )
    own: dict[str, Any] = {STRUCTURE: Name("model")} if source else {}
    ends = Ends(tables, source, {**own, **named})
    on: dict[str, tuple[str, Name]] = {}
    for name, table in tables.part(tables.data, "bodies", dict).items():
        on |= own_laws(name, table)
    contacts = _contacts(tables, on, ends)
    given: dict[str, Any] = {"*bodies": Name("bodies"), "*contacts": contacts}
    loads = tables.listed("loads")
    for i, table in enumerate(tables.part(tables.data, "loads", list)):
        ends.check(table, "end", ("loads", i))
    motion = tables.named("motion")
    for name in tables.part(tables.data, "motion", dict):
        tables.build.names("body", name, ends.names, ("motion", name))
    more = {"loads": loads, "base": tables.table("base"), "motion": motion}
    given |= {name: value for name, value in more.items() if value}
    section = SECTIONS["scene"]
    options = tables.part(tables.data, "scene", dict)
    scene = tables.build.call(
        section.makes(), options, ("scene",), given=given, withheld=section.given
    )
    strike = [Statement("bodies", {**own, **named}), Statement("scene", scene)]
    run = tables.table("run")
    if run is not None:
        run = replace(run, function="run", on=Name("scene"))
    if "run" not in tables.data and "map" not in tables.data:
        tables.problems.add((), "a scene of several contacts needs [run] with its duration.")
    return strike, None if run is None else Statement("history", run)


def _contacts(tables: Tables, on: dict[str, tuple[str, Name]], ends: Ends) -> list[Call]:
    """[[contacts]], whose `law` may be one of a body."""
    found = []
    written = tables.part(tables.data, "contacts", list)
    if not written:
        tables.problems.add((), "a scene of several bodies needs [[contacts]].")
    known = parameters("Contact")
    for i, table in enumerate(written):
        place: Place = ("contacts", i)
        if not isinstance(table, dict):
            tables.problems.add(place, f"{label(place)} must be a table, [[contacts]].")
            continue
        rest = {k: v for k, v in table.items() if k != "law"}
        given: dict[str, Any] = {}
        if isinstance(table.get("law"), dict):
            law = tables.build.call(
                SECTIONS["contact"].makes(), table["law"], (*place, "law"), on=on
            )
            given["law"] = law
        elif "law" in table or known["law"].needed:
            tables.problems.add(
                (*place, "law"),
                f"{label((*place, 'law'))} must be a table, as"
                ' law = {kind = "Hertz", stiffness = 1e9}.',
            )
            given["law"] = None
        ends.check(table, "a", place)
        ends.check(table, "b", place)
        call = tables.build.call(("Contact",), rest, place, given=given)
        if call is not None:
            found.append(call)
    return found


class Ends:
    """Checks that "body:site" exists."""

    def __init__(self, tables: Tables, source: str, bodies: Mapping[str, Any]) -> None:
        self.build = tables.build
        self.bodies = bodies
        own = [STRUCTURE] if source else []
        #: of all bodies, those with mistakes included
        self.names = [*own, *tables.part(tables.data, "bodies", dict)]
        sites = tables.part(tables.data, "sites", dict)
        self.sites = None if source == "model" else list(sites)

    def check(self, table: Any, key: str, place: Place) -> None:
        """Note an end of a table that names no body, or no site of it."""
        end = table.get(key) if isinstance(table, dict) else None
        if not isinstance(end, str):
            return
        body, _, site = end.partition(":")
        if not self.build.names("body", body, self.names, (*place, key)):
            return
        sites = self._sites(body)
        if sites is not None and (site or sites):
            self.build.names(f"site of {body!r}", site, sites, (*place, key))

    def _sites(self, body: str) -> list[str] | None:
        """Names of the sites of a body; None where the file does not tell them."""
        made = self.bodies.get(body)
        if body == STRUCTURE and isinstance(made, Name):
            return self.sites
        if made is None or made.function == "ao.AntiOscillators.load":
            return None
        return list(made.arguments.get("sites", ()))


def _makes_law(method: Any) -> bool:
    """Whether a method of a body returns a contact law."""
    made = getattr(method, "__annotations__", {}).get("return")
    return made in laws() or getattr(made, "__name__", None) in laws()
