"""Assembly of a scene for time integration: modes, contact rows, loads, estimates of contacts.

The estimated depth, speed, duration and stiffness of contacts determine the first time step. No
result depends on them except the default tangential stiffness of friction, for which the depth is
computed accurately.
"""

from __future__ import annotations

from collections.abc import Mapping
from ctypes import byref
from dataclasses import dataclass, field
from functools import cached_property
from math import sqrt

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.engine import library
from antiosc.engine.contact import ContactLaw
from antiosc.engine.law_tables import packed_law, raise_error
from antiosc.engine.system import CONTACT_RECORD, System
from antiosc.impact import scene_parts
from antiosc.impact.bodies import Obstacle, SceneBody, scene_body, stacked_first_order
from antiosc.impact.scene_parts import Contact, SceneParts
from antiosc.models.stretch import Stretch

DEPTH_TOL = 0.1  # relative error of a depth


def largest_indentation(
    law: ContactLaw, speed: float, energy: float, load: float, bound: float, rtol: float = DEPTH_TOL
) -> float:
    """Largest indentation [m] of an impact with a contact law, within the relative error `rtol`.

    speed : closing speed [m/s]; energy : kinetic energy [J] of the approach; load : force [N] that
    presses the bodies together; bound : upper bound on the indentation [m].
    """
    kernel, memory = packed_law(law)
    depth = library.library.aom_law_deepest(byref(kernel), speed, energy, load, bound, rtol)
    raise_error(memory)
    return float(depth)


MINDLIN_RATIO = 2 * (1 - 0.3) / (2 - 0.3)  # tangential over normal stiffness for nu = 0.3
FRICTION_DEPTH_TOL = 1e-9  # relative, of the depth that friction's stiffness is taken at
MIN_COMPLIANCE_SHARE = 0.1  # fraction of a tangential compliance left to the slider's spring


def expect_contacts(scene: SceneParts, system: System, local: Array, duration: float) -> float:
    """Set expected depth, speed and mass of each contact; returns the shortest contact time [s]."""
    p = len(system.laws)
    gaps = system.offsets[0, :p]
    modal = system.v if system.v.any() else system.omega * system.q  # of what is let go
    numbers = system.contacts
    numbers["mass"] = [effective_mass(beta, system.omega) for beta in system.beta[:p]]
    forces = np.zeros(p)
    closing = _largest_component(system.beta[:p], modal[None])

    if system.loads.any():
        # bodies at rest are set in motion by the others, at their speed, or by the loads
        forces = _largest_component(system.beta[:p], system.loads)
        falling = np.sqrt(2 * forces * np.maximum(gaps, 1e-3 * duration**2 * forces))
        closing = np.maximum(closing, np.minimum(falling, forces * duration))

    highest_speed = float(closing.max())
    if highest_speed == 0.0:
        numbers["expected_depth"] = numbers["expected_speed"] = 1e-300
        for row, contact in zip(numbers, scene.contacts, strict=True):
            if contact.friction > 0:
                row["friction"] = contact.friction
                row["tangential_stiffness"] = contact.tangential_stiffness or 1.0
        return duration / 16

    numbers["expected_speed"] = np.where(closing > 1e-6 * highest_speed, closing, highest_speed)
    shortest = duration / 2
    for c, law in enumerate(system.laws):
        speed = float(numbers["expected_speed"][c])
        mass = float(numbers["mass"][c])
        load = float(forces[c])
        farthest = speed * duration + load * duration**2
        blow = speed, 0.5 * mass * speed**2, load * mass, farthest
        depth = largest_indentation(law, *blow)
        mean_speed = speed + sqrt(2 * load * depth)
        shortest = min(shortest, 3 * depth / mean_speed)
        numbers["expected_depth"][c] = depth
        contact = scene.contacts[c]
        if contact.friction > 0:
            stiffness = _tangential_stiffness(contact, law, blow, float(local[c]))
            numbers["friction"][c], numbers["tangential_stiffness"][c] = contact.friction, stiffness

    return shortest


