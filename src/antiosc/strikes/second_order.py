"""Impacts with second-order forces if the linear run shows that they may matter."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from math import inf
from typing import TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from antiosc.base.errors import (
    AccuracyWarning,
    AntioscError,
    InputError,
    Message,
    warn,
    warnings_to,
)
from antiosc.base.texts import STOPPED, percent, plain
from antiosc.fem.assembly import with_parts
from antiosc.fem.structure.structure import Structure
from antiosc.impact.histories import History
from antiosc.impact.histories.linear_theory import (
    HOPELESS,
    is_far,
    large_deflection_message,
    may_stretch,
    neither_theory,
    stretch_estimate,
)
from antiosc.impact.stretching import shares_of
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.body import info_of
from antiosc.models.stretch import MOST
from antiosc.reduce.extraction.stretching import second_order_energies, with_stretch

H = TypeVar("H", bound=History)
#: Simulates the impact on a model.
Run = Callable[[AntiOscillators], H]
#: The models with second-order forces of so many modes, by the models without them, as long as
#: these are in use: the forces are the same for every striker, and take longer than the impact.
_WITH_STRETCH: WeakKeyDictionary[AntiOscillators, dict[int, AntiOscillators]] = WeakKeyDictionary()
#: Change of the force up to which few modes are enough, and their number: each pair takes a solve.
SLIGHT, FEW = 0.1, 12
#: Energy of second-order strain over the linear one up to which a solid is taken as linear: runs
#: with more and more motions of solids scatter by more than what these change.
SLIGHT_ENERGY = 0.05
#: Error of the force by second-order forces, over the force, above which they ran away: a clip of
#: 0.2 mm had 5.49 N with 18 motions, 0.19 N with 12 and 0.15 N with 2.
MOST_SHARE = 1.0
#: Times until the last parting at which the deflection is compared.
SAMPLES = 400


def simulated(structure: Structure, model: AntiOscillators, run: Run[H]) -> H:
    """The impact on a model of a structure, with second-order forces if they are not negligible.

    Warnings are those of the run that is returned.
    """
    with _collected_warnings() as warnings:
        linear = run(model)
    if model.stretch is None and may_stretch(linear):
        energy = energy_of_solid(structure, linear)
        of_any = energy if energy < inf or not is_far(linear) else _energy(structure, linear)
        if energy <= SLIGHT_ENERGY:
            linear, warnings = _left_out(linear, warnings, of_any)
        elif HOPELESS < of_any < inf:
            why = (
                f"second-order strain would take {plain(of_any)} times the energy of linear strain"
            )
            linear, warnings = _refused(linear, warnings, neither_theory(linear, why))
        else:
            for most in _counts(linear, energy):
                with _collected_warnings() as stretched_warnings:
                    stretched = _stretched(structure, model, run, most)
                if stretched is None or stretched.assembly.stretch_settled:
                    break
            if stretched is not None and (text := _run_away(linear, stretched)):
                linear, warnings = _refused(linear, warnings, text)
            elif stretched is not None and stretched.assembly.stretched:
                linear = stretched
                warnings = stretched_warnings
    for sentence in warnings:
        warn(sentence)
    return linear


def _left_out(linear: H, warnings: list[str], energy: float) -> tuple[H, list[str]]:
    """(run, its warnings) without second-order strain, whose `energy` is so little that none says
    that it deflects beyond linear theory.
    """
    sentence = large_deflection_message(linear)
    message = linear.message.replace(f" {sentence}", "") if sentence else linear.message
    linear.assembly.stretch_left_out = energy
    return replace(linear, message=message), [told for told in warnings if told != sentence]


def _refused(linear: H, warnings: list[str], text: str) -> tuple[H, list[str]]:
    """(run, its warnings), whose numbers do not hold: `text` says so in place of its deflection."""
    linear, told = _left_out(linear, warnings, 0.0)
    linear.assembly.hopeless = text
    told.append(Message(text, AccuracyWarning))
    return replace(linear, message=f"{linear.message} {text}"), told


def _run_away(linear: History, run: History) -> str:
    """Sentence on a run whose second-order forces do not settle as more motions take part, so that
    its force is not known; "" if it is.
    """
    if run.status == STOPPED:
        return neither_theory(linear, "second-order forces have no bounded energy")
    if run.assembly.stretch_settled or not run.assembly.stretched:
        return ""
    share = shares_of(run)["peak_force"]
    if share <= MOST_SHARE:
        return ""
    why = f"second-order forces leave an error of {percent(share)} of the force"
    return neither_theory(linear, why)


def _counts(linear: History, energy: float) -> list[int]:
    """Numbers of motions to try until the forces settle; one number of a solid, which has an
    `energy`: more motions do not settle its forces.
    """
    if energy < inf:
        return [FEW if energy <= SLIGHT else MOST]
    return [FEW, MOST] if stretch_estimate(linear) <= SLIGHT else [MOST]


def stretching(structure: Structure, model: AntiOscillators) -> AntiOscillators:
    """The model with second-order forces, for many impacts, if it is that of a supported sheet."""
    if model.stretch is not None or info_of(model).thickness is None:
        return model
    try:
        return _with_stretch(structure, model, MOST)
    except InputError:  # of a part that has none
        return model


def energy_of_solid(structure: Structure, linear: History) -> float:
    """Energy of second-order strain over the linear one in a solid, the larger one of the instants
    of the largest force and of the largest deflection of a linear run; inf for other parts.
    """
    return _energy(structure, linear) if _is_solid(structure) else inf


def _energy(structure: Structure, linear: History) -> float:
    """Energy of second-order strain over the linear one as above; inf where it is not known."""
    body = linear.model.free_modes
    if body.shape is None or not linear.contacts:
        return inf
    contact = max(linear.contact_histories, key=lambda contact: contact.peak_force)
    times = np.append(
        np.linspace(0.0, contact.contacts[-1][1], SAMPLES),
        contact.time[int(np.argmax(contact.force))],
    )
    amplitudes = linear.states(times)[0][:, linear.assembly.spans["structure"]]
    deflected = int(np.argmax(np.abs(amplitudes[:-1] @ body.B).max(axis=1)))
    motions = body.field((body.shape @ amplitudes[[deflected, -1]].T).T)
    try:
        return float(second_order_energies(structure, motions.T).max())
    except InputError:  # a part without such forces
        return inf


def _is_solid(structure: Structure) -> bool:
    """Whether all parts of a structure are meshed solids."""
    try:
        members = with_parts(structure).members()
    except InputError:  # matrices without mesh
        return False
    return all(member.part.kind.name == "solid" for member in members)


def _with_stretch(structure: Structure, model: AntiOscillators, most: int) -> AntiOscillators:
    """The model with second-order forces of `most` modes or more, computed once for a model."""
    known = _WITH_STRETCH.setdefault(model, {})
    enough = min((count for count in known if count >= most), default=most)
    if enough not in known:
        known[enough] = with_stretch(structure, model, "auto", enough)
    return known[enough]


def _stretched(structure: Structure, model: AntiOscillators, run: Run[H], most: int) -> H | None:
    """The impact with second-order forces; None if the part or the run has none."""
    try:
        return run(_with_stretch(structure, model, most))
    except InputError:  # the linear run tells of its deflection
        return None


@contextmanager
def _collected_warnings() -> Iterator[list[str]]:
    """Context that collects warnings; after an error they are issued, since they may explain it."""
    warnings: list[str] = []
    try:
        with warnings_to(warnings.append):
            yield warnings
    except AntioscError:
        for sentence in warnings:
            warn(sentence)
        raise
