"""A tube that is shaken between four pairs of stops (code_aster SDNL301)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from case import Case, Row, drawing
from hermite import hermite_beam
from scipy.sparse import csc_array

import antiosc as ao

ELEMENTS, MODES = 48, 30
STOPS = {"N14": 12, "N26": 24, "N38": 36, "N2": 48}  # name -> node, 0 the clamped end
#: stiffness of the stops, N/m -> published root mean square of the force at the end, N
PUBLISHED = {1.75e6: 23.4, 1e5: 23.9833}
PUSHED = ((1, 12, 1), (13, 24, -1), (25, 36, 1), (37, 48, -1))  # nodes from, to, sign


def tube(stiffness: float) -> ao.Scene:
    """The scene, with stops of this stiffness."""
    outer, inner, E, rho = 7.95e-3, 6.8e-3, 2.07e11, 7870.0
    area, inertia = np.pi * (outer**2 - inner**2), np.pi * (outer**4 - inner**4) / 4
    K, M = (m[2:, 2:] for m in hermite_beam(ELEMENTS, E * inertia, rho * area, 2.436))
    push = np.zeros(len(K))
    for first, beyond, sign in PUSHED:
        push[2 * np.arange(first, beyond) - 2] = sign * 4.138
    part = ao.Structure.from_matrices(csc_array(K), csc_array(M))
    sites = {name: ao.Site(dof=2 * node - 2) for name, node in STOPS.items()}
    body = ao.extract(part, {**sites, "push": ao.Site(vector=push)}, n=MODES).site_modes()
    decay = (1.79e-5 * body.omega**2 + 0.1526) / 2
    body = ao.SiteModes(body.omega, body.b, body.sites, r=body.r, decay=decay)
    contacts = [
        ao.Contact(*pair, ao.Linear(stiffness), gap=0.406e-3)
        for name in STOPS
        for pair in ((f"up {name}", f"tube:{name}"), (f"tube:{name}", f"down {name}"))
    ]
    stops = {f"{way} {name}": ao.Obstacle() for name in STOPS for way in ("up", "down")}
    t = np.linspace(0, 0.25, 2501)
    load = ao.Load("tube:push", t, np.sin(251.2 * t))
    return ao.Scene({"tube": body, **stops}, contacts, loads=[load])


def force(hit: ao.SceneHistory, name: str, t: np.ndarray) -> np.ndarray:
    """Force of both stops at a place, at times t."""
    up, down = hit[f"up {name}", f"tube:{name}"], hit[f"tube:{name}", f"down {name}"]
    return np.asarray(np.interp(t, up.time, up.force) + np.interp(t, down.time, down.force))


def shaken(picture: Path) -> list[Row]:
    """Both versions of the test, by central differences in steps of 5e-6 s as published."""
    t, rows, forces = np.linspace(0.17, 0.25, 80_001), [], {}
    for stiffness, published in PUBLISHED.items():
        hit = tube(stiffness).run(0.25, method="leapfrog", step=5e-6)
        at_end = force(hit, "N2", t)
        name = f"rms force at the end, stops of {stiffness:g} N/m, N"
        rows.append(Row(name, published, float(np.sqrt(np.mean(at_end**2))), 0.05))
        forces[f"stops of {stiffness / 1e3:g} kN/m"] = at_end
    with drawing(picture, "time (ms)", "force on the last stop (N)") as axis:
        for name, at_end in forces.items():
            axis.plot(t * 1e3, at_end, lw=1, label=name)
    return rows


CASES = [
    Case(
        "sdnl301",
        "A tube shaken between four pairs of stops",
        "2.436 m, 15.9 × 1.15 mm, E = 2.07e11 Pa, ρ = 7870 kg/m³, damping 0.1526 M + 1.79e-5 K; "
        "4.138 N sin(251.2 t) on 44 nodes, spans in turn; stops 0.406 mm away at each quarter; "
        "0.17 to 0.25 s. The dashpots of 0.28 N s/m and rotary inertia are left out",
        "code_aster SDNL301, astest/sdnl301a.comm, of 2011 (stops of 1.75e6 N/m, its bound 5 %) "
        "and of 2018 (1e5 N/m); node numbers of the mesh inferred from the places of stops. The "
        "motion is chaotic: single impacts differ, root mean squares agree",
        shaken,
    ),
]
