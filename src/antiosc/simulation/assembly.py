"""From a scene to the modes, rows and loads that the march takes."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from antiosc.contact import ContactLaw, Hertz, State
from antiosc.errors import InputError
from antiosc.simulation.bodies import PARALLEL, Placed, place
from antiosc.simulation.engine import System
from antiosc.simulation.expected import deepest, stiffness_at
from antiosc.simulation.impactors import Obstacle
from antiosc.simulation.laws import packed
from antiosc.simulation.scene_parts import Contact, SceneParts
from antiosc.simulation.scene_states import between

Array = NDArray[np.float64]

MINDLIN = 2 * (1 - 0.3) / (2 - 0.3)  # tangential over normal stiffness for nu = 0.3
End = tuple[Placed, str]  # a body and the name of its site
DEPTH_ERROR = 1e-9  # relative, of the depth that friction's stiffness is taken at
STIFFEST = 0.1  # share of a tangential compliance that is left to the slider's spring, at least


@dataclass(eq=False)
class Assembly:
    """A scene in one set of modal coordinates.

    Attributes
    ----------
    bodies : the placed bodies; `spans` their modes, `columns` their columns among all.
    B : (J, P) displacements of all columns; r : (P, P).
    G : (m, P) the rows: contacts, then the tangential rows of their friction.
    laws : of the contacts, freed from the compliance of patches; `notes` say so.
    system : what the march takes.
    lasting : expected time of a contact [s], the shortest.
    """

    scene: SceneParts
    bodies: dict[str, Placed]
    spans: dict[str, slice]
    columns: dict[str, slice]
    B: Array
    r: Array
    G: Array
    laws: list[ContactLaw]
    notes: list[str]
    system: System
    lasting: float

    def load(self, t: Array) -> Array:
        """Modal loads (n, J) at times (n,)."""
        return between(t, self.system.breaks, self.system.loads)

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
    spans, columns, j, k = {}, {}, 0, 0
    for name, body in bodies.items():
        spans[name], columns[name] = slice(j, j + body.omega.size), slice(k, k + body.B.shape[1])
        j, k = spans[name].stop, columns[name].stop
    B, r = np.zeros((j, k)), np.zeros((k, k))
    for name, body in bodies.items():
        B[spans[name], columns[name]] = body.B
        r[columns[name], columns[name]] = body.r
    normal: list[Array] = []
    rubbing: list[Array] = []
    tangents: list[tuple[int, int]] = []
    lines: list[Array | None] = []
    ends = [(find(c.a, bodies), find(c.b, bodies)) for c in scene.contacts]
    for contact, pair in zip(scene.contacts, ends, strict=True):
        row, direction = _row(contact, pair, columns, k)
        normal.append(row)
        lines.append(direction)
    for contact, line in zip(scene.contacts, lines, strict=True):
        sides = _tangents(contact, line, bodies, columns, k) if contact.friction > 0 else []
        tangents.append((len(scene.contacts) + len(rubbing), len(sides)))
        rubbing += sides
    G = np.array(normal + rubbing)
    axes = _axes(scene, bodies, lines)
    gaps = np.zeros(len(G))
    for i, (contact, (a, b)) in enumerate(zip(scene.contacts, ends, strict=True)):
        gaps[i] = a[0].gap + b[0].gap if contact.gap is None else contact.gap
    breaks, loads, offsets = _loads(scene, bodies, spans, columns, axes, B, r, G, gaps, duration)
    local = np.array([sum(b.local_compliance.get(s, 0.0) for b, s in pair) for pair in ends])
    laws, notes = _laws(scene, local)
    notes += _order_counts(scene, ends)
    omega = np.concatenate([b.omega for b in bodies.values()])
    if not omega.size:
        raise InputError("nothing in the scene can move: every body is an obstacle.")
    beta = np.ascontiguousarray(G @ B.T)
    mass = np.array([_mass(beta[c], omega) for c in range(len(laws))])
    v = np.concatenate([b.start for b in bodies.values()])
    R = G @ r @ G.T
    gaps = offsets[0, : len(laws)]
    depth, speed, slip, lasting = _scales(scene, laws, mass, beta, v, loads, gaps, local, duration)
    rows = [packed(law) for law in laws]
    params = np.zeros((len(rows), max(values.size for _, values in rows)))
    for row, (_, values) in zip(params, rows, strict=True):
        row[: values.size] = values
    system = System(
        omega=omega,
        decay=np.concatenate([b.decay for b in bodies.values()]),
        beta=beta,
        R=R,
        breaks=breaks,
        loads=loads,
        offsets=offsets,
        kinds=np.array([kind for kind, _ in rows], dtype=np.int64),
        params=params,
        slip=slip,
        tangents=np.array(tangents, dtype=np.int64),
        q=np.zeros(omega.size),
        v=v,
        mass=mass,
        depth=depth,
        speed=speed,
        pressed=np.zeros(len(laws)),
    )
    return Assembly(scene, bodies, spans, columns, B, r, G, laws, notes, system, lasting)


def find(end: str, bodies: dict[str, Placed]) -> tuple[Placed, str]:
    """The body of an end and the name of its site."""
    name, _, site = end.partition(":")
    if name not in bodies:
        raise InputError(f"there is no body {name!r} in the scene; it has {', '.join(bodies)}.")
    body = bodies[name]
    if isinstance(body.body, Obstacle):
        return body, ""
    if not site and len(body.sites) == 1:
        site = next(iter(body.sites))
    if site in body.sites:
        return body, site
    if body.sites == {"": (0,)}:  # one site: its name is free
        return body, ""
    listed = ", ".join(f"{name}:{s}" for s in body.sites)
    raise InputError(f"{end!r} names no site of the body {name!r}; it has {listed}.")


def along(body: Placed, site: str, direction: Array | None, end: str) -> Array:
    """Coefficients (P,) of the body's columns that give a site's displacement along a direction."""
    row = np.zeros(body.B.shape[1])
    if isinstance(body.body, Obstacle):
        return row
    columns = list(body.sites[site])
    if direction is None or body.directions is None:
        row[columns[0]] = 1.0
        return row
    known = body.directions[columns]
    if len(columns) == 1 and (known[0] == direction).all():
        row[columns[0]] = 1.0
        return row
    parts, *_ = np.linalg.lstsq(known.T, direction, rcond=None)
    found = known.T @ parts
    if np.linalg.norm(found) < PARALLEL or found @ direction < PARALLEL * np.linalg.norm(found):
        raise InputError(
            f"the contact at {end!r} is along {np.round(direction, 4).tolist()}, but the model"
            f" knows that site only along {np.round(known, 4).tolist()}; extract it along the"
            f" contact."
        )
    row[columns] = parts
    return row


def _row(
    contact: Contact, ends: tuple[End, End], columns: dict[str, slice], size: int
) -> tuple[Array, Array | None]:
    """Row (P,) of the indentation, and the contact's direction in space, where known."""
    (a, at), (b, bt) = ends
    if isinstance(a.body, Obstacle) and isinstance(b.body, Obstacle):
        raise InputError(f"both ends of the contact {contact.a!r}, {contact.b!r} are obstacles.")
    direction = a.pushes.get(at)
    if direction is None:
        direction = b.pushes.get(bt)
    row = np.zeros(size)
    row[columns[b.name]] += along(b, bt, direction, contact.b)
    row[columns[a.name]] -= along(a, at, direction, contact.a)
    return row, direction


