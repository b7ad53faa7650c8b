"""What a constructor or function takes from a scene file, from its signature and docstring."""

from __future__ import annotations

import functools
import inspect
import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any

import antiosc
from antiosc import checks
from antiosc.models.modal import as_damping
from antiosc.scene_file.kinds import DATA, PATH, TEXT, Kind, kinds_of
from antiosc.scene_file.outputs import Output

#: Parameters that no file may give, beside those that only Python objects can be.
WITHHELD = {
    "trust": "a file cannot permit itself to run commands; use Python for a script that you trust",
    "shapes": "shapes are always kept, for fields and probes",
    **dict.fromkeys(
        ("comm", "earlier", "groups", "info", "history", "self"), "it is an object of Python"
    ),
}
#: Parameters whose texts are file names, beside those whose annotation says it.
FILES = {("Structure.from_files", "map")}

#: (name, value) -> the value, or InputError
Check = Callable[[str, Any], Any]


@dataclass(frozen=True)
class Parameter:
    """One key of a section: its kinds, whether it must be there, what it means, and its check."""

    name: str
    kinds: tuple[Kind, ...]
    needed: bool
    default: Any
    about: str
    check: Check | None = None


@functools.cache
def parameters(function: str) -> Mapping[str, Parameter]:
    """Name -> Parameter of a public callable such as "Solid" or "Hertz.from_radii"."""
    return _parameters(resolved(function), function)


def resolved(function: str) -> Callable[..., Any]:
    """The public callable of a dotted name in antiosc's own tables."""
    if function == "output":
        return Output
    value: Any = antiosc
    for name in function.split("."):
        value = getattr(value, name)
    return value  # type: ignore[no-any-return]


def takes(function: str, name: str) -> bool:
    """Whether the callable has a parameter of this name, whether or not a file may give it."""
    return name in inspect.signature(resolved(function)).parameters


def _parameters(call: Callable[..., Any], function: str) -> dict[str, Parameter]:
    described = descriptions(call)
    found = {}
    for name, given in inspect.signature(call).parameters.items():
        if name in WITHHELD or given.kind in (given.VAR_KEYWORD, given.VAR_POSITIONAL):
            continue
        source = call.__init__ if inspect.isclass(call) and _own_init(call) else call
        kinds = kinds_of(given.annotation, source)
        if (function, name) in FILES:
            kinds = (PATH, *kinds)
        if PATH in kinds:
            kinds = tuple(kind for kind in kinds if kind not in (TEXT, DATA))
        if not kinds:
            continue
        needed = given.default is given.empty
        default = None if needed else given.default
        check = CHECKS.get(function, {}).get(name)
        found[name] = Parameter(name, kinds, needed, default, described.get(name, ""), check)
    return found


def _own_init(call: type) -> bool:
    """Whether a class writes its own constructor; a dataclass has its annotations itself."""
    return not hasattr(call, "__dataclass_fields__")


def descriptions(call: Any) -> dict[str, str]:
    """Name -> first sentence of the docstring's section "Parameters"."""
    text = inspect.getdoc(call) or ""
    section = re.search(r"^Parameters\n-+\n(.*?)(?=^\w[^\n]*\n-+\n|\Z)", text, re.M | re.S)
    found: dict[str, str] = {}
    names: list[str] = []
    for line in section.group(1).splitlines() if section else []:
        if line and not line.startswith(" "):
            head, _, rest = line.partition(" : ")
            names = [name.strip() for name in head.split(",")]
            found |= dict.fromkeys(names, rest.strip() if _tells(rest) else "")
        elif line.strip():
            for name in names:
                found[name] = f"{found[name]} {line.strip()}".strip()
    return {name: _first_sentence(about) for name, about in found.items()}


def _tells(rest: str) -> bool:
    """Whether the text after the colon is more than a type."""
    return len(rest.split()) > 6 and "optional" not in rest


def _first_sentence(text: str) -> str:
    sentence = re.split(r"(?<=[a-z\])’'”\"])[.;:](?:\s|$)", text, maxsplit=1)[0].rstrip(".")
    return sentence if len(sentence) <= 160 else f"{sentence[:157].rsplit(' ', 1)[0]} …"


def _of(unit: str) -> Check:
    return functools.partial(checks.positive, unit=unit)


def _choice(options: Collection[Any]) -> Check:
    return functools.partial(checks.choice, options=options)


def _method(name: str, value: Any) -> Any:
    from antiosc.simulation.comparison import METHODS

    return checks.choice(name, value, METHODS)


def _unit(name: str, value: Any) -> Any:
    from antiosc.fem.readers.unit_system import UnitSystem

    return UnitSystem.of(value)


def _quantity(name: str, value: Any) -> Any:
    from antiosc.fem.probe import PROBED_QUANTITIES

    return checks.choice(name, value, PROBED_QUANTITIES)


def _tolerance(name: str, value: Any) -> float:
    return checks.tolerance(value, name)


def _count_or_auto(name: str, value: Any) -> Any:
    return value if value == "auto" else checks.whole(name, value, least=0)


_SECONDS, _METRES, _ORDER = _of("s"), _of("m"), _choice((1, 2))
_GAP: Check = functools.partial(checks.nonnegative, unit="m")
_READING: dict[str, Check] = {"unit": _unit, "merge": _METRES, "timeout": _SECONDS}
_RUN: dict[str, Check] = {
    "duration": _SECONDS,
    "method": _method,
    "step": _SECONDS,
    "tol": _tolerance,
    "max_contacts": checks.whole,
    "max_steps": checks.whole,
}
#: Function -> parameter -> the check of its value. A function checks its values when it runs, which
#: is too late for a file that is only looked at; constructors are tried (`trial`).
CHECKS: dict[str, dict[str, Check]] = {
    "read_mesh": {**_READING, "size": _METRES, "order": _ORDER},
    "read_model": {**_READING, "density": _of("kg/m³")},
    "Structure": {"order": _ORDER},
    "extract": {
        "n": functools.partial(checks.whole, least=0),
        "tol": _tolerance,
        "band": _of("rad/s"),
        "accuracy": checks.positive,
        "damping": lambda _, value: as_damping(value),
    },
    "simulate": {**_RUN, "n": _count_or_auto, "gap": _GAP},
    "strike": {"duration": _SECONDS, "tol": _tolerance, "order": _ORDER, "gap": _GAP},
    "Scene.run": _RUN,
    "impact_map": {
        "duration": _SECONDS,
        "radius": _METRES,
        "n": checks.whole,
        "modes": checks.whole,
        "band": _of("rad/s"),
        "accuracy": checks.positive,
    },
    "probe": {"quantity": _quantity, "times": checks.filled},
}
