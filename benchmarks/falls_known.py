"""Falls against integrations that know no episodes, and what contacts change of the energy.

A flat bar that bends falls inclined, and its peak forces are those of one integration in a floating
frame; a tumbling rigid block lands as Euler's equations say; elastic falls keep their energy.

    .venv/bin/python benchmarks/falls_known.py --help
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from options import command

import antiosc as ao
from antiosc_studies.drops.body import free_body
from antiosc_studies.drops.fall import fall_of
from antiosc_studies.drops.flight import Flight
from antiosc_studies.drops.orientation import tilted
from antiosc_studies.drops.trajectory import initial_state

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests" / "support"))
from falling import G, bar, block, floating, landed, setting, started

NUDGE = 1e-4


def main() -> dict[str, float]:
    """Print the differences; return the largest ones."""
    found = {"energy": max(map(changed, (1e-2, 1e-3, 1e-4)))}
    found["block"] = max(block_off(friction, radius) for friction, radius in ((0, 0), (0.3, 2e-3)))
    found["bar"] = max(map(bar_off, (12.0, 30.0, 40.0, 50.0)))
    return found


def bar_off(tilt: float) -> float:
    """Largest relative difference of the first three peak forces of the bar."""
    body, k = bar(), 2e8
    where = setting(ao.Hertz(k), impacts=3)
    fall = fall_of(body, started(body, where, (0.0, tilt, 0.0)), where)
    touch = Flight(body, fall.start, G).at(fall.episodes[0].start.time - 1e-5)
    known = floating(body, touch, k, fall.episodes[-1].end.time - touch.time + 1e-5)[:3]
    off = fall.impacts.column("peak_force") / known - 1
    nudged = [
        fall_of(body, started(body, where, (0.0, tilt + np.degrees(s), 0.0)), where).impacts
        for s in (-NUDGE, NUDGE)
    ]
    spread = [one.column("peak_force") / fall.impacts.column("peak_force") - 1 for one in nudged]
    print(
        f"bar at {tilt:g} degrees: peaks {np.array(known)} N, off by {off}, changed by "
        f"{np.abs(spread).max(axis=0)} by a tilt of {NUDGE:g} rad",
        flush=True,
    )
    return float(np.abs(off).max())


def block_off(friction: float, rounded: float) -> float:
    """Relative difference of the momentum that the first impact of the block leaves."""
    body, k = free_body(block(), 0, None, None), 1e6
    body.balls[:] = rounded
    where = setting(ao.Hertz(k), friction, impacts=1)
    spin = np.array([9.0, -14.0, 26.0])
    start = initial_state(body, where, tilted(np.array([30.0, 40.0, 5.0])), spin, np.zeros(3))
    one = fall_of(body, start, where).episodes[0]
    _, v, L, peak = landed(body, one, k, friction)
    force = one.forces()[1].sum(axis=1).max() / peak - 1
    momentum = np.linalg.norm(one.end.momentum - L) / np.linalg.norm(L)
    speed = np.linalg.norm(one.end.velocity - v) / np.linalg.norm(v)
    print(
        f"block, friction {friction:g}: peak force off by {force:.1e}, velocity by {speed:.1e}, "
        f"angular momentum by {momentum:.1e}",
        flush=True,
    )
    return float(max(abs(force), speed, momentum))


def changed(tol: float) -> float:
    """Largest change of the energy by a contact, over that of the drop, of falls without losses."""
    changes = []
    for law in (ao.Linear(1e5), ao.Hertz(1e6), ao.Hertz(1e9)):
        for tilt in ((0.0, 0.0, 0.0), (90.0, 0.0, 0.0), (0.0, 20.0, 0.0), (30.0, 40.0, 5.0)):
            body = free_body(block(), 0, None, None)
            where = setting(law, height=1.0, impacts=4, tol=tol)
            energy = fall_of(body, started(body, where, tilt), where).energy()[1].sum(axis=1)
            changes += (np.abs(energy[2:-1:2] - energy[1:-1:2]) / energy[0]).tolist()
    print(
        f"tol {tol:g}: {len(changes)} contacts change the energy by {np.median(changes):.1e} "
        f"(median), {max(changes):.1e} (largest)",
        flush=True,
    )
    return float(max(changes))


if __name__ == "__main__":
    command(main)
