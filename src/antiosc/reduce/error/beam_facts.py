"""Data of a struck beam for the share "model" of an error budget.

They exist for straight bars of full rectangular section with a site away from the ends
(`antiosc.impact.error_budget`), since only these were measured against solids, and for round
tubes, whose wall dents under a point load. With the semi-membrane theory of long cylinders
(V. Z. Vlasov; bending along the circumference, stretching along the axis), each harmonic cos nθ of
the wall (radius R of its middle, thickness t, D = E t³/12(1 − ν²)) is a beam on an elastic
foundation with EI = π E t R³/n⁴ and k = π D (n² − 1)²/R³, which yields P/(2√2 EI^¼ k^¾). The sum
over n ≥ 2 (n = 1 is the bending of the tube) is the dent:

    dent/P = WAVES/(2√2 π) (12 (1 − ν²))^¾ (R/t)^(3/2)/(E t),      WAVES = Σ n/(n² − 1)^(3/2)

Shells less beams gave 0.82 of it at R/t = 6, 0.92 at 12, and 0.94 at 16 and 20
(`tests/fem/error/test_beam_model.py`).
"""

from __future__ import annotations

from math import hypot, isclose, pi, sqrt

import numpy as np

from antiosc.base._types import Array
from antiosc.fem.elements import Section
from antiosc.fem.elements.beam import Beam, heights
from antiosc.fem.platform import compat
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.models.body import (
    BeamSection,
    TubeWall,
    strip_bending_frequency,
    thickness_shear_frequency,
)
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
#: Least radius of a tube over its wall: thicker walls are no shells.
RADIUS = 5.0
#: Sum of n/(n² − 1)^(3/2) over n ≥ 2.
WAVES = 0.81321
#: Least 144 I_y I_z/A⁴ of a section of thin walls: 1 of a rectangle, 0.9 (R/t)² of a tube.
THIN = 4.0
#: Message where there is no figure.
UNKNOWN = "Not included: the error of the beam model itself, for {}."
#: What follows it if the walls are thin.
DENTS = (
    " The walls of the section are thin and may dent under the blow, which makes the true force"
    " smaller; a model of shells holds this."
)


def beam_facts(part: MeshedStructure, site: Functional) -> BeamSection | TubeWall | str:
    """Data for the error of beam theory as JSON values, or a sentence why there are none.

    Of a tube, "dent" is the compliance of its wall [m/N]. Of a full bar, "compliance" is 1/(E √A)
    [m/N], "omega" the circular frequency at which the section deforms [rad/s], "clamps" the number
    of fixed ends times the larger side over the length.
    """
    try:
        return _facts(part, site)
    except _Unknown as reason:
        sections = [beam.section for beam, _ in part.parts if isinstance(beam, Beam)]
        thin = any(_spread(section) >= THIN for section in sections)
        return UNKNOWN.format(reason) + DENTS * thin


class _Unknown(Exception):
    """The reason why the error of beam theory cannot be estimated."""


def _facts(part: MeshedStructure, site: Functional) -> BeamSection | TubeWall:
    """Data for the error of beam theory; raises `_Unknown` where none can be given."""
    assert site.point is not None
    assert site.direction is not None  # or HalvedBeams refuses it
    beam = part.parts[0][0]
    _need(len(part.parts) == 1 and isinstance(beam, Beam), "the part has several sections")
    _need(beam.shear and not beam.offset, "it is measured for Timoshenko's beam on its axis alone")
    wall = tube_wall(beam.section)
    _need(
        wall is not None or abs(_spread(beam.section) - 1) <= FULL,
        "it is known for full rectangular sections (Section.rectangle) and round tubes of a radius "
        f"of at least {RADIUS:g} walls (Section.tube) alone",
    )
    if wall is not None:
        return _of_tube(part, beam, site.point, site.direction, *wall)
    return _of_bar(part, beam, site.point, site.direction)


