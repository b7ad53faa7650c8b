"""Structures with exact solutions, such as `antiosc.closed_form.cantilever`."""

from antiosc.models.closed_form import *  # noqa: F403
from antiosc.models.closed_form import __all__ as __all__
