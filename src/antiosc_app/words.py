"""Messages of the library in the words of a scene file: its calls and arguments as keys."""

from __future__ import annotations

import re

from antiosc.base.errors import Message

#: Call of the library -> the section of a scene that makes it.
SECTIONS = {
    **{"Site": "[sites]", "Support": "[[supports]]", "Structure": "[structure]"},
    **{"extract": "[extract]", "simulate": "[simulate]", "strike": "[strike]"},
    **{"read_mesh": "[geometry]", "read_model": "[deck]", "peak_field": "[stress]"},
    **{"superposition": "[extract]", "drop": "[drop]", "impact_map": "[map]"},
}
#: A call with its arguments, in which one more call may stand.
_CALL = re.compile(
    rf"\b(?:ao\.|antiosc\.)?({'|'.join(SECTIONS)})\(((?:[^()\"]|\([^()]*\))*)\)", re.S
)
#: Truth values of Python -> of a scene.
_TRUTH = {"True": "true", "False": "false"}


def of_scenes(text: str) -> str:
    """A message of the library with keys and sections of a scene in place of its calls; that of a
    warning keeps its category.
    """
    told = _CALL.sub(_keys, text)
    return Message(told, text.category) if isinstance(text, Message) else told


def _keys(call: re.Match[str]) -> str:
    """The keys that a call names, and their section."""
    section = SECTIONS[call[1]]
    given = [_key(argument) for argument in _parted(call[2]) if "=" in argument]
    return f"{', '.join(given)} in {section}" if given else section


def _parted(arguments: str) -> list[str]:
    """The arguments of a call, parted at the commas outside brackets."""
    return [part.strip() for part in re.split(r",(?![^(\[{]*[)\]}])", arguments)]


def _key(argument: str) -> str:
    """An argument, "snap=True", as a line of a scene."""
    name, _, value = argument.partition("=")
    return f"{name} = {_TRUTH.get(value, value)}"
