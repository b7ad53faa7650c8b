"""Structures with exact solutions, by name: `antiosc.models.closed_form.cantilever`."""

from antiosc.models.closed_form import (
    BeamModes,
    StruckBeam,
    SupportedLaminate,
    SupportedPlate,
    UniformBeam,
    cantilever,
    clamped_clamped,
    free_free,
    pinned_free,
    pinned_pinned,
    plate_patch,
    zener,
)

__all__ = [
    "BeamModes",
    "StruckBeam",
    "SupportedLaminate",
    "SupportedPlate",
    "UniformBeam",
    "cantilever",
    "clamped_clamped",
    "free_free",
    "pinned_free",
    "pinned_pinned",
    "plate_patch",
    "zener",
]
