"""Checks of the fields of a dataclass, declared with the fields."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any, ClassVar

from antiosc.base.brief import Given
from antiosc.base.checks import store


def checked_by(check: Callable[..., Any], *others: Any) -> Mapping[str, Any]:
    """Metadata of a field that holds `check(name, value, *others)` of the value given for it."""
    return {"check": lambda name, value: check(name, value, *others)}


class Checked(Given):
    """Base of frozen dataclasses whose fields say by which function they are checked.

    A field with the default None may be None.
    """

    __dataclass_fields__: ClassVar[dict[str, Any]]

    def __post_init__(self) -> None:
        for one in fields(self):
            value = getattr(self, one.name, None)
            if "check" in one.metadata and not (value is None and one.default is None):
                store(self, **{one.name: one.metadata["check"](one.name, value)})
