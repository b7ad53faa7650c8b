"""Shear panels (CSHEAR): springs against the shear of four corners.

The forces along the four sides that are in equilibrium with each other are known but for a factor.
The panel is one spring in the motion on which they do work; its compliance is the energy of that
shear (S. J. Garvey, *The quadrilateral shear panel*, Aircraft Engineering 23, 1951), exact for
parallelograms.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from antiosc.io.deck import Array, Place
from antiosc_decks.model.constraints import Term


class Panel(NamedTuple):
    """The section of a shear panel, in the deck's units."""

    G: float
    nu: float
    thickness: float
    #: mass per area
    mass: float
    #: E of the rods along its sides, and F1, F2: what of the panel is in those of 12 and 34, 23 and
    #: 41, as shares of its thickness and width (from 1.01: of the square of its thickness)
    E: float
    effective: tuple[float, float]
    place: Place

    @property
    def across(self) -> float:
        """Thickness."""
        return self.thickness

    @property
    def dimension(self) -> int:
        """It has an area."""
        return 2


def shear_spring(panel: Panel, nodes: list[int], x: Array) -> tuple[list[Term], float]:
    """(motion of the corners `nodes` at x (4, 3), stiffness against it)."""
    sides, area, z = _sides(panel, x)
    plane = np.linalg.svd(z[None])[2][1:]
    flat, along = (x - x.mean(axis=0)) @ plane.T, sides @ plane.T
    length = np.linalg.norm(along, axis=1)
    unit = along / length[:, None]
    arms = flat[:, 0] * unit[:, 1] - flat[:, 1] * unit[:, 0]
    forces = np.linalg.svd(np.vstack([unit.T, arms / length.max()]))[2][-1]
    flow = forces / length
    if not np.abs(flow).min() > 1e-6 * np.abs(flow).max():
        raise panel.place.error("a shear panel needs four corners of less than 180°.")
    cosines = [abs(unit[k] @ unit[k + 2]) for k in (0, 1)]
    pair = int(np.argmax(cosines))
    upright = np.array([-unit[pair, 1], unit[pair, 0]])
    s, c = ((unit[k] @ unit[pair]) / (unit[k] @ upright) for k in (1 - pair, 3 - pair))
    skew = 1 + 2 / (3 * (1 + panel.nu)) * (s * s + s * c + c * c)
    shear = float(np.sqrt(np.abs(np.prod(flow))))
    compliance = area * shear * skew / (panel.G * panel.thickness)
    terms = []
    for k, node in enumerate(nodes):
        load = (forces[k] * unit[k] + forces[k - 1] * unit[k - 1]) / 2 @ plane
        terms += [(node, motion, float(load[motion])) for motion in range(3)]
    return terms, 1 / compliance


def side_areas(panel: Panel, x: Array) -> list[float]:
    """Areas of the rods along the sides 12, 23, 34 and 41."""
    sides, area, _ = _sides(panel, x)
    length = np.linalg.norm(sides, axis=1)
    t, found = panel.thickness, []
    for k, factor in enumerate(panel.effective):
        width = area / (length[k] + length[k + 2])
        found.append(factor * t * (width if factor <= 1.01 else t / 2))
    return found * 2


def _sides(panel: Panel, x: Array) -> tuple[Array, float, Array]:
    """(sides (4, 3), area, normal) of corners in one plane, or nearly so."""
    normal = np.cross(x[2] - x[0], x[3] - x[1])
    size = float(np.linalg.norm(normal))
    if not size > 1e-12 * float(np.ptp(x, axis=0).max()) ** 2:
        raise panel.place.error("the corners of a shear panel lie on one line.")
    return np.roll(x, -1, axis=0) - x, size / 2, normal / size
