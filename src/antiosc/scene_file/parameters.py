"""What a constructor or function takes from a scene file, from its signature and docstring."""

from __future__ import annotations

import functools
import inspect
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import antiosc
from antiosc import checks
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


@dataclass(frozen=True)
class Parameter:
    """One key of a section: its kinds, whether it must be there, and what it means."""

    name: str
    kinds: tuple[Kind, ...]
    needed: bool
    default: Any
    about: str


@functools.cache
def parameters(function: str) -> Mapping[str, Parameter]:
    """Name -> Parameter of a public callable such as "Solid" or "Hertz.from_radii"."""
    return _of(resolved(function), function)


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


def _of(call: Callable[..., Any], function: str) -> dict[str, Parameter]:
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
        found[name] = Parameter(name, kinds, needed, default, described.get(name, ""))
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


def _unit(value: Any) -> Any:
    from antiosc.fem.readers.unit_system import UnitSystem

    return UnitSystem.of(value)


def _method(value: Any) -> Any:
    from antiosc.simulation.comparison import METHODS

    return checks.choice("method", value, METHODS)


def _quantity(value: Any) -> Any:
    from antiosc.fem.probe import PROBED_QUANTITIES

    return checks.choice("quantity", value, PROBED_QUANTITIES)


#: Name of a parameter of a function -> the check of its value. Constructors check their own;
#: functions check when they run, which is too late for a file that is only looked at.
RULES: dict[str, Callable[[Any], Any]] = {
    **{
        name: functools.partial(checks.positive, name, unit=unit)
        for name, unit in {
            "duration": "s",
            "step": "s",
            "size": "m",
            "band": "rad/s",
            "accuracy": "",
            "density": "kg/m³",
            "timeout": "s",
            "radius": "m",
        }.items()
    },
    **{
        name: functools.partial(checks.whole, name)
        for name in ("n", "modes", "max_contacts", "max_steps", "order")
    },
    "tol": checks.tolerance,
    "gap": functools.partial(checks.nonnegative, "gap", unit="m"),
    "merge": functools.partial(checks.positive, "merge", unit="m"),
    "unit": _unit,
    "method": _method,
    "quantity": _quantity,
}
