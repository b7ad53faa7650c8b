"""What several tests of laminates compare with."""

from __future__ import annotations

from antiosc.fem.elements import section_of_layers
from plates import SupportedLaminate


def navier(layers, S=None):
    section = section_of_layers(layers)
    inertia = (section.I0, section.I1, section.I2)
    S = section.S if S is None else S
    return SupportedLaminate(section.A, section.B, section.D, S, inertia, 1.0, 1.0)


def uniform(layers):
    """∫ G dz, the shear stiffness without correction."""
    return sum(layer.transverse_shear() * layer.thickness for layer in layers)
