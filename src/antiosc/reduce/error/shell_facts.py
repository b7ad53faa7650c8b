"""Data of a struck shell for the share "model" of a budget (`antiosc.impact.shell_error`)."""

from __future__ import annotations

from math import sqrt

import numpy as np

from antiosc.fem.elements.shell import Shell
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.models.body import ShellDisc
from antiosc.reduce.site import Functional
from antiosc.reduce.site.sites import located

#: Least cosine between the direction of the blow and the normal of the shell.
ACROSS = 0.9
#: Message where there is no figure.
UNKNOWN = "Not included: the error of the shell model itself, for {}."


def shell_facts(part: MeshedStructure, site: Functional) -> ShellDisc | str | None:
    """Data for the error of shell theory, a sentence why there are none; None of a point load."""
    if site.point is None or site.direction is None or site.radius is None:
        return None
    places = site.point[None, :], site.direction[None, :], np.array([site.radius])
    contact = located(part, *places).contact
    assert contact is not None  # with a radius
    material = part.parts[int(contact.label[0])][0]
    if not isinstance(material, Shell):
        return UNKNOWN.format("it is known of isotropic shells alone")
    if abs(float(site.direction @ contact.normals[0])) < ACROSS:
        return UNKNOWN.format("the shell is not struck across its surface")
    return {
        "nu": material.nu,
        "disc": site.radius / material.thickness,
        "wave": material.thickness * sqrt(material.rho / material.E),
        "compliance": 1 / (material.E * material.thickness),
    }