def _tangential_stiffness(
    contact: Contact, law: ContactLaw, blow: tuple[float, float, float, float], local: float
) -> float:
    """Tangential stiffness [N/m] of a contact, with the compliance of its patches subtracted.

    The default is `MINDLIN_RATIO` times the mean of the normal stiffness (of loading or unloading,
    the larger one) over a half-sine contact. By Cerruti's solution, the tangential compliance of
    patches is their normal compliance `local` [m/N] over `MINDLIN_RATIO`, for any axisymmetric
    pressure. blow : the arguments `speed` to `bound` of `largest_indentation`.
    """
    stiffness = contact.tangential_stiffness
    if stiffness is None:
        deepest = largest_indentation(contact.law, *blow, rtol=FRICTION_DEPTH_TOL)
        state = law.touch(blow[0])
        slopes = []
        for phase in (np.arange(16) + 0.5) / 16 * (np.pi / 2):
            delta = deepest * np.sin(phase)
            unloading = contact.law.advance(delta, 0.0, state)
            loads = contact.law.tangent(delta, 0.0, state)[0]
            unloads = contact.law.tangent((1 - 1e-9) * delta, 0.0, unloading)[0]
            slopes.append(max(loads, unloads))

        stiffness = MINDLIN_RATIO * float(np.mean(np.where(np.isfinite(slopes), slopes, 0.0)))
        if law is contact.law:  # the patches give way besides, normally and so sideways
            local = 0.0

    patches = stiffness * local / MINDLIN_RATIO  # their share of the contact's compliance
    return stiffness / max(1.0 - patches, MIN_COMPLIANCE_SHARE)


def effective_mass(beta: Array, omega: Array) -> float:
    """Estimated effective mass [kg] at a contact, from rigid-body modes and static deflection."""
    rigid = omega == 0
    b = beta[rigid]
    inverse_mass = float(b @ b)
    b = beta[~rigid]
    deflection = b / omega[~rigid] ** 2
    inertia = float(deflection @ deflection)
    if inertia > 0:
        inverse_mass += float(b @ deflection) ** 2 / inertia

    return 1 / inverse_mass if inverse_mass > 0 else 1.0


def _largest_component(beta: Array, modal: Array) -> Array:
    """Largest |beta · modal| (p,) over K rows of `modal`; 0.1 Σ |terms| where its terms cancel."""
    direct = abs(modal @ beta.T)
    parts = abs(modal) @ abs(beta).T

    if len(modal) > 1:
        direct = direct.max(axis=0)
        parts = parts.max(axis=0)
    else:
        direct = direct[0]
        parts = parts[0]

    return np.where(direct > 1e-9 * parts, direct, 0.1 * parts)


def without_patch(law: ContactLaw, local: float, a: str, b: str) -> tuple[ContactLaw, list[str]]:
    """(law without the patches' half-space compliance `local` [m/N], notes on the sites a, b)."""
    if local == 0.0 or law.compliance > 0.0:
        return law, []

    reduced_law = law.without(local)
    if reduced_law is law:
        return law, [
            f"{law.theory} of {a!r} - {b!r} is taken as given, beside the half-space compliance"
            f" {local:.4g} m/N that the patches give way by."
        ]

    return reduced_law, [
        f"The half-space compliance {local:.4g} m/N of the patches was subtracted from {law.theory}"
        f" of {a!r} - {b!r}, so that the indentation is counted once."
    ]


@dataclass(eq=False)
class Assembly:
    """A scene as one system in modal coordinates, ready for time integration."""

    #: scene, bodies: bodies and contacts as given by the user; the placed bodies by name
    scene: SceneParts
    bodies: dict[str, SceneBody]
    G: Array  # (m, P) rows of `system` (contacts, then friction) per displacement of P columns
    laws: list[ContactLaw]  # contact laws, without the compliance of patches; `notes` say so
    notes: list[str]  # sentences
    system: System  # the system that is integrated in time
    contact_time_estimate: float  # shortest expected contact time [s]
    #: second-order forces of the bodies that stretch, which have further rows in `system`
    stretch_forces: Mapping[str, Stretch] = field(default_factory=dict, kw_only=True)
    #: relative change of the largest contact force due to second-order forces
    stretch_effect: float = field(default=0.0, kw_only=True)
    #: whether more second-order modes would change the results by no more than the tolerance
    stretch_converged: bool = field(default=True, kw_only=True)
    #: energy of second-order strain at the largest force over the linear energy, of a solid that is
    #: taken as linear because it is small; 0.0 for others
    omitted_stretch_ratio: float = field(default=0.0, kw_only=True)
    #: sentence on a linear run whose second-order strain has so much energy that neither theory
    #: holds; "" for others
    theory_warning: str = field(default="", kw_only=True)

    @property
    def stretches(self) -> bool:
        """Whether a body has second-order forces."""
        return any(body.stretch is not None for body in self.bodies.values())

    @cached_property
    def stacked(self) -> scene_parts.StackedBodies:
        """The modes of all bodies and the directions of their sites, side by side."""
        return scene_parts.stacked_bodies(self.bodies)

    def external_forces(self, t: Array) -> Array:
        """External forces (n, P) [N] along all P site directions at times (n,) [s]."""
        return scene_parts.external_forces(self.scene.loads, self.bodies, self.stacked, t)


