"""Whether the anti-oscillators of an extracted model suffice for a contact, without a further run.

What the anti-oscillators of the Krylov method leave out of Z lies between two extremes. With
λ_i = 1/ω_i² and λ_0 = 0 of the residual mass they are the Gauss–Radau rule of the measure of all
masses over λ; the Gauss rule with the same moments, without a mass at λ = 0, is the other extreme
(Golub and Meurant, *Matrices, Moments and Quadrature*, 2010, ch. 6). With σ = 1/s² its Z lacks

    D(s) = 1/Σ_i [(λ_i + σ)/m_i Π_(j≠i) ((λ_j + σ)/(λ_i - λ_j))²].

At a complex s the force of a blow is v/(s C), C the compliance of both bodies and of the contact in
series. The difference of the two forces over the force, on a ray of s whose |s| are those of the
contact, tells whether the truth is known. On thin and thick plates and a bracket with 3 to 120
anti-oscillators, peak forces were wrong by less than the share where it was above `ENOUGH`, and by
less than 8 % below.
"""

from __future__ import annotations

from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from antiosc.base._types import Array, ComplexArray
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.simulation.problem.assembly import Assembly
from antiosc.simulation.problem.expected import stiffness_at

#: Points s of the ray over π/T, T the expected contact time.
RAY = np.geomspace(0.5, 30.0, 8) * np.exp(1j * np.radians(75))
#: Share of the force from which a warning is given.
ENOUGH = 0.3


def left_out(model: AntiOscillators, assembly: Assembly, contact: int = 0, begin: int = 0) -> float:
    """Share of the force of an impact on a model in which both extremes differ, 0 … about 1.

    `begin` : the first mode of the model among those of all bodies.
    0 for models whose anti-oscillators have all converged, such as those of method="modes": what
    they leave out is not bounded as closely.
    """
    info = model.info
    if info.method != "krylov" or info.converged is None or info.converged >= model.n:
        return 0.0
    if model.m0 == 0:
        return 0.0
    system, law, modes = assembly.system, assembly.laws[contact], model.modal()
    s = np.pi / assembly.lasting * RAY
    depth, speed = float(system.depth[contact]), float(system.speed[contact])
    stiffness = stiffness_at(law, depth, law.touch(speed))
    if not stiffness > 0:
        return 0.0
    squares = system.beta[contact] ** 2 / (s[:, None] ** 2 + system.omega**2)
    site = squares[:, begin : begin + modes.omega.size].sum(axis=1) + modes.r
    C = squares.sum(axis=1) + system.R[contact, contact] + 1 / stiffness
    D = _lacking(model, s)
    more = D * site**2 / (1 - D * site)
    weight = 1 / abs(s)
    off, force = abs(more / (C * (C + more))) ** 2, abs(C) ** -2.0
    return float(np.sqrt((off @ weight) / (force @ weight)))


def _lacking(model: AntiOscillators, s: ComplexArray) -> ComplexArray:
    """What Z of the softer extreme has less, at complex s."""
    known = _rules.get(model)
    if known is None:
        known = _rules[model] = _rule(model)
    lam, own = known
    logs = np.log(lam + s[:, None] ** -2.0)
    terms = 2 * logs.sum(axis=1, keepdims=True) - logs - own
    largest = terms.real.max(axis=1, keepdims=True)
    return np.asarray(np.exp(-largest[:, 0]) / np.exp(terms - largest).sum(axis=1))


def _rule(model: AntiOscillators) -> tuple[Array, Array]:
    """The nodes λ_i of the Gauss–Radau rule, and the logarithms of m_i Π_(j≠i) (λ_i - λ_j)²."""
    lam, masses = np.append(0.0, model.omega**-2.0), np.append(model.m0, model.m)
    apart = abs(lam[:, None] - lam)
    apart.flat[:: lam.size + 1] = 1.0
    return lam, 2 * np.log(np.maximum(apart, np.finfo(float).tiny)).sum(axis=1) + np.log(masses)


_rules: WeakKeyDictionary[AntiOscillators, tuple[Array, Array]] = WeakKeyDictionary()


def too_few(model: Any, assembly: Assembly, contact: int = 0, begin: int = 0) -> str:
    """That the anti-oscillators are too few for a contact that touched; "" where they suffice.

    `begin` : the first mode of the model among those of all bodies.
    Of models that `extract` made by the Krylov method; other truncations are their maker's choice.
    """
    if not isinstance(model, AntiOscillators) or model.sites:
        return ""
    share = left_out(model, assembly, contact, begin)
    if share <= ENOUGH:
        return ""
    return (
        f"The model's {model.n} anti-oscillators are too few for this contact: what they leave out"
        f" may change the force by {share:.0%} (above {ENOUGH:.0%} neither peak force nor contact"
        " time is known);"
        " extract(…, band=ao.impact_band(impactor, contact)) takes as many as the contact needs."
    )