def _of_tube(
    part: MeshedStructure, beam: Beam, point: Array, direction: Array, radius: float, wall: float
) -> TubeWall:
    """Data of a tube with this radius of the wall's middle and this wall [m]."""
    slender = radius / wall
    reach = radius * sqrt(slender) * ((1 - beam.nu**2) / 3) ** 0.25
    _across(direction, _axis_near(part, point, reach))
    bends = (12 * (1 - beam.nu**2)) ** 0.75 * slender**1.5
    return {"dent": WAVES / (2 * sqrt(2) * pi) * bends / (beam.E * wall)}


def _of_bar(part: MeshedStructure, beam: Beam, point: Array, direction: Array) -> BeamSection:
    """Data of a full rectangular bar."""
    axis, ends = _line(part)
    _across(direction, axis)
    length = float(ends[1] - ends[0])
    position = float(point @ axis)
    section = beam.section
    height = sqrt(12 * section.I / section.A)
    width = section.A / height
    if not _along_height(part, beam, axis, direction):
        height, width = width, height
    side = max(height, width)
    _need(length >= LENGTH * side, f"the beam is shorter than {LENGTH:g} times its larger side")
    _need(side <= SIDES * min(height, width), f"one side is more than {SIDES:g} times the other")
    _need(
        min(position - ends[0], ends[1] - position) >= FROM_ENDS * side,
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


def tube_wall(section: Section) -> tuple[float, float] | None:
    """(radius of its middle, thickness) of the wall of a thin round tube [m]; None of others.

    Of the squares of the outer and the inner radius the sum is 4 I/A and the difference A/π.
    """
    mean, half = 2 * section.I / section.A, section.A / (2 * pi)
    outer = sqrt(mean + half)
    if not (section.isotropic and half < mean and _is_round(section, outer)):
        return None
    wall = outer - sqrt(mean - half)
    radius = outer - wall / 2
    return (radius, wall) if radius >= RADIUS * wall else None


def _is_round(section: Section, outer: float) -> bool:
    """Whether a section is a ring of this outer radius [m]: by its outline, or in a deck, which has
    none, by a torsion constant that is the polar moment, as of rings alone.
    """
    if section.outline:
        return all(isclose(hypot(*point), outer, rel_tol=1e-6) for point in section.outline)
    return section.J is not None and isclose(section.J, 2 * section.I, rel_tol=1e-6)


def _spread(section: Section) -> float:
    """144 I_y I_z/A⁴: 1 of a full rectangle, more of thin walls."""
    return 144 * section.I * section.side / section.A**4


def _need(fact: bool, otherwise: str) -> None:
    """Raise `_Unknown` with the reason `otherwise` unless `fact` is true."""
    if not fact:
        raise _Unknown(otherwise)


def _across(direction: Array, axis: Array) -> None:
    """Raise `_Unknown` unless the direction is across the axis."""
    _need(abs(float(direction @ axis)) <= ALONG, "the beam is not struck across its axis")


def _axis_near(part: MeshedStructure, point: Array, reach: float) -> Array:
    """Unit vector along the beam at a point; raises `_Unknown` unless the beam is straight and
    without joints and ends for `reach` [m] to both sides.
    """
    ends = part.mesh.geometry.nodes[:, :2]
    axes = ends[:, 1] - ends[:, 0]
    starts = point - ends[:, 0]
    along = np.einsum("cd,cd->c", starts, axes) / np.einsum("cd,cd->c", axes, axes)
    offsets = starts - np.clip(along, 0.0, 1.0)[:, None] * axes
    nearest = int(np.argmin(np.linalg.norm(offsets, axis=1)))
    axis = axes[nearest] / np.linalg.norm(axes[nearest])
    position = (ends - point) @ axis
    off_line = np.linalg.norm(np.cross(ends - ends[nearest, 0], axis), axis=2)
    is_on_line = off_line <= STRAIGHT * part.mesh.extent()
    is_near = np.linalg.norm(ends - point, axis=2) < reach
    reached = position[is_on_line]
    _need(
        is_on_line[is_near.any(axis=1)].all() and reached.min() <= -reach <= reach <= reached.max(),
        f"an end, a joint or a bend of the tube is within the reach of the dent, {reach:.3g} m",
    )
    return np.asarray(axis)


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
