"""From the best pulses of all sites to the most probable blows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from antiosc.base.progress import counting
from antiosc.studies.find.fit import Fit, Search
from antiosc.studies.find.forward import Blow, Struck
from antiosc.studies.find.scan import Scan

#: Places at which a search starts, and their least distance over the spacing of sites.
PLACES, APART = 8, 2.5
#: Masses that each is tried with, over that of the structure.
MASSES = (1e-3, 4e-3, 0.016, 0.064, 0.25, 1.0)
#: Searches that begin, that go on, and the steps of both.
BEGUN, KEPT = 4, 2
FIRST_STEPS, LAST_STEPS = 5, 25
#: Cost of a second search over that of the first, above which it does not go on.
HOPELESS = 10.0
#: chi² above which the best blow does not explain the signals, and the heavier impactors that are
#: tried then: a lighter one does not touch again, and no small step adds a contact.
POOR, HEAVIER = 2.0, (1.3, 2.0)
#: Of a rigid wall: contact time over 2 × approach/velocity, and impulse over mass × velocity.
HERTZ_TIME, REBOUND = 2.943, 1.6


def most_probable(
    model: Struck,
    scanned: Scan,
    unknown: Sequence[str],
    known: Mapping[str, float],
    weight: float,
    spread: float,
    doubt: float,
) -> list[Fit]:
    """Blows of least cost, the best first, at different places if there are several.

    Parameters
    ----------
    unknown : of mass, velocity, stiffness, E.
    known : values of those that are not.
    weight : mass of the structure [kg].
    spread, doubt : expected relative errors of the natural frequencies, and of the modes' shares.
    """
    search = Search(model, unknown, spread, doubt)
    masses = [share * weight for share in MASSES] if "mass" in unknown else [known["mass"]]
    starts = [
        _scaled(search, _blow(model, scanned, i, mass, known))
        for i in _places(model, scanned)
        for mass in masses
    ]
    starts.sort(key=lambda pair: pair[0])
    begun = []
    with counting("searching the blow", BEGUN + KEPT) as ready:
        for count, (_, blow) in enumerate(starts[:BEGUN], start=1):
            begun.append(search.refined(blow, FIRST_STEPS))
            ready(count)
        begun.sort(key=lambda fit: fit.cost)
        found = []
        for count, fit in enumerate(_kept(model, begun), start=BEGUN + 1):
            found.append(search.refined(fit.blow, LAST_STEPS))
            ready(count)
        best = min(found, key=lambda fit: fit.cost)
        if best.chi2 > POOR and {"mass", "velocity"} <= set(unknown):
            found += [search.refined(_heavier(best.blow, by), LAST_STEPS) for by in HEAVIER]
    return sorted(found, key=lambda fit: fit.cost)


def _heavier(blow: Blow, by: float) -> Blow:
    """The blow of a heavier impactor of the same momentum, which may touch once more."""
    return replace(blow, mass=by * blow.mass, velocity=blow.velocity / by)


def _kept(model: Struck, begun: list[Fit]) -> list[Fit]:
    """The best search, and the best one at another place, or the second."""
    first, *rest = begun
    far = APART * model.surface.spacing(first.blow.site)
    apart = [fit for fit in rest if np.linalg.norm(fit.blow.place - first.blow.place) > far]
    near = [fit for fit in (*apart, *rest) if fit.cost < HOPELESS * first.cost]
    return [first, *near][:KEPT]


def _places(model: Struck, scanned: Scan) -> list[int]:
    """Sites whose pulses explain most, apart from one another."""
    chosen: list[int] = []
    points = model.surface.points
    for i in np.argsort(-scanned.explained, kind="stable").tolist():
        far = APART * model.surface.spacing(i)
        if all(np.linalg.norm(points[i] - points[k]) > far for k in chosen):
            chosen.append(i)
        if len(chosen) == PLACES:
            break
    return chosen


def _blow(model: Struck, scanned: Scan, i: int, mass: float, known: Mapping[str, float]) -> Blow:
    """A blow whose pulse on a rigid wall would be that of site i."""
    T = float(scanned.duration[i])
    impulse = 2 / np.pi * T * float(scanned.amplitude[i])
    velocity = max(impulse, float(np.finfo(float).tiny)) / (REBOUND * mass)
    approach = T * velocity / HERTZ_TIME
    exponent = model.exponent
    stiffness = (exponent + 1) / 2 * mass * velocity**2 / approach ** (exponent + 1)
    J, m = len(model.omega), len(model.rows)
    guess = {"velocity": velocity, "stiffness": stiffness, "E": 1.0, **known, "mass": mass}
    return Blow(
        model.surface.points[i], i, start=float(scanned.start[i]), lasting=T,
        frequency=np.zeros(J), share=np.zeros((m, J)), **guess,
    )  # fmt: skip


def _scaled(search: Search, blow: Blow) -> tuple[float, Blow]:
    """The blow with its best amplitude, and the cost of its signals."""
    model = search.model
    seen, data = search.at(blow)[2].signals.ravel(), model.data.compared.ravel()
    power = float(seen @ seen)
    if power == 0.0:
        return float(data @ data), blow
    amplitude = max(float(seen @ data) / power, 0.1)
    # the force of a power law is in proportion to the velocity if the stiffness goes along
    change = {"velocity": amplitude, "stiffness": amplitude ** (1 - model.exponent)}
    new = {n: getattr(blow, n) * c for n, c in change.items() if n in search.logs}
    return float(np.sum((amplitude * seen - data) ** 2)), replace(blow, **new)