def _order_counts(scene: SceneParts, ends: list[tuple[End, End]]) -> list[str]:
    """Notes on contacts that push the second end against its site's direction."""
    notes = []
    for contact, ((a, at), (b, bt)) in zip(scene.contacts, ends, strict=True):
        push, other = a.pushes.get(at), b.pushes.get(bt)
        if other is not None and (push is None or push @ other > 0):
            notes.append(
                f"The contact {contact.a!r}, {contact.b!r} pushes {contact.b!r} against the"
                f" direction of its site, as it is named second; name it first if it should be"
                f" pushed along it."
            )
    return notes


def _tangents(
    contact: Contact,
    direction: Array | None,
    bodies: dict[str, Placed],
    columns: dict[str, slice],
    size: int,
) -> list[Array]:
    """Rows of the tangential displacement of b against a, one or two."""
    ends = [find(contact.a, bodies), find(contact.b, bodies)]
    moving = [(body, site) for body, site in ends if not isinstance(body.body, Obstacle)]
    if direction is None or any(body.directions is None for body, _ in moving):
        raise InputError(
            f"friction between {contact.a!r} and {contact.b!r} needs ends that move along the"
            f" surface too: a RigidBody, or a model with Site(..., tangential=True)."
        )
    across: list[Array] = []
    for body, site in moving:
        known = body.directions
        assert known is not None
        for i in body.sites[site]:
            side = known[i] - (known[i] @ direction) * direction
            for other in across:
                side = side - (side @ other) * other
            if np.linalg.norm(side) > 0.5:
                across.append(side / np.linalg.norm(side))
    rows = []
    for side in across[:2]:
        row = np.zeros(size)
        for (body, site), sign, end in zip(ends, (-1, 1), (contact.a, contact.b), strict=True):
            row[columns[body.name]] += sign * along(body, site, side, end)
        rows.append(row)
    if not rows:
        raise InputError(
            f"friction between {contact.a!r} and {contact.b!r} needs a site with tangential"
            f" directions: extract it with Site(..., tangential=True)."
        )
    return rows


