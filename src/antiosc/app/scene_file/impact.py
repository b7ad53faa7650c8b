"""The impact: one impactor on one site, or a scene of several bodies and contacts."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from typing import Any

from antiosc.app.scene_file import struck
from antiosc.app.scene_file.build import Builder, Call
from antiosc.app.scene_file.locations import Place
from antiosc.app.scene_file.parameters import resolved
from antiosc.app.scene_file.problems import label
from antiosc.app.scene_file.sections import KIND, LAWS, MODELS, SECTIONS
from antiosc.contact.base import ContactLaw

#: The name of the structure among the bodies of a scene.
STRUCTURE = "structure"


def impact(build: Builder, structure: Call | None, model: Call | None) -> dict[str, Any]:
    """The objects of one impact: impactor, contact, history; or those of several contacts."""
    single = [n for n in ("impactor", "contact", "simulate", "strike") if n in build.data]
    many = [n for n in ("contacts", "bodies", "run") if n in build.data]
    for name in ("scene", "loads", "base", "motion"):
        if name in build.data and not many:
            build.note(
                (name,), f"[{name}] belongs to a scene of several contacts: give [[contacts]]."
            )
    if single and many:
        build.note(
            (many[0],),
            f"[{single[0]}] describes one impact and [{many[0]}] a scene of several contacts;"
            " keep one of the two.",
        )
    if many:
        return _several(build, model)
    return _single(build, structure, model) if single else {}


def _single(build: Builder, structure: Call | None, model: Call | None) -> dict[str, Any]:
    for name in ("impactor", "contact"):
        if name not in build.data:
            build.note((), f"the scene has no [{name}], {SECTIONS[name].about}: give its kind.")
    impactor = build.table("impactor")
    methods = own_laws("impactor", build.data.get("impactor"), impactor)
    both = {"impactor": impactor, "contact": build.table("contact", methods=methods)}
    if "strike" in build.data:
        return {**both, "history": _strike(build, structure, both)}
    return {**both, "history": build.table("simulate", given={"model": model, **both})}


def _strike(build: Builder, structure: Call | None, both: Mapping[str, Any]) -> Call | None:
    """The impact to a tolerance."""
    for name in ("simulate", "extract"):
        if name in build.data:
            build.note((name,), f"[strike] chooses what [{name}] says; keep one of the two.")
    sites = build.named("sites")
    if len(build.part("sites")) != 1 or not (structure or struck.refined(build)):
        build.note(("strike",), "[strike] needs a structure and one site, [sites.NAME].")
        return None
    given = {**struck.to_strike(build, structure), "site": next(iter(sites.values()), None)}
    return build.table("strike", given={**given, **both})


def own_laws(variable: str, table: Any, body: Call | None) -> dict[str, tuple[str, Any]]:
    """Contact laws that a body makes itself: "impactor.hertz" -> ("Sphere.hertz", the body).

    Of a body that is wrong, those of its kind or of any body: its own mistake is enough.
    """
    made = None if body is None else body.made
    kind = table.get(KIND) if isinstance(table, dict) else None
    classes = [each for each in map(resolved, SECTIONS["bodies"].makes) if inspect.isclass(each)]
    classes = [each for each in classes if each.__name__ == kind] or classes
    return {
        f"{variable}.{name}": (f"{each.__name__}.{name}", made)
        for each in (classes if made is None else [type(made)])
        for name, method in inspect.getmembers(each, inspect.isfunction)
        if not name.startswith("_") and _makes_law(method)
    }


def _makes_law(method: Any) -> bool:
    """Whether a method of a body returns a contact law."""
    made = getattr(method, "__annotations__", {}).get("return")
    return made in LAWS.split() or (inspect.isclass(made) and issubclass(made, ContactLaw))


def _several(build: Builder, model: Call | None) -> dict[str, Any]:
    own: dict[str, Any] = {STRUCTURE: model} if struck.source(build) else {}
    named, tables = build.named("bodies"), build.part("bodies")
    if STRUCTURE in tables and own:
        build.note(("bodies", STRUCTURE), f"the body {STRUCTURE!r} is the structure of this scene.")
    ends = Ends(build, {**own, **dict.fromkeys(tables), **named, **own})
    methods: dict[str, tuple[str, Any]] = {}
    for name, table in tables.items():
        methods |= own_laws(name, table, named.get(name))
    bodies = {**own, **named}
    given: dict[str, Any] = {"bodies": bodies if None not in bodies.values() else None}
    given["contacts"] = _contacts(build, methods, ends)
    loads, motion = build.listed("loads"), build.named("motion")
    for i, table in enumerate(build.part("loads", list)):
        ends.check(table, "end", ("loads", i))
    for name in build.part("motion"):
        build.names("body", name, ends.names, ("motion", name))
    more = {"loads": loads, "base": build.table("base"), "motion": motion}
    scene = build.section("scene", given | {name: one for name, one in more.items() if one})
    if "run" not in build.data and "map" not in build.data:
        build.note((), "a scene of several contacts needs [run] with its duration.")
    return {"scene": scene, "history": build.table("run", given={"self": scene})}


def _contacts(
    build: Builder, methods: Mapping[str, tuple[str, Any]], ends: Ends
) -> list[Call | None]:
    """[[contacts]], whose `law` may be one of a body."""
    written = build.part("contacts", list)
    if not written:
        build.note((), "a scene of several bodies needs [[contacts]].")
    found = []
    for i, table in enumerate(written):
        place: Place = ("contacts", i)
        if not isinstance(table, dict):
            build.note(place, f"{label(place)} must be a table, [[contacts]].")
            continue
        law, at = None, (*place, "law")
        if isinstance(table.get("law"), dict):
            law = build.call(SECTIONS["contact"], table["law"], at, methods=methods)
        else:
            like = 'law = {kind = "Hertz", stiffness = 1e9}'
            build.note(at, f"{label(at)} must be a table, as {like}.")
        for key in ("a", "b"):
            ends.check(table, key, place)
        rest = {key: value for key, value in table.items() if key != "law"}
        found.append(build.call(SECTIONS["contacts"], rest, place, {"law": law}))
    return found


class Ends:
    """Checks that "body:site" exists, among the bodies of a scene; None: a body that is wrong."""

    def __init__(self, build: Builder, bodies: Mapping[str, Call | None]) -> None:
        self.build = build
        self.bodies = bodies
        self.names = list(bodies)

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
        if body == STRUCTURE and struck.source(self.build):
            return None if set(MODELS) & set(self.build.data) else list(self.build.part("sites"))
        made = self.bodies[body]
        if made is None or made.name == "AntiOscillators.load":
            return None
        return list(made.arguments.get("sites", ()))