def assemble_scene(scene: SceneParts, duration: float) -> Assembly:
    """Assemble a scene for time integration; InputError for parts that do not fit together."""
    bodies = {n: scene_body(n, body, scene.motion.get(n)) for n, body in scene.bodies.items()}
    stacked = scene_parts.stacked_bodies(bodies)
    find = scene_parts.find_site
    ends = [(find(contact.a, bodies), find(contact.b, bodies)) for contact in scene.contacts]
    scene_parts.set_axes(ends, bodies)
    normal = []
    tangents = []
    gap = []
    tangential: list[Array] = []
    for contact, (a, b) in zip(scene.contacts, ends, strict=True):
        if all(isinstance(body.body, Obstacle) for body, _ in (a, b)):
            raise InputError(f"both ends, {contact.a!r} and {contact.b!r}, are obstacles.")
        direction = scene_parts.contact_direction(a, b)
        row = scene_parts.relative_row(contact, (a, b), direction, stacked)
        sides = []
        if contact.friction > 0:
            sides = scene_parts.tangential_rows(contact, (a, b), direction, stacked)
        tangents.append((len(ends) + len(tangential), len(sides)))
        normal.append(row)
        tangential += sides
        gap.append(a[0].gap + b[0].gap if contact.gap is None else contact.gap)

    G = np.array(normal + tangential)
    gaps = np.append(gap, np.zeros(len(tangential)))
    breaks, loads, offsets = scene_parts.load_series(scene, bodies, stacked, G, gaps, duration)
    local = np.array([sum(b.local_compliance.get(s, 0.0) for b, s in pair) for pair in ends])
    laws, notes = _laws_without_patches(scene, local)
    if not len(stacked.B):
        raise InputError("nothing in the scene can move: every body is an obstacle.")

    rows = np.zeros(len(laws), CONTACT_RECORD)
    rows["first_tangential"], rows["n_tangential"] = np.transpose(tangents)
    system = System(
        stacked.omega,
        stacked.decay,
        G @ stacked.B.T,
        G @ stacked.r @ G.T,
        breaks,
        loads,
        offsets,
        laws,
        rows,
        stacked.q,
        stacked.v,
        first=stacked_first_order(bodies.values()),
    )
    time = expect_contacts(scene, system, local, duration)

    return Assembly(scene, bodies, G, laws, notes, system, time)


def _laws_without_patches(
    scene: SceneParts, local_compliances: Array
) -> tuple[list[ContactLaw], list[str]]:
    """(laws of all contacts after `without_patch`, all notes)."""
    laws = []
    notes = []
    for contact, local in zip(scene.contacts, local_compliances.tolist(), strict=True):
        stiffness = contact.tangential_stiffness
        if (
            contact.friction
            and stiffness
            and stiffness * local > (1 - MIN_COMPLIANCE_SHARE) * MINDLIN_RATIO
        ):
            notes.append(
                f"The patches of {contact.a!r}, {contact.b!r} give way sideways by"
                f" {local / MINDLIN_RATIO:.4g} m/N, which leaves less than a tenth of the"
                f" compliance of tangential_stiffness = {stiffness:g} N/m: a tenth is taken."
            )
        law, law_notes = without_patch(contact.law, local, contact.a, contact.b)
        laws.append(law)
        notes += law_notes

    return laws, notes
