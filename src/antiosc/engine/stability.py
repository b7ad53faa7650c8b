"""Windows of instability of a step that is given, and the march with such a step.

The forces of the march are parabolas over a step, with the law met at h/2 and h. For contacts of
constant stiffness k, undamped modes and a step h repeated, all motion is proportional to z^n. The
method is symmetric in time, so that with every pole z there is 1/z, and the motion stays bounded as
long as u = 1 - (z + 1/z)/2 is real and within [0, 2] for every pole. With f the forces at the
nodes, g those at the middles averaged over the neighbours, and q the modal displacements,

    (u - a) q = beta^T [(w1 (1 - u) + w0/2) f + wm g],     a = 1 - cos(omega h),
    (1/k + R) f = beta q,
    (1/k + R + beta s0 beta^T) g = (1 - u/2) (beta q/cos(omega h/2) - 2 beta s1 beta^T f),

which is linear in u: an eigenvalue problem with one eigenvalue for each mode. The weights follow
from the responses J0, J1, J2 of a mode to a parabola of force after h and h/2.

One free mass is stable up to k h^2/m = 9.6. A window opens as soon as the contact is stiff enough,
and may close again for a stiffer one; a stiffening contact passes all stiffnesses up to its
largest. Damping is neglected; it reduces the growth.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import chain

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.engine import library
from antiosc.engine.march import Run, run, stopped
from antiosc.engine.system import System

STIFFNESS_SAFETY = 1.2  # on the contact stiffness, which is an estimate
GROWS = 1e-3  # a step: what grows by less does not count
#: Least stiffness that is tried, over the largest, …
SOFTEST = 1e-3
#: … and number of stiffnesses between them: neighbours differ by 16 %.
SHARES = 48
_CUTS = 0.93 ** np.arange(1, 34)  # of a step, until it is stable


def growth_rate(omega: Array, beta: Array, R: Array, stiffness: Array, h: float) -> float:
    """Growth of the motion in a step: the largest |z| - 1, 0 if the step is stable.

    Parameters
    ----------
    omega : (J,) circular frequencies [rad/s].
    beta : (p, J) contribution of each mode to each indentation [kg^-1/2].
    R : (p, p) residual compliance [m/N].
    stiffness : (p,) stiffnesses of the contacts [N/m]; 0 for open ones.
    h : step [s].
    """
    closed = stiffness > 0
    b = beta[closed]
    k = stiffness[closed]
    if not k.size:
        return 0.0
    y = omega * h
    half = np.cos(0.5 * y)
    half = np.where(np.abs(half) < 1e-7, 1e-7, half)  # a node of the mode at the middle
    J0, J1, J2 = library.responses(omega, 0.0, h)[3:]
    w0, wm, w1 = _weights(J0, J1 / h, J2 / h**2)
    J0, J1, J2 = library.responses(omega, 0.0, 0.5 * h)[3:]
    s0, sm, _ = _weights(J0, J1 / h, J2 / h**2)
    s1 = s0 - w0 / (2 * half)
    s0 = sm - wm / (2 * half)
    soft = np.diag(1 / k) + R[np.ix_(closed, closed)]
    f = np.linalg.solve(soft, b)
    middle_rows = b / half - 2 * (b * s1) @ b.T @ f
    g = np.linalg.solve(soft + (b * s0) @ b.T, middle_rows)
    # u N q = M q
    nodes = (b * w1).T @ f
    middles = (b * wm).T @ g
    N = np.eye(omega.size) + nodes + 0.5 * middles
    M = np.diag(2 * np.sin(0.5 * y) ** 2) + nodes + (b * w0).T @ f + middles
    u = np.linalg.eigvals(np.linalg.solve(N, M))
    c = 1 - u
    root = np.sqrt(c.astype(complex) ** 2 - 1)
    return float(np.maximum(np.abs(c + root), np.abs(c - root)).max()) - 1


def _weights(J0: Array, J1: Array, J2: Array) -> tuple[Array, Array, Array]:
    """Weights of the responses to the force at 0, h/2 and h, through which it is a parabola."""
    return J0 - 3 * J1 + 4 * J2, 4 * J1 - 8 * J2, 4 * J2 - J1


def margin(omega: Array, beta: Array, R: Array, stiffness: Array, h: float) -> float:
    """Factor by which the contacts may stiffen before the step becomes unstable.

    Each contact is closed alone, and all together; their stiffnesses grow in proportion, up to 1.2
    times the given ones. inf if the step is stable at all of them.

    Parameters
    ----------
    omega, beta, R, stiffness, h : as for `growth_rate`, with the largest stiffnesses.
    """
    shares = np.geomspace(SOFTEST, STIFFNESS_SAFETY, SHARES)
    contacts = np.arange(stiffness.size)
    single_contacts = (np.where(contacts == c, stiffness, 0.0) for c in contacts)
    all_closed = (stiffness,) if stiffness.size > 1 else ()
    onset = np.inf
    for closed in chain(single_contacts, all_closed):
        for i, share in enumerate(shares):
            if share >= onset:
                break
            if growth_rate(omega, beta, R, share * closed, h) > GROWS:
                low = shares[i - 1] if i else 0.0
                onset = min(onset, _onset(omega, beta, R, closed, h, low, share))
                break
    return onset


def _onset(
    omega: Array, beta: Array, R: Array, stiffness: Array, h: float, low: float, high: float
) -> float:
    """Share of the stiffness, between `low` and `high`, at which a window of instability begins."""
    for _ in range(20):
        middle = 0.5 * (low + high)
        if middle > 0 and growth_rate(omega, beta, R, middle * stiffness, h) > GROWS:
            high = middle
        else:
            low = middle
    return high


def clear_step(
    omega: Array, beta: Array, R: Array, stiffness: Array, h: float, least: float = 0.0
) -> float:
    """The largest step [s] at or below `h` outside the windows; `h` if none is found >= `least`."""
    for step in (h, *(h * _CUTS)):
        if step < least:
            break
        if margin(omega, beta, R, stiffness, step) == np.inf:
            return float(step)
    return h


#: the share of such a run: what the step does not resolve is integrated with halvings of it
LOOSE = 0.05


def checked_step(step: float, duration: float) -> float:
    """A step [s] of at most the duration, or InputError."""
    step = checks.positive("step", step, "s")
    if step > duration:
        raise InputError(f"step must be <= the duration {duration:g} s; got {step:g} s.")
    return step


def stepped(
    system: System,
    stiffness: Callable[[], Array],
    duration: float,
    step: float,
    max_contacts: int,
    max_steps: int,
) -> tuple[Run, str]:
    """A run with steps of `step` [s] during contact, and why it failed; "" if it did not.

    `stiffness` gives the largest stiffnesses (p,) [N/m] that are expected of the contacts. The run
    counts as one that gained energy if the step lies in a window of instability and the march had
    to halve it, even if the halvings kept the motion bounded.
    """
    marched = run(
        system,
        duration,
        LOOSE,
        step=step,
        fine=step / 4,
        max_contacts=max_contacts,
        max_steps=max_steps,
    )
    t = float(marched.time[-1])
    failure = stopped(marched.answer, t, max_contacts, max_steps)
    grew = marched.answer == library.GREW
    if grew or (marched.refused and not failure):
        unstable = _unstable(system, stiffness(), step, t, grew)
        if unstable:
            marched.answer = library.GREW
            failure = unstable
    return marched, failure


def _unstable(system: System, stiffness: Array, step: float, t: float, grew: bool) -> str:
    """Message if the energy grew or the step lies in a window of instability; else ""."""
    p = len(system.laws)
    modes = system.omega, system.beta[:p], system.R[:p, :p]
    if not grew and margin(*modes, stiffness, step) == np.inf:
        return ""  # the halvings resolve it
    clear = clear_step(*modes, stiffness, step)
    remedy = f"a step of {clear:.6g} s" if clear < step else "a smaller step"
    excites = "contact excites" if p == 1 else "contacts excite"
    return (
        f"exact gained energy by {t:g} s: at a step of {step:g} s the {excites} the modes"
        f" (unstable step); use {remedy} or no step, so that it is chosen automatically"
    )
