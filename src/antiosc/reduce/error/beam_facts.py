"""Data of a struck beam for the share "model" of an error budget.

They exist for straight bars of full rectangular section with a site away from the ends
(`antiosc.impact.error_budget`), since only these were measured against solids.
"""

from __future__ import annotations

from math import pi, sqrt

import numpy as np

from antiosc.base._types import Array
from antiosc.fem.elements.beam import Beam, heights
from antiosc.fem.platform import compat
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.models.body import BeamSection, strip_bending_frequency, thickness_shear_frequency
from antiosc.reduce.site import Functional

#: A section is a full rectangle if 144 I_y I_z is A⁴ within this.
FULL = 0.05
# The range in which the errors of beam theory were measured (`impact.error_budget`).
#: Least length over the larger side of the section.
LENGTH = 5.0
#: Least distance of the site from the ends over the larger side.
FROM_ENDS = 2.0
#: Largest ratio of the sides.
SIDES = 2.5
#: Poisson's ratios.
NU = (0.2, 0.4)
#: Largest component of a direction across the required one.
ALONG = 0.02
#: Largest deviation from a straight line over the length.
STRAIGHT = 1e-6
#: Message where there is no figure.
UNKNOWN = "Not included: the error of the beam model itself, for {}."


def beam_facts(part: MeshedStructure, site: Functional) -> BeamSection | str:
    """Data for the error of beam theory as JSON values, or a sentence why there are none.

    "compliance" is 1/(E √A) [m/N], "omega" the circular frequency at which the section deforms
    [rad/s], "clamps" the number of fixed ends times the larger side over the length.
    """
    try:
        return _facts(part, site)
    except _Unknown as reason:
        return UNKNOWN.format(reason)


class _Unknown(Exception):
    """The reason why the error of beam theory cannot be estimated."""


def _facts(part: MeshedStructure, site: Functional) -> BeamSection:
    """Data for the error of beam theory; raises `_Unknown` where none can be given."""
    assert site.point is not None
    assert site.direction is not None  # or HalvedBeams refuses it
    beam = part.parts[0][0]
    _need(len(part.parts) == 1 and isinstance(beam, Beam), "the part has several sections")
    _need(beam.shear and not beam.offset, "it is measured for Timoshenko's beam on its axis alone")
    section = beam.section
    _need(
        abs(144 * section.I * section.side / section.A**4 - 1) <= FULL,
        "it is measured for full rectangular sections alone (Section.rectangle)",
    )
    axis, ends = _line(part)
    _need(abs(float(site.direction @ axis)) <= ALONG, "the beam is not struck across its axis")
    height = sqrt(12 * section.I / section.A)
    width = section.A / height
    if not _along_height(part, beam, axis, site.direction):
        height, width = width, height
    side = max(height, width)
    length = float(ends[1] - ends[0])
    _need(length >= LENGTH * side, f"the beam is shorter than {LENGTH:g} times its larger side")
    _need(side <= SIDES * min(height, width), f"one side is more than {SIDES:g} times the other")
    site_position = float(site.point @ axis)
    _need(
        min(site_position - ends[0], ends[1] - site_position) >= FROM_ENDS * side,
        f"the site is nearer to an end than {FROM_ENDS:g} times the larger side",
    )
    _need(NU[0] <= beam.nu <= NU[1], f"it is measured for Poisson's ratios of {NU[0]} to {NU[1]}")
    material = beam.E, beam.nu, beam.rho
    fails = min(
        strip_bending_frequency(width, height, *material),
        thickness_shear_frequency(height, *material),
    )
    return {
        "compliance": 1 / (beam.E * sqrt(section.A)),
        "omega": 2 * pi * fails,
        "clamps": 2.0 * bool(len(part.fixed)) * side / length,
    }


def _need(fact: bool, otherwise: str) -> None:
    """Raise `_Unknown` with the reason `otherwise` unless `fact` is true."""
    if not fact:
        raise _Unknown(otherwise)


def _line(part: MeshedStructure) -> tuple[Array, Array]:
    """(unit vector, places of the ends) along a beam; InputError unless it is one straight line."""
    x = part.mesh.dolfinx.geometry.x
    _, sizes, directions = np.linalg.svd(x - x.mean(axis=0), full_matrices=False)
    _need(sizes[1] <= STRAIGHT * sizes[0], "the beams are not one straight line (joints count)")
    reach = x @ directions[0]
    return directions[0], np.array([reach.min(), reach.max()])


def _along_height(part: MeshedStructure, beam: Beam, axis: Array, direction: Array) -> bool:
    """Whether the section's height lies along the impact; raises `_Unknown` if no side does."""
    if part.mesh.gdim == 2 or beam.section.isotropic:
        return True
    nodes = compat.geometry_nodes(part.mesh.dolfinx)[:1]
    middle = part.mesh.dolfinx.geometry.x[nodes].mean(axis=1)
    height = heights(beam, axis[None, :], middle)[0]
    height = height - (height @ axis) * axis
    share = abs(float(height @ direction)) / float(np.linalg.norm(height))
    _need(share <= ALONG or share >= sqrt(1 - ALONG**2), "the impact is not along a side")
    return share > ALONG
