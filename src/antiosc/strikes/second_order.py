"""Impacts with second-order forces if the linear run shows that they may matter."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import inf
from typing import TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from antiosc.base.errors import AccuracyWarning, InputError, Message, warn, warnings_to
from antiosc.base.texts import STOPPED
from antiosc.fem.structure.structure import Structure, with_parts
from antiosc.impact.histories import History
from antiosc.impact.histories.linear_theory import (
    EXPLICIT_REMEDY,
    deflection_text,
    large_deflection_message,
    largest_deflection,
    may_stretch,
    sheets_of_run,
)
from antiosc.impact.stretching import stretch_shares_of
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.body import info_of
from antiosc.reduce.extraction.stretching import second_order_energies, with_stretch

H = TypeVar("H", bound=History)
#: Simulates the impact on a model.
RunOnModel = Callable[[AntiOscillators], H]
#: The models with second-order forces by the models without them, as long as these are in use: the
#: forces are the same for every striker, and take longer than the impact.
_STRETCHED_MODELS: WeakKeyDictionary[AntiOscillators, AntiOscillators] = WeakKeyDictionary()
#: Energy of second-order strain over the linear one up to which a solid is taken as linear: runs
#: with more and more motions of solids scatter by more than what these change.
SLIGHT_ENERGY_RATIO = 0.05
#: The same from which no run with it is tried: a clamped disc whose linear run has it at 9.5
#: thicknesses would deflect by 4.2.
HOPELESS_ENERGY_RATIO = 20.0
#: Error of the force by second-order forces, over the force, above which they ran away: a clip of
#: 0.2 mm had 5.49 N with 18 motions, 0.19 N with 12 and 0.15 N with 2.
MAX_STRETCH_ERROR = 1.0
#: Times until the last parting at which the deflection is compared.
DEFLECTION_SAMPLES = 400


def simulated(structure: Structure, model: AntiOscillators, run: RunOnModel[H]) -> H:
    """The impact `run(model)`, with second-order forces if they matter."""
    linear, told = _run_with_warnings(run, model)
    hit = linear
    if model.stretch is None and may_stretch(linear):
        hit, told = _run_of_either_order(structure, model, run, linear, told)

    for sentence in told:
        warn(sentence)
    return hit


def _run_with_warnings(run: RunOnModel[H], model: AntiOscillators) -> tuple[H, list[str]]:
    """The impact on a model, and the texts of its warnings."""
    told: list[str] = []
    with warnings_to(told.append):
        return run(model), told


def _run_of_either_order(
    structure: Structure, model: AntiOscillators, run: RunOnModel[H], linear: H, told: list[str]
) -> tuple[H, list[str]]:
    """The linear run, or one with second-order forces if they matter, and its warnings."""
    energy = second_order_energy_ratio(structure, linear)
    if energy <= SLIGHT_ENERGY_RATIO and _is_solid(structure):
        linear.assembly.omitted_stretch_ratio = energy
        return linear, told

    if not HOPELESS_ENERGY_RATIO < energy < inf:
        try:
            stretched, told_stretched = _run_with_warnings(run, stretching(structure, model))
        except InputError:  # of a given step or another method: the linear run tells
            return linear, told
        if not stretched.assembly.stretch_forces:
            return linear, told
        settled = stretched.assembly.stretch_converged
        settles = settled or stretch_shares_of(stretched)["peak_force"] <= MAX_STRETCH_ERROR
        if settles and stretched.status != STOPPED:
            return stretched, told_stretched

    moved = [(name, largest_deflection(linear, name), h) for name, h in sheets_of_run(linear)]
    far = deflection_text(*max(moved, key=lambda sheet: sheet[1] / sheet[2]))
    text = (
        f"{far} in the linear run, where second-order strain takes more than"
        f" {HOPELESS_ENERGY_RATIO:g} times the energy of linear strain or its forces do not settle:"
        " neither theory holds, and no number"
        f" here does. The part is stiffer than that; {EXPLICIT_REMEDY}."
    )
    linear.assembly.theory_warning = text

    advice = large_deflection_message(linear)  # to take second-order strain
    message = f"{linear.message.replace(advice, '')} {text}"
    others = [one for one in told if one != advice]
    return replace(linear, message=message), [*others, Message(text, AccuracyWarning)]


def stretching(structure: Structure, model: AntiOscillators) -> AntiOscillators:
    """The model with second-order forces, computed once; the model itself if it has none."""
    if model.stretch is not None or info_of(model).thickness is None:
        return model
    if model not in _STRETCHED_MODELS:
        try:
            _STRETCHED_MODELS[model] = with_stretch(structure, structure.factorize(), model, "auto")
        except InputError:  # of a part that has none
            return model
    return _STRETCHED_MODELS[model]


def second_order_energy_ratio(structure: Structure, linear: History) -> float:
    """Largest ratio of second-order to linear strain energy in a linear run; inf if unknown."""
    body = linear.model.free_modes
    if body.shape is None or not linear.contacts:
        return inf
    contact = max(linear.contact_histories, key=lambda contact: contact.peak_force)
    at_peak = contact.time[int(np.argmax(contact.force))]
    times = np.append(np.linspace(0.0, contact.contacts[-1][1], DEFLECTION_SAMPLES), at_peak)

    amplitudes = linear.states(times)[0][:, linear.assembly.stacked.spans["structure"]]
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