def _axes(
    scene: SceneParts, bodies: dict[str, Placed], lines: list[Array | None]
) -> dict[str, Array | None]:
    """Direction in space of the one coordinate of each body that knows none itself."""
    axes: dict[str, Array | None] = {}
    for name, body in bodies.items():
        if body.directions is not None and len(body.directions):
            axes[name] = body.directions[0] if body.inertia is None else None
            continue
        axes[name] = None
        for contact, line in zip(scene.contacts, lines, strict=True):
            if line is not None and name in (
                contact.a.partition(":")[0],
                contact.b.partition(":")[0],
            ):
                axes[name] = line
                break
    return axes


def _weights(body: Placed, axis: Array | None, vector: bool) -> Array:
    """Modal forces (J, 3) of unit accelerations along the axes, or (J, 1) along the coordinate."""
    if isinstance(body.body, Obstacle):
        return np.zeros((0, 3 if vector else 1))
    if vector and body.inertia is not None:
        return body.inertia.momentum[:, :3]
    if body.weight is not None and body.weight.ndim == 2:
        if vector:
            return body.weight
        pushes = np.unique(np.round(list(body.pushes.values()), 9), axis=0)
        if len(pushes) == 1:
            return np.asarray(body.weight @ pushes[0])[:, None]
        raise InputError(
            f"{body.name!r} is pushed along several directions: give gravity, or the motion of the "
            "ground, as a vector."
        )
    if body.weight is None:
        raise InputError(
            f"gravity or the ground's motion on {body.name!r} needs what its motion carries:"
            f" extract the model anew, give participation= or inertia="
            + (", or a vector where the body moves in space." if body.inertia is not None else ".")
        )
    if not vector:
        return body.weight[:, None]
    if axis is None:
        raise InputError(
            f"gravity as a vector needs the direction of {body.name!r}: its contacts must have one"
            f" (an extracted model, a RigidBody); else give gravity as a number."
        )
    return body.weight[:, None] * axis


def _loads(
    scene: SceneParts,
    bodies: dict[str, Placed],
    spans: dict[str, slice],
    columns: dict[str, slice],
    axes: dict[str, Array | None],
    B: Array,
    r: Array,
    G: Array,
    gaps: Array,
    duration: float,
) -> tuple[Array, Array, Array]:
    """Times (K,), modal loads (K, J) and offsets (K, m) of all that acts on the scene."""
    if not scene.loads and scene.base is None and not np.any(scene.gravity):
        return np.zeros(1), np.zeros((1, B.shape[0])), gaps[None]
    series = [load.times for load in scene.loads]
    if scene.base is not None:
        series.append(scene.base.times)
    inside = [t[(t > 0) & (t < duration)] for t in series]
    breaks = np.unique(np.concatenate([np.zeros(1), *inside]))
    if len(series) and any(t[-1] >= duration for t in series):
        breaks = np.append(breaks, duration)
    loads, forces = np.zeros((breaks.size, B.shape[0])), np.zeros((breaks.size, B.shape[1]))
    for load in scene.loads:
        body, site = find(load.end, bodies)
        if isinstance(body.body, Obstacle):
            raise InputError(f"the load on {load.end!r} acts on an obstacle, which does not move.")
        row = along(body, site, body.pushes.get(site), load.end)
        forces[:, columns[body.name]] += np.interp(breaks, load.times, load.forces)[:, None] * row
    loads += forces @ B.T
    gravity = np.asarray(scene.gravity)
    vector = gravity.ndim == 1 or (scene.base is not None and scene.base.accelerations.ndim == 2)
    if np.any(gravity):
        for name, body in bodies.items():
            if not np.any(body.omega == 0):
                continue
            if gravity.ndim == 1:
                pull = _weights(body, axes[name], True) @ gravity
            else:
                pull = _weights(body, axes[name], False)[:, 0] * float(gravity)
            if body.supported:
                pull = np.where(body.omega == 0, pull, 0.0)
            loads[:, spans[name]] += pull
    if scene.base is not None:
        given = scene.base.accelerations
        given = given if given.ndim == 2 else given[:, None]
        moved = np.stack(
            [np.interp(breaks, scene.base.times, given[:, i]) for i in range(given.shape[1])], 1
        )
        for name, body in bodies.items():
            weights = _weights(body, axes[name], vector and given.shape[1] == 3)
            if weights.size:
                loads[:, spans[name]] -= moved @ weights.T
    return breaks, loads, gaps - forces @ r @ G.T


def _beside_patches(stiffness: float, local: float) -> float:
    """What is left of a contact's tangential stiffness beside the patches of the bodies.

    By Cerruti's solution a patch whose pressure has the symmetry of a circle gives way sideways
    1/MINDLIN times as much as normally, whatever the pressure.
    """
    patches = stiffness * local / MINDLIN  # their share of the contact's compliance
    return stiffness / max(1.0 - patches, STIFFEST)


