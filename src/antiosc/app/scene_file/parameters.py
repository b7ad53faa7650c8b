"""What a constructor or function takes from a scene file, from its signature and docstring."""

from __future__ import annotations

import functools
import inspect
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import antiosc
from antiosc.app.scene_file.kinds import DATA, PATH, TEXT, Kind, Names, kinds_of
from antiosc.app.scene_file.outputs import Output
from antiosc.base import checks
from antiosc.models.modal import as_damping

#: Parameters that no file may give, beside those that only Python objects can be.
WITHHELD = {
    "trust": "a file cannot permit itself to run commands; use Python for a script that you trust",
    "shapes": "shapes are always kept, for fields and probes",
    **dict.fromkeys(
        ("comm", "earlier", "groups", "info", "history", "self"), "it is an object of Python"
    ),
}
#: Parameters whose texts are file names, beside those whose annotation says it.
FILES = {("Structure.from_files", "map"), ("find_impact", "signals")}
#: Parameters that take an object of a class, beside those whose annotation says it.
OBJECTS = {("Floor", "material"): "Solid"}

#: Functions that only check and store values.
LIGHT = ("named_impactor", "normal", "lognormal", "uniform", "soil_cone")

#: (name, value) -> the value, or InputError
Check = Callable[[str, Any], Any]


@dataclass(frozen=True)
class Parameter:
    """One key of a section: its kinds, whether it must be there, what it means, and its check."""

    name: str
    kinds: tuple[Kind, ...]
    needed: bool = True
    default: Any = None
    about: str = ""
    check: Check | None = None


@functools.cache
def parameters(function: str) -> Mapping[str, Parameter]:
    """Name -> Parameter of a public callable such as "Solid" or "Hertz.from_radii"."""
    call = resolved(function)
    described = descriptions(call)
    # constructors check their values themselves; the values of a batch are lists
    checked = not light(function) and function != "simulate_many"
    found = {}
    for name, given in _signature(call).parameters.items():
        kinds = kinds_of(given.annotation)
        if (function, name) in FILES:
            kinds = (PATH, *kinds)
        if (function, name) in OBJECTS:
            kinds = (Kind("object", (resolved(OBJECTS[function, name]),)),)
        if PATH in kinds:
            kinds = tuple(kind for kind in kinds if kind not in (TEXT, DATA))
        if kinds and name not in WITHHELD and given.kind is not given.VAR_KEYWORD:
            needed = given.default is given.empty
            default = None if needed else given.default
            check = CHECKS.get(f"{function}.{name}", CHECKS.get(name)) if checked else None
            about = described.get(name, "")
            found[name] = Parameter(name, kinds, needed, default, about, check)
    return found


def _signature(call: Callable[..., Any]) -> inspect.Signature:
    """The signature with its annotations as types."""
    inner: Any = inspect.unwrap(call.__init__ if inspect.isclass(call) else call)
    names = Names(getattr(inner, "__func__", inner).__globals__)
    return inspect.signature(call, locals=names, eval_str=True)


def resolved(function: str) -> Any:
    """The public callable of a dotted name; "output" is the section of the files."""
    if function == "output":
        return Output
    return functools.reduce(getattr, function.split("."), antiosc)


def light(function: str) -> bool:
    """Whether a call only checks and stores values: a class of antiosc that holds data."""
    head = function.partition(".")[0]
    heavy = head in ("Structure", "Scene", "AntiOscillators", "Fall")
    return function in LIGHT or (inspect.isclass(resolved(head)) and not heavy)


def takes(function: str, name: str) -> bool:
    """Whether the callable has a parameter of this name, whether or not a file may give it."""
    return name in inspect.signature(resolved(function)).parameters


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
            # the text after the colon is a type, or tells more than that
            tells = len(rest.split()) > 6 and "optional" not in rest
            found |= dict.fromkeys(names, rest.strip() if tells else "")
        elif line.strip():
            found |= {name: f"{found[name]} {line.strip()}".strip() for name in names}
    return {name: _first_sentence(about) for name, about in found.items()}


def _first_sentence(text: str) -> str:
    sentence = re.split(r"(?<=[a-z\])’'”\"])[.;:](?:\s|$)", text, maxsplit=1)[0].rstrip(".")
    return sentence if len(sentence) <= 160 else f"{sentence[:157].rsplit(' ', 1)[0]} …"


def _method(name: str, value: Any) -> Any:
    from antiosc.simulation.comparison import METHODS

    return checks.choice(name, value, METHODS)


def _unit(_: str, value: Any) -> Any:
    from antiosc.io.unit_system import UnitSystem

    return UnitSystem.of(value)


def _quantity(name: str, value: Any) -> Any:
    from antiosc.results.probe import PROBED_QUANTITIES

    return checks.choice(name, value, PROBED_QUANTITIES)


def _until(_: str, value: Any) -> Any:
    from antiosc.studies.drops.drop import end_of

    return end_of(value)


def _cfc(name: str, value: Any) -> Any:
    from antiosc.studies.drops.filters import CLASSES

    return checks.choice(name, value, tuple(CLASSES))


def _count_or_auto(name: str, value: Any) -> Any:
    return value if value == "auto" else checks.whole(name, value, least=0)


def _of(unit: str) -> Check:
    return functools.partial(checks.positive, unit=unit)


#: Parameter, or function and parameter, -> the check of its value. A function checks its values
#: when it runs, which is too late for a file that is only looked at.
CHECKS: dict[str, Check] = {
    **dict.fromkeys(("duration", "step", "timeout"), _of("s")),
    **dict.fromkeys(("size", "merge", "radius", "height", "corner_radius"), _of("m")),
    **dict.fromkeys(("max_contacts", "max_steps", "modes"), checks.whole),
    "accuracy": checks.positive,
    "band": _of("rad/s"),
    "damping": lambda _, value: as_damping(value),
    "density": _of("kg/m³"),
    "filter": _cfc,
    "gap": functools.partial(checks.nonnegative, unit="m"),
    "method": _method,
    "n": _count_or_auto,
    "order": functools.partial(checks.choice, options=(1, 2)),
    "quantity": _quantity,
    "times": checks.filled,
    "tol": lambda name, value: checks.tolerance(value, name),
    "unit": _unit,
    "from_frf.band": functools.partial(checks.array, shape=(2,)),
    "from_frf.damping": functools.partial(checks.choice, options=("viscous", "hysteretic")),
    "read_frf.quantity": functools.partial(
        checks.choice, options=("receptance", "mobility", "accelerance")
    ),
    "read_frf.unit": checks.positive,
    "until": _until,
}
