"""Modules that are imported when a name of them is first used, so that materials, and what needs
their numbers alone, are made without the finite-element packages.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from antiosc.base.errors import finite_element_packages


class _Later:
    """A module in waiting; MissingDependencyError where it is not installed."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, name: str) -> Any:
        with finite_element_packages():
            return getattr(import_module(self._name), name)


if TYPE_CHECKING:
    import ufl as ufl

    from antiosc.fem.platform import compat as compat
else:
    ufl = _Later("ufl")
    compat = _Later("antiosc.fem.platform.compat")