def _laws(scene: SceneParts, local_compliances: Array) -> tuple[list[ContactLaw], list[str]]:
    """The laws with the patches' own half-space compliance taken out, and notes on it."""
    laws, notes = [], []
    for contact, local in zip(scene.contacts, local_compliances.tolist(), strict=True):
        law = contact.law
        given = contact.tangential_stiffness
        if contact.friction and given and given * local > (1 - STIFFEST) * MINDLIN:
            notes.append(
                f"The patches of {contact.a!r}, {contact.b!r} give way sideways by"
                f" {local / MINDLIN:.4g} m/N, which leaves less than a tenth of the compliance of"
                f" tangential_stiffness = {given:g} N/m: a tenth is taken."
            )
        if local and isinstance(law, Hertz) and law.compliance == 0.0:
            law = law.without(local)
            notes.append(
                f"The patch's half-space compliance {local:.4g} m/N was taken out of the law of"
                f" {contact.a!r}, {contact.b!r}."
            )
        elif local and not isinstance(law, Hertz):
            notes.append(
                f"The patch's compliance {local:.4g} m/N stays in {contact.a!r}, {contact.b!r}:"
                f" {type(law).__name__} is not Hertz's law."
            )
        laws.append(law)
    return laws, notes


def _mass(beta: Array, omega: Array) -> float:
    """Inertia [kg] that the slowest motions put behind a contact, roughly."""
    rigid = omega == 0
    b = beta[rigid]
    mobility = float(b @ b)
    b = beta[~rigid]
    way = b / omega[~rigid] ** 2
    inertia = float(way @ way)
    if inertia > 0:
        mobility += float(b @ way) ** 2 / inertia
    return 1 / mobility if mobility > 0 else 1.0


def _scales(
    scene: SceneParts,
    laws: list[ContactLaw],
    mass: Array,
    beta: Array,
    v: Array,
    loads: Array,
    gaps: Array,
    local: Array,
    duration: float,
) -> tuple[Array, Array, Array, float]:
    """Depth and speed (p,) that are expected, friction's (p, 2), the shortest contact time [s]."""
    p = len(laws)
    push, speed = np.zeros(p), _felt(beta[:p], v[None])
    if loads.any():
        # what is at rest is set in motion by the others, at their speed, or by the loads
        push = _felt(beta[:p], loads)
        falling = np.sqrt(2 * push * np.maximum(gaps, 1e-3 * duration**2 * push))
        speed = np.maximum(speed, np.minimum(falling, push * duration))
    most = float(speed.max())
    if most == 0.0:
        return np.full(p, 1e-300), np.full(p, 1e-300), np.zeros((p, 2)), duration / 16
    speed = np.where(speed > 1e-6 * most, speed, most)
    depth, slip, lasting = np.zeros(p), np.zeros((p, 2)), duration / 2
    for c, law in enumerate(laws):
        state = law.touch(float(speed[c]))
        energy = 0.5 * mass[c] * speed[c] ** 2
        far = float(speed[c] * duration + push[c] * duration**2)
        depth[c] = deepest(law, state, float(energy), float(push[c] * mass[c]), far)
        pace = speed[c] + sqrt(2 * push[c] * depth[c])
        lasting = min(lasting, 3 * depth[c] / pace)
        contact = scene.contacts[c]
        if contact.friction > 0:
            stiffness, patches = contact.tangential_stiffness, local[c]
            if stiffness is None:
                whole, pull = contact.law, float(push[c] * mass[c])
                most = deepest(whole, state, float(energy), pull, far, close=DEPTH_ERROR)
                stiffness = MINDLIN * _mean_stiffness(whole, most, state)
                if law is whole:  # the patches give way besides, normally and so sideways
                    patches = 0.0
            slip[c] = contact.friction, _beside_patches(stiffness, patches)
    return depth, speed, slip, lasting


def _mean_stiffness(law: ContactLaw, most: float, state: State) -> float:
    """Mean stiffness [N/m] over a contact whose indentation is half a sine in time."""
    phases = (np.arange(16) + 0.5) / 16 * (np.pi / 2)
    return float(np.mean([stiffness_at(law, most * s, state) for s in np.sin(phases)]))


def _felt(beta: Array, modal: Array) -> Array:
    """Largest |beta modal| (p,) over the rows of `modal` (K, J); what is rounding, by its parts.

    A force or motion far from a contact reaches it later.
    """
    direct, parts = abs(modal @ beta.T), abs(modal) @ abs(beta).T
    if len(modal) > 1:
        direct, parts = direct.max(axis=0), parts.max(axis=0)
    else:
        direct, parts = direct[0], parts[0]
    return np.where(direct > 1e-9 * parts, direct, 0.1 * parts)
