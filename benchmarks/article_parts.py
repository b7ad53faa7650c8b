"""The article's two cases on the same beam meshed as a part: plane stress, and a 3-D solid.

The section is the square of 2 cm^2 that the article names; its I = S^2/12 = 0.3333 cm^4 is used
for the beam here too. The force acts on a patch of the lower (case 1) or upper face (case 2). In
3-D the patch's own half-space compliance is taken out of the Hertz law; a plane part has no such
value, so that there part of the indentation is counted twice.
"""

from __future__ import annotations

import tempfile
import time
import warnings
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from article_beam import AREA, HERTZ, LENGTH, MASS, NU, RHO, E, analytic, corrected, lasted

import antiosc as ao
from antiosc.models.closed_form import pinned_free, pinned_pinned

HEIGHT = AREA**0.5
TIP = 0.99  # of the length: a patch needs a surface around it
RADIUS = 4e-3

EXTRUSION = """
ny = {across};
Point(1) = {{0, {low}, {side}}}; Point(2) = {{0, {high}, {side}}}; Line(1) = {{1, 2}};
Transfinite Curve {{1}} = ny + 1;
{section}
a[] = Extrude {{{first}, 0, 0}} {{ {what}{{{start}}}; Layers{{{n_first}}}; Recombine; }};
b[] = Extrude {{{fine}, 0, 0}} {{ {what}{{a[0]}}; Layers{{{n_fine}}}; Recombine; }};
{rest}
Physical {body}("part") = {{{bodies}}};
Physical {what}("left") = {{{start}}}; Physical {what}("right") = {{{end}[0]}};
"""


class Row(NamedTuple):
    """One model of one case."""

    dofs: int
    half_period: float  # of the first anti-oscillator, s
    k0: float  # N/m
    m_st: float  # kg, or m_CR
    share_five: float  # of the first five that carry a thousandth
    peak_force: float  # N
    other_peak: float  # of the other integrator, relative difference
    duration: float  # first touch to last release, s
    seconds: float  # of the processor, mesh to force


def main(
    across: int = 4,
    per_fine: int = 8,
    coarse: float = 8e-3,
    n1: int = 50,
    n2: int = 20,
    reference_modes: int = 150,
    solid: bool = True,
    check: bool = True,
    step: float = 2e-8,
) -> dict[str, dict[str, Row]]:
    """Both cases on the beam and on the two parts.

    Parameters
    ----------
    across : elements across the section's height
    per_fine : elements along the 20 mm around the site
    coarse : largest length of the other elements, m
    n1, n2 : anti-oscillators in case 1 and 2
    reference_modes : of the beam that is struck
    solid : take the 3-D part too
    check : repeat each run with another integrator
    step : of the time integration in case 1, s
    """
    result: dict[str, dict[str, Row]] = {"case 1": {}, "case 2": {}}
    beam = analytic(inertia=AREA**2 / 12)
    dimensions = (2, 3) if solid else (2,)
    for case, x, n, pinned in (("case 1", TIP, n1, ()), ("case 2", 0.5, n2, ("right",))):
        exact = (pinned_free if case == "case 1" else pinned_pinned)(beam, x * LENGTH)
        started = time.process_time()
        model = exact.anti_oscillators(n)
        force = corrected(exact, reference_modes)  # a closed form may well afford its own limit
        result[case]["beam"] = _row(case, model, 0, started, check, step, force)
        for dim in dimensions:
            started = time.process_time()
            part = _part(dim, x, pinned, across, per_fine, coarse)
            model = ao.extract(part, _site(dim, x, case), n=n)
            name = "plane stress" if dim == 2 else "solid"
            result[case][name] = _row(case, model, part.dofs, started, check, step)
    return result


def _row(
    case: str,
    model: ao.AntiOscillators,
    dofs: int,
    started: float,
    check: bool,
    step: float,
    body: ao.LinearBody | None = None,
) -> Row:
    """The model's numbers, and the force on it, or on `body`."""
    body = body or model
    if case == "case 1":
        impactor: Any = ao.Obstacle()
        options: dict[str, Any] = {
            "duration": 16e-3,
            "initial_velocity": 3.0,
            "step": step,
        }
    else:
        impactor, options = ao.RigidMass(MASS / 2, 0.01), {"duration": 4e-3}
    hit = ao.simulate(body, impactor, ao.Hertz(HERTZ), **options)
    spent = time.process_time() - started
    options = {k: v for k, v in options.items() if k != "step"} | {"tol": 1e-4}
    again = hit
    if check:
        again = ao.simulate(body, impactor, ao.Hertz(HERTZ), method="DOP853", **options)
    return Row(
        dofs,
        float(np.pi / model.omega[0]),
        model.k0,
        model.m_st,
        float(model.m[model.m > 1e-3 * model.m_st][:5].sum() / model.m_st),
        hit.peak_force,
        again.peak_force / hit.peak_force - 1,
        lasted(hit),
        spent,
    )


def _site(dim: int, x: float, case: str) -> ao.Site:
    side = -1.0 if case == "case 1" else 1.0
    point, push = (x * LENGTH, side * HEIGHT / 2, 0.0), (0.0, -side, 0.0)
    return ao.Site(point=point[:dim], direction=push[:dim], radius=RADIUS)


def _part(
    dim: int, x: float, pinned: tuple[str, ...], across: int, per_fine: int, coarse: float
) -> ao.Structure:
    """The beam as a part with fine elements around x; its pinned ends keep their height."""
    fine = 20e-3
    first = x * LENGTH - fine / 2
    rest = LENGTH - first - fine
    section, what, start, body = "", "Curve", "1", "Surface"
    if dim == 3:
        section = f"s[] = Extrude {{0, 0, {HEIGHT}}} {{ Curve{{1}}; Layers{{ny}}; Recombine; }};"
        what, start, body = "Surface", "s[1]", "Volume"
    third, end, bodies = "", "b", "a[1], b[1]"
    if rest > 1e-9:
        layers = int(np.ceil(rest / coarse))
        third = (
            f"c[] = Extrude {{{rest}, 0, 0}} {{ {what}{{b[0]}}; Layers{{{layers}}}; Recombine; }};"
        )
        end, bodies = "c", "a[1], b[1], c[1]"
    text = EXTRUSION.format(
        across=across,
        low=-HEIGHT / 2,
        high=HEIGHT / 2,
        side=-HEIGHT / 2 if dim == 3 else 0.0,
        section=section,
        first=first,
        fine=fine,
        n_first=int(np.ceil(first / coarse)),
        n_fine=per_fine,
        what=what,
        start=start,
        rest=third,
        body=body,
        bodies=bodies,
        end=end,
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "part.geo"
        path.write_text(text)
        mesh = ao.read_mesh(path, size=coarse, order=1)
    plane = {"plane": "stress", "thickness": HEIGHT} if dim == 2 else {}
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "the supports leave")  # it may turn or slide
        return ao.Structure(
            mesh,
            ao.Solid(E, NU, RHO, **plane),
            supports=[ao.Support(end, "y") for end in ("left", *pinned)],
        )
