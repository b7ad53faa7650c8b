"""Constructors check their own values: calls are tried, and what they refuse gets its line."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from antiosc.errors import AntioscError, InputError
from antiosc.scene_file.kinds import NUMBER
from antiosc.scene_file.locations import Place
from antiosc.scene_file.parameters import Parameter, resolved
from antiosc.scene_file.problems import Problems, label
from antiosc.scene_file.program import Call, Evaluation
from antiosc.scene_file.sections import impactors

#: A sound modulus, density, length and Poisson's ratio, in place of one that is not.
STAND_IN = 0.3


def light(function: str) -> bool:
    """Whether a call only checks and stores values: a class of antiosc that holds data."""
    if function in impactors():
        return True
    made = resolved(function.split(".")[0])
    heavy = function.startswith(("Structure", "Scene")) or function == "AntiOscillators.load"
    return isinstance(made, type) and not heavy and function != "output"


def values_tried(
    problems: Problems,
    call: Call,
    known: Mapping[str, Parameter],
    table: Mapping[str, Any],
    whole: bool,
) -> bool:
    """Whether a constructor takes its values; a number that it refuses is noted.

    Then another stands in for it, so that the next mistake is found too; also for numbers that are
    missing or wrong otherwise (not `whole`).
    """
    arguments = dict(call.arguments)
    stand_ins: set[str] = set()
    if not whole:
        lost = [n for n, p in known.items() if n not in arguments and (p.needed or n in table)]
        if None in arguments.values() or any(NUMBER not in known[n].kinds for n in lost):
            return False
        arguments |= dict.fromkeys(lost, STAND_IN)
        stand_ins |= set(lost)
    for _ in range(len(arguments) + 1):
        refusal = _refusal(replace(call, arguments=arguments))
        if refusal is None:
            return not stand_ins
        place, sentence = refused(refusal.call, refusal.error)
        key = str(place[len(call.place)]) if len(place) > len(call.place) else ""
        if (whole or key in arguments) and key not in stand_ins:
            problems.add(place, sentence)
        if not isinstance(arguments.get(key), float) or key in stand_ins:
            return False
        arguments[key] = STAND_IN
        stand_ins.add(key)
        whole = False
    return False


def tried(problems: Problems, call: Call) -> Call | None:
    """The call if it can be evaluated, or if a later statement makes what it refers to."""
    refusal = _refusal(call)
    if refusal is None:
        return call
    problems.add(*refused(refusal.call, refusal.error))
    return None


def refused(call: Call, error: Exception) -> tuple[Place, str]:
    """Where and what is wrong, of an exception of a call."""
    if not isinstance(error, AntioscError):
        error = InputError(f"{type(error).__name__}: {error}")
    text = str(error).rstrip(".")
    return _place_of(call, text), f"{label(call.place)}: {text}."


class _Refused(Exception):
    """The exception of one call."""

    def __init__(self, call: Call, error: Exception) -> None:
        super().__init__(str(error))
        self.call, self.error = call, error


def _refusal(call: Call) -> _Refused | None:
    """What a call refuses; None if it can be evaluated as far as its variables are known."""
    try:
        Evaluation(_Refused).value(call)
    except _Refused as refusal:
        return refusal
    except KeyError:  # a variable that another statement makes
        return None
    return None


def _place_of(call: Call, text: str) -> Place:
    """The key that a message is about: one whose name or text occurs in it."""
    best: tuple[int, Place] = (len(text) + 1, call.place)
    for name, value in call.arguments.items():
        for sought, place in _words(name, value, (*call.place, name)):
            found = re.search(rf"(?<![\w]){re.escape(sought)}(?![\w])", text)
            if found and found.start() < best[0]:
                best = found.start(), place
    return best[1]


def _words(name: str, value: Any, place: Place) -> list[tuple[str, Place]]:
    """What a message may say of an argument: its name, its text, texts within it; their places."""
    found = [(name, place)] if not name.startswith("*") else []
    if isinstance(value, str):
        found.append((repr(value), place))
    elif isinstance(value, Call):
        for key, inner in value.arguments.items():
            found += [w for w in _words(key, inner, (*value.place, key)) if w[0][0] == "'"]
    elif isinstance(value, list | tuple):
        for number, inner in enumerate(value):
            found += [w for w in _words("*", inner, (*place, number)) if w[0][0] == "'"]
    return found
