"""Dents due to the contacts of a fall, and errors of the contact forces due to their laws.

Sharp corners touch as balls of the corner's radius, or as corners that the floor presses flat
(`crushed`); their force has an error of ± 40 %. If vertices beside a corner touch too, the error is
unknown, and a sentence gives the reason and the remedy.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from math import inf, nan, pi, sqrt
from typing import NamedTuple, cast

import numpy as np

from antiosc import ContactLaw, Dent, ElasticPlastic, Gonthier, Hertz, Tabulated
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.base.texts import engineering, percent
from antiosc.engine.contact.choice import Choice
from antiosc.engine.contact.dent import rim_radius
from antiosc.engine.contact.peak_error import error_of_peak, largest_strain
from antiosc.engine.contact.surfaces import Matter, crack_note
from antiosc.impact.histories.verdict import ContactZone
from antiosc_studies.drops.crushed import FORCE_ERROR, PRESSURE_RATIO
from antiosc_studies.drops.episode import Episode
from antiosc_studies.drops.floor import Floor, law_at, law_choice, surface_at
from antiosc_studies.drops.free_body import FreeBody

#: Share of the largest force below which the error of a contact does not count.
COUNTED_FORCE_SHARE = 0.1
#: A given law with a smaller stiffness over that of the surfaces is softer than these.
SOFT_LAW_RATIO = 0.9


class PointContact(NamedTuple):
    """A contact at a point and its largest force."""

    body: FreeBody
    floor: Floor
    point: int  # number of the point
    place: Array  # (3,) in the axes of the mesh [m]
    law: ContactLaw
    force: float  # [N]
    depth: float  # largest indentation [m]
    contact_time: float  # [s]
    dent: Dent | None  # if it yielded
    clearance: float  # least height of another vertex over the point [m]
    crushed: bool  # whether its law is that of a crushed corner

    @property
    def material(self) -> Matter:
        """The material of the part there."""
        return cast("Matter", self.body.materials[self.point])

    @property
    def choice(self) -> Choice | None:
        """The law chosen by both surfaces, even if the floor has one; None if unknown."""
        of_faces = Floor(self.floor.material)
        try:
            return law_choice(of_faces, surface_at(self.body, self.point))
        except InputError:
            return None

    @property
    def _yield_ratio(self) -> float:
        """Force over the force at first yield of the surfaces; 0 if the contact law itself yields,
        or is softer than the surfaces.
        """
        law = None if self.choice is None else self.choice.law
        if isinstance(self.law, ElasticPlastic) or not isinstance(law, ElasticPlastic):
            return 0.0
        is_softer = getattr(self.law, "stiffness", 0.0) < SOFT_LAW_RATIO * law.stiffness
        return 0.0 if is_softer else self.force / law.yield_force

    @property
    def radius(self) -> float:
        """Radius [m] of the contact at its largest indentation."""
        if self.crushed and isinstance(self.law, ElasticPlastic):
            return sqrt(self.force / (pi * PRESSURE_RATIO * self.law.yield_strength))
        if isinstance(self.law, ElasticPlastic):
            return rim_radius(self.law, self.depth)
        return sqrt(self.depth * float(self.body.radii[self.point].min()))

    @property
    def zone(self) -> ContactZone:
        """The zone around the contact that stress margins exclude, in the axes of the mesh."""
        return ContactZone(self.place, self.radius, inf, self.force, self.material.nu)

    @property
    def error(self) -> float | None:
        """Relative error of the force due to its law; None if unknown (`no_error_reason`)."""
        choice = self.choice
        if self.no_error_reason or choice is None:
            return None
        if self.crushed:
            return FORCE_ERROR

        of_ball = error_of_peak(choice, self.force, self.contact_time)
        return max(of_ball or 0.0, FORCE_ERROR) if self.sharp else of_ball

    @property
    def sharp(self) -> bool:
        """Whether the point is a sharp corner of a solid."""
        return self.body.sharp is not None and bool(self.body.sharp[self.point])

    @property
    def no_error_reason(self) -> str:
        """Reason why the error of the force is unknown, with the remedy; "" if it is known."""
        body, floor, i = self.body, self.floor, self.point
        if floor.law is not None:
            return "the error of a given law of the contact is not known"
        if floor.layer is not None:
            return "the error of the law of a soft layer is not known"

        choice = self.choice
        if choice is None or choice.unknown:
            return "the error of that force is not known: give part and floor a yield strength"

        radius = float(body.radii[i].min())
        if self.sharp and 2 * self.depth > self.clearance:
            return (
                "edges or faces beside the corner lie so flat that they touch too: the force is a"
                " lower bound (another tilt, or a law of the floor)"
            )
        if not self.sharp and float(body.radii[i].max()) > body.extent and not body.ball_radii[i]:
            return (
                "the part lands on a surface that is straight in one direction, at vertices of its "
                "mesh: smaller cells, or a floor with its own law, narrow it"
            )
        if error_of_peak(choice, self.force, self.contact_time) is None:
            return (
                f"the contact is pressed in by {self.depth / radius:.2g} of its radius; the force's"
                f" error is known up to {largest_strain(choice):g} of it: take a larger corner"
                " radius, or a soft layer on the floor"
            )

        return ""

    @property
    def yield_text(self) -> str:
        """Sentence: the contact yields; "" if it does not, or if that is unknown."""
        choice = self.choice

        if self.dent is not None:
            soft = None if choice is None or self.floor.law is not None else choice.soft
            sides = (("part", self.material), ("floor", self.floor.face.matter))
            names = [
                f"the {side}" + (f" ({matter.name})" if matter.name else "")
                for side, matter in sides
                if soft is not None and matter == soft
            ]
            where = " and ".join(names) or "the part"
            return f"the contact yields: {self.dent.text}, in {where}; {self.error_text}"

        if self._yield_ratio > 1:
            return (
                f"the contact yields: its force is {self._yield_ratio:.3g} times that of first "
                "yield, and the force of this law is too high"
            )

        return ""

    @property
    def error_text(self) -> str:
        """Text: the error of the force, or the reason why it is unknown."""
        bar = self.error
        return self.no_error_reason if bar is None else f"that force may be off by {percent(bar)}"


def point_contacts(floor: Floor, episodes: Sequence[Episode]) -> Iterator[PointContact]:
    """Yield the contacts of episodes with a law of Hertz, Gonthier or `ElasticPlastic`."""
    for episode in episodes:
        body = episode.body
        forces = episode.forces()[1]
        peaks = forces.max(axis=0).tolist()
        depths = episode.depths().tolist()

        arms = episode.start.positions(body, episode.indices)
        for k, i in enumerate(episode.indices.tolist()):
            law = law_at(body, floor, i)
            crushed = isinstance(episode.history.assembly.laws[k], Tabulated)
            history = episode.history.contact_histories[k]
            is_of_surfaces = isinstance(law, ElasticPlastic | Hertz | Gonthier)
            if not is_of_surfaces or not history.contacts or depths[k] <= 0:
                continue  # it may touch after the end of the episode, up to which its run goes on
            yields = isinstance(law, ElasticPlastic) and peaks[k] > law.yield_force
            start, end = max(history.contacts, key=lambda span: span[1] - span[0])
            place = body.centre + arms[k] @ episode.start.R
            dent = history.dent if yields else None
            lines = np.delete(body.vertices, i, axis=0) - body.vertices[i]
            apart = np.linalg.norm(lines, axis=1) > body.corner_radius
            yield PointContact(
                *(body, floor, i, place, law, peaks[k], depths[k], end - start, dent),
                clearance=float((lines @ episode.start.R[2]).min(initial=inf, where=apart)),
                crushed=crushed,
            )


#: Least number of vertices of a face.
FEWEST_FACE_VERTICES = 3
#: Spread of the vertices that touch over that of a ball's contact, from which a face lies flat.
FLAT_SPREAD_RATIO = 2.0


class PointContacts:
    """The contacts at points in some episodes: errors of their forces, yield and dents."""

    def __init__(self, floor: Floor, episodes: Sequence[Episode]) -> None:
        self.floor = floor
        self.episodes = episodes
        self.contacts = list(point_contacts(floor, episodes))
        self.hardest = max(self.contacts, key=lambda one: one.force, default=None)
        largest = 0.0 if self.hardest is None else self.hardest.force
        self.counted = [one for one in self.contacts if one.force >= COUNTED_FORCE_SHARE * largest]

    @cached_property
    def law_error(self) -> float | None:
        """Relative error of the largest contact force due to the laws; None if unknown."""
        errors = [(one.error, one.force) for one in self.counted]
        if self.hardest is None or self.lands_flat or any(error is None for error, _ in errors):
            return None
        return max((error or 0.0) * force for error, force in errors) / self.hardest.force

    @property
    def no_error_reason(self) -> str:
        """Reason why `law_error` is unknown, with the remedy; "" if it is known."""
        if self.lands_flat:
            return "a face lands flat, which is outside of this method: tilt it"
        if self.hardest is None:
            return "the error of the contact's law is not known"
        return next((one.no_error_reason for one in self.counted if one.no_error_reason), "")

    @property
    def yield_text(self) -> str:
        """Sentence: a contact yields, with its deepest dent; "" if none does."""
        dents = [one for one in self.contacts if one.dent is not None]
        if not dents:
            return "" if self.hardest is None else self.hardest.yield_text

        deepest = max(dents, key=lambda one: one.depth)
        if len({one.point for one in self.contacts}) == 1:
            return deepest.yield_text

        own = engineering(deepest.force, "N")
        return f"{deepest.yield_text} (at one of the places that touch, under {own} of the force)"

    @property
    def deepest_dent(self) -> float:
        """Depth of the deepest dent [m]; NaN without a dent, or if it is unknown."""
        dents = (one.dent for one in self.contacts)
        return max((dent.depth for dent in dents if dent is not None), default=nan)

    @property
    def notes(self) -> tuple[str, str]:
        """Sentences (or ""): the hardest contact is elastic; cracks are not computed."""
        one = self.hardest
        if one is None:
            return "", ""
        known = self.floor.law is not None or one.dent is not None or one.error == 0
        elastic = "" if known else f"the hardest contact is elastic: {one.error_text}"
        return elastic, crack_note(one.body.matters).rstrip(".")

    @cached_property
    def lands_flat(self) -> bool:
        """Whether a face lands flat on a stiff floor: the vertices that touch are far apart."""
        if self.floor.law is not None or self.floor.layer is not None:
            return False

        for episode in self.episodes:
            body, up = episode.body, episode.start.R[2]
            if body.structure is None:  # a rigid part, which has no waves
                return False
            touched = list(point_contacts(self.floor, [episode]))
            depth = max((one.depth for one in touched), default=0.0)
            radius = max((float(body.radii[one.point].max()) for one in touched), default=0.0)

            heights = body.vertices @ up
            low = body.vertices[heights - heights.min() <= depth]
            if len(low) < FEWEST_FACE_VERTICES:
                continue
            spread = np.linalg.svd(low - low.mean(axis=0), compute_uv=False)[1] / sqrt(len(low))
            if spread > FLAT_SPREAD_RATIO * sqrt(2 * radius * depth):
                return True

        return False
