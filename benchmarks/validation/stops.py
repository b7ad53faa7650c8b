"""Beams that bend against stops and against each other (code_aster)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from case import Case, Row, drawing
from hermite import hermite_beam
from lines import line
from scipy.sparse import csc_array

import antiosc as ao


def cantilever(picture: Path) -> list[Row]:
    """SDNL104: a step force drives the tip of a cantilever against an elastic stop.

    The published numbers come from ten elements and Newmark's rule in steps of 1e-4 s: the case
    runs so first, then with the exact march.
    """
    newmark = pushed(ten_elements()).run(0.16, method="newmark", step=1e-4)
    exact = pushed(ten_elements()).run(0.16, tol=1e-4)
    beam = ao.Beam(E=1e10, nu=0.0, rho=1e6, section=ao.Section.circle(0.2), shear=False)
    supports = [ao.Support("near"), ao.Support("line", fix="x")]
    fine = ao.Structure(line(1.0, 40), beam, supports)
    tip = ao.Site((1.0, 0.0), (0.0, 1.0))
    converged = pushed(ao.extract(fine, {"tip": tip}, n=19)).run(0.16, tol=1e-4)
    rows = []
    for name, hit, bound in (
        ("ten elements, Newmark", newmark, 0.001),
        ("ten elements, exact in time", exact, 0.01),
        ("40 elements, exact in time", converged, 0.01),
    ):
        rows += of_the_tip(hit, name, bound)
    t = np.linspace(0.0, 0.16, 800)
    with drawing(picture, "time (ms)", "tip (µm)") as axis:
        axis.plot(t * 1e3, exact.at(t)["beam"].displacement("tip") * 1e6, label="antiosc")
        axis.plot([131.5], [-1.85334], "ko", label="published")
    return rows


def ten_elements() -> ao.AntiOscillators:
    """SDNL104: the beam in the elements of the source, with all their modes."""
    area, inertia = np.pi * 0.1**2, np.pi * 0.1**4 / 4
    K, M = (matrix[2:, 2:] for matrix in hermite_beam(10, 1e10 * inertia, 1e6 * area, 1.0))
    part = ao.Structure.from_matrices(csc_array(K), csc_array(M))
    return ao.extract(part, {"tip": ao.Site(dof=len(K) - 2)}, n=len(K) - 1)


def of_the_tip(hit: ao.SceneHistory, name: str, bound: float) -> list[Row]:
    """SDNL104: the published values beside those of a run."""
    at = hit.at([0.1315, 0.1566])["beam"]
    found = {
        "tip at 0.1315 s, m": (-1.85334e-6, at.displacement("tip")[0]),
        "speed at 0.1566 s, m/s": (-4.63284e-3, at.velocity("tip")[1]),
        "kinetic energy at 0.16 s, J": (0.0514081404196, hit.bodies["beam"].kinetic[-1]),
    }
    why = "The published digits hold the error of ten elements and of the time step."
    return [
        Row(f"{quantity} ({name})", value, float(ours), bound, why=why)
        for quantity, (value, ours) in found.items()
    ]


def pushed(model: ao.AntiOscillators) -> ao.Scene:
    """The step force at the tip, and the stop."""
    return ao.Scene(
        {"beam": model, "stop": ao.Obstacle()},
        [ao.Contact("beam:tip", "stop", ao.Linear(1e8), gap=1e-4)],
        loads=[ao.Load("beam:tip", [0.0], [-1000.0])],
    )


#: SDNL105 at 1 s by code_aster's three schemes (EULER, DEVOGE, ADAPT_ORDRE2): displacement, speed
THREE = {
    "N": ((0.0164295, 0.0164264, 0.0164269), (0.0254158, 0.0254155, 0.025411)),
    "M": ((0.0111677, 0.0111627, 0.0111633), (0.044264, 0.0441197, 0.0442591)),
    "O": ((0.00589757, 0.00588736, 0.00588712), (0.104583, 0.10455, 0.104587)),
}


def three_beams(picture: Path) -> list[Row]:
    """SDNL105: three clamped beams beside each other; the first is pushed against the others."""
    outer, inner = 0.1, 0.09
    area, inertia = np.pi * (outer**2 - inner**2), np.pi * (outer**4 - inner**4) / 4
    K, M = (matrix[2:-2, 2:-2] for matrix in hermite_beam(10, 1e10 * inertia, 1e8 * area, 1.0))
    part = ao.Structure.from_matrices(csc_array(K), csc_array(M))
    site = ao.Site(dof=8)  # the deflection of the sixth of eleven nodes
    model = ao.superposition(part, site, n=3)  # of five modes, those that move the middle
    contacts = [
        ao.Contact("M", "N", ao.Linear(1e8), gap=1e-3),
        ao.Contact("O", "M", ao.Linear(1e8), gap=1e-3),
    ]
    scene = ao.Scene({b: model for b in THREE}, contacts, loads=[ao.Load("N", [0.0], [1e6])])
    hit = scene.run(1.0, tol=1e-4)
    t, rows = np.linspace(0.0, 1.0, 600), []
    with drawing(picture, "time (s)", "middle of the beam (mm)") as axis:
        for body, (displacements, _) in THREE.items():
            axis.plot(t, hit.at(t)[body].displacement() * 1e3, label=f"beam {body}")
            axis.plot([1.0], [displacements[2] * 1e3], "ko")

    for body, (displacements, speeds) in THREE.items():
        at = hit.at([1.0])[body]
        for quantity, values, ours in (
            ("displacement, m", displacements, at.displacement()[0]),
            ("speed, m/s", speeds, at.velocity()[0]),
        ):
            spread = (max(values) - min(values)) / abs(values[2])
            rows.append(Row(f"{body}: {quantity}", values[2], float(ours), max(spread, 1e-3)))
    return rows


CASES = [
    Case(
        "sdnl104",
        "A step force drives a cantilever against a stop",
        "L = 1 m, full circle of radius 0.1 m, E = 1e10 Pa, ρ = 1e6 kg/m³; stop of 1e8 N/m, "
        "1e-4 m away; −1000 N from rest",
        "code_aster SDNL104, astest/sdnl104a.comm (the energy) and manual V5.02.104. The values "
        "are those of Newmark's rule with steps of 1e-4 s on ten elements (bound 0.1 %); beside "
        "them the exact march on these elements and on a fine mesh (bound 1 %)",
        cantilever,
    ),
    Case(
        "sdnl105",
        "Three clamped beams; one is pushed against the others",
        "L = 1 m, tube of outer radius 0.1 m, wall 0.01 m, E = 1e10 Pa, ρ = 1e8 kg/m³; 1 mm "
        "between neighbours, contacts of 1e8 N/m at mid-span; 1e6 N on the first from rest",
        "code_aster SDNL105, astest/sdnl105a.comm and .mail, whole. The values are those of three "
        "schemes of code_aster on 15 modes of all beams together; the bound is what the three "
        "differ by, at least 0.1 %",
        three_beams,
    ),
]
