"""From a scene to the modes, rows and loads that the march takes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TypeAlias, cast

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.contact import ContactLaw
from antiosc.simulation.bodies.bodies import Placed, first_order_of, may_turn, place
from antiosc.simulation.march.system import System
from antiosc.simulation.problem.rows import (
    acting,
    along,
    axes_of,
    find,
    give_axes,
    row_of,
    tangents_of,
)
from antiosc.simulation.problem.scales import MINDLIN, STIFFEST, freed, mass_behind, scales
from antiosc.simulation.problem.scene_parts import SceneParts
from antiosc.simulation.problem.scene_states import modal_loads

Parts: TypeAlias = tuple[SceneParts, dict[str, Placed]]


def known(scene: SceneParts, bodies: dict[str, Placed]) -> Callable[[], Parts]:
    """What gives a scene and its bodies that are made already, and can be pickled."""
    return cast("Callable[[], Parts]", partial(tuple, (scene, bodies)))


@dataclass(eq=False)
class Assembly:
    """A scene in one set of modal coordinates.

    What the march does not need is found when it is first asked for.

    Attributes
    ----------
    parts : makes the scene and its bodies.
    G : (m, P) the rows: contacts, then the tangential rows of their friction.
    laws : of the contacts, freed from the compliance of patches; `notes` say so.
    system : what the march takes.
    lasting : expected time of a contact [s], the shortest.
    turns : whether the rotation of a body is known, and not 0.
    """

    parts: Callable[[], Parts]
    G: Array
    laws: list[ContactLaw]
    notes: list[str]
    system: System
    lasting: float
    turns: bool

    @cached_property
    def _parts(self) -> Parts:
        return self.parts()

    @cached_property
    def _sides(self) -> tuple[dict[str, slice], dict[str, slice], Array, Array]:
        return side_by_side(self.bodies)

    @property
    def scene(self) -> SceneParts:
        """The bodies and contacts as they were given."""
        return self._parts[0]

    @property
    def bodies(self) -> dict[str, Placed]:
        """The placed bodies by name."""
        return self._parts[1]

    @property
    def spans(self) -> dict[str, slice]:
        """The modes of each body among those of all."""
        return self._sides[0]

    @property
    def columns(self) -> dict[str, slice]:
        """The columns of each body among those of all."""
        return self._sides[1]

    @property
    def B(self) -> Array:
        """Displacements (J, P) of all columns."""
        return self._sides[2]

    @property
    def r(self) -> Array:
        """Residual compliance (P, P) of all columns."""
        return self._sides[3]

    def load(self, t: Array) -> Array:
        """Modal loads (n, J) at times (n,)."""
        return modal_loads(self.system, t)

    def pushes(self, t: Array) -> Array:
        """External forces (n, P) on all columns at times (n,)."""
        total = np.zeros((t.size, self.B.shape[1]))
        for load in self.scene.loads:
            body, site = find(load.end, self.bodies)
            row = along(body, site, body.pushes.get(site), load.end)
            value = np.interp(t, load.times, load.forces)
            total[:, self.columns[body.name]] += value[:, None] * row
        return total


def assemble(scene: SceneParts, duration: float) -> Assembly:
    """The scene ready to integrate; InputError for what does not fit together."""
    bodies = {n: place(n, body, scene.motion.get(n)) for n, body in scene.bodies.items()}
    spans, columns, B, r = side_by_side(bodies)
    k = len(r)
    normal: list[Array] = []
    rubbing: list[Array] = []
    tangents: list[tuple[int, int]] = []
    lines: list[Array | None] = []
    ends = [(find(c.a, bodies), find(c.b, bodies)) for c in scene.contacts]
    give_axes(scene, ends, bodies)
    for contact, pair in zip(scene.contacts, ends, strict=True):
        row, direction = row_of(contact, pair, columns, k)
        normal.append(row)
        lines.append(direction)
    for contact, line in zip(scene.contacts, lines, strict=True):
        sides = tangents_of(contact, line, bodies, columns, k) if contact.friction > 0 else []
        tangents.append((len(scene.contacts) + len(rubbing), len(sides)))
        rubbing += sides
    G = np.array(normal + rubbing)
    axes = axes_of(bodies)
    gaps = np.zeros(len(G))
    for i, (contact, (a, b)) in enumerate(zip(scene.contacts, ends, strict=True)):
        gaps[i] = a[0].gap + b[0].gap if contact.gap is None else contact.gap
    breaks, loads, offsets = acting(scene, bodies, spans, columns, axes, B, r, G, gaps, duration)
    local = np.array([sum(b.local_compliance.get(s, 0.0) for b, s in pair) for pair in ends])
    laws, notes = _laws(scene, local)
    omega = np.concatenate([b.omega for b in bodies.values()])
    if not omega.size:
        raise InputError("nothing in the scene can move: every body is an obstacle.")
    beta = np.ascontiguousarray(G @ B.T)
    mass = np.array([mass_behind(beta[c], omega) for c in range(len(laws))])
    v = np.concatenate([b.start for b in bodies.values()])
    gaps = offsets[0, : len(laws)]
    depth, speed, slip, lasting = scales(scene, laws, mass, beta, v, loads, gaps, local, duration)
    system = System(
        omega=omega,
        decay=np.concatenate([b.decay for b in bodies.values()]),
        beta=beta,
        R=G @ r @ G.T,
        breaks=breaks,
        loads=loads,
        offsets=offsets,
        laws=laws,
        slip=slip,
        tangents=np.array(tangents, dtype=np.int64),
        q=np.concatenate(
            [
                np.zeros(b.omega.size) if b.displaced is None else b.displaced
                for b in bodies.values()
            ]
        ),
        v=v,
        mass=mass,
        depth=depth,
        speed=speed,
        pressed=np.zeros(len(laws)),
        first=first_order_of(bodies.values()),
    )
    turns = any(map(may_turn, bodies.values()))
    return Assembly(known(scene, bodies), G, laws, notes, system, lasting, turns)


def side_by_side(
    bodies: Mapping[str, Placed],
) -> tuple[dict[str, slice], dict[str, slice], Array, Array]:
    """Modes and columns of each body among those of all, and the matrices B and r of all."""
    spans, columns, j, k = {}, {}, 0, 0
    for name, body in bodies.items():
        spans[name], columns[name] = slice(j, j + body.omega.size), slice(k, k + body.B.shape[1])
        j, k = spans[name].stop, columns[name].stop
    B, r = np.zeros((j, k)), np.zeros((k, k))
    for name, body in bodies.items():
        B[spans[name], columns[name]] = body.B
        r[columns[name], columns[name]] = body.r
    return spans, columns, B, r


def _laws(scene: SceneParts, local_compliances: Array) -> tuple[list[ContactLaw], list[str]]:
    """The laws without the half-space compliance of the patches, and notes on it."""
    laws, notes = [], []
    for contact, local in zip(scene.contacts, local_compliances.tolist(), strict=True):
        given = contact.tangential_stiffness
        if contact.friction and given and given * local > (1 - STIFFEST) * MINDLIN:
            notes.append(
                f"The patches of {contact.a!r}, {contact.b!r} give way sideways by"
                f" {local / MINDLIN:.4g} m/N, which leaves less than a tenth of the compliance of"
                f" tangential_stiffness = {given:g} N/m: a tenth is taken."
            )
        law, told = freed(contact.law, local, contact.a, contact.b)
        laws.append(law)
        notes += told
    return laws, notes
