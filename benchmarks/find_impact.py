"""How near to the truth blows are that `find_impact` finds.

A plate and a curved shell on spring supports, four accelerometers. The signals come from
another mesh with other supports, another E and noise. Printed: quantiles of the errors, how many
lie within their bars, and the seconds.

    .venv/bin/python benchmarks/find_impact.py --help
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
import warnings
from pathlib import Path
from typing import Any

import meshio
import numpy as np

import antiosc as ao
from antiosc.base._types import Array
from antiosc.strikes.free_sites import BAND_FACTOR
from antiosc_studies.find import MonitoredStructure, impact_of_recording, monitored_structure
from antiosc_studies.find.recording import recording_of

E, NU, RHO, THICKNESS = 210e9, 0.3, 7850.0, 4e-3
SIDES = np.array([0.4, 0.3])
#: Stiffness of the springs along the edge, N/m at each of `EDGE`.
SPRING = 2e6
EDGE = np.array([(0, 0), (0.5, 0), (1, 0), (1, 0.5), (1, 1), (0.5, 1), (0, 1), (0, 0.5)])
RATE, SAMPLES = 50e3, 500
#: Sensors over the sides.
SENSORS = np.array([[0.18, 0.2], [0.82, 0.27], [0.72, 0.83], [0.27, 0.73]])
KINDS = {"plate": 0.0, "shell": 0.5}
AIMS = {"place": 0.02, "peak_force": 0.05, "impulse": 0.03}

PAGE = """# Blows found from signals

Written by `benchmarks/find_impact.py`. {count} blows; four accelerometers at {rate:g} kHz,
{samples} samples; the signals come from another mesh, E off by 1 %, supports off by 5 %. "place" is
the error over the longer side, "aim" the share within 2 % (place), 5 % (peak force) and 3 %
(impulse), "held" the share of errors within their bars of 95 %.

{table}
{many}"""

MANY = """
Of {sites} candidate sites, with four sensors: {search:.1f} s of CPU to find a blow, the least of
two, after {map:.0f} s for the modes at all sites, once a part.
"""


def at(xi: Array, curvature: float) -> Array:
    """Points (n, 3) of relative coordinates (n, 2): a plate, or a part of a cylinder."""
    x, y = (np.asarray(xi) * SIDES).T
    if not curvature:
        return np.column_stack([x, y, 0 * x])
    R = curvature
    return np.column_stack([R * np.sin(x / R), y, R * (np.cos(x / R) - 1)])


def sensors_on(kind: str) -> list[ao.Sensor]:
    """The accelerometers normal to the structure of this kind."""
    return [ao.Sensor(tuple(point), (0, 0, 1)) for point in at(SENSORS, KINDS[kind])]


def part(kind: str, cells: tuple[int, int], stiffness: float, springs: float) -> ao.Structure:
    """The structure on a mesh of so many cells along its sides."""
    n, m = cells
    grid = np.stack(np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, m + 1)), axis=-1)
    a = (np.arange(n) + (n + 1) * np.arange(m)[:, None]).ravel()
    b, c, d = a + 1, a + n + 1, a + n + 2
    halves = [[a, b, d], [a, d, c]] if n % 2 else [[a, b, c], [b, d, c]]
    triangles = np.concatenate([np.transpose(half) for half in halves])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "part.vtu"
        meshio.Mesh(at(grid.reshape(-1, 2), KINDS[kind]), [("triangle", triangles)]).write(path)
        mesh = ao.read_mesh(path)
    held = [
        ao.Spring(tuple(point), dict.fromkeys("xyz", springs * SPRING))
        for point in at(EDGE, KINDS[kind])
    ]
    shell = ao.Shell(E * stiffness, NU, RHO, THICKNESS)
    return ao.Structure(mesh, shell, attached=held)


def blow(kind: str, truth: ao.Structure, seed: int) -> dict[str, Any]:
    """A random blow on the structure, and its signals without noise."""
    random = np.random.default_rng(seed)
    curvature = KINDS[kind]
    place = at(random.uniform(0.1, 0.9, (1, 2)), curvature)[0]
    impactor = ao.RigidMass(10 ** random.uniform(-2, 0), random.uniform(0.5, 4))
    law, start = ao.Hertz(10 ** random.uniform(7.5, 9)), random.uniform(0, 1e-3)
    model = ao.extract(truth, ao.Site(place, (0, 0, -1), snap=True), n=80)
    hit = ao.simulate(model, impactor, law, SAMPLES / RATE, tol=1e-4)
    t = np.arange(SAMPLES) / RATE - start
    on = t >= 0
    signals = np.zeros((SAMPLES, len(SENSORS)))
    for s, point in enumerate(at(SENSORS, curvature)):
        signals[on, s] = ao.probe(truth, hit, point, "acceleration", t[on])[:, 2]
    return {"place": place, "hit": hit, "signals": signals}


def case(
    kind: str, model: MonitoredStructure, true: dict[str, Any], noise: float, seed: int
) -> dict[str, Any]:
    """The errors of one found blow, and its bars."""
    signals, random = true["signals"], np.random.default_rng([seed, round(1000 * noise)])
    size = noise * np.sqrt(np.mean(signals**2, axis=0))
    signals = signals + size * random.standard_normal(signals.shape)
    started = time.process_time()
    most = float(model.free_sites.omega[-1]) / BAND_FACTOR
    data = recording_of(signals, sensors_on(kind), RATE, None, None, most)
    names = ("place", "mass", "velocity", "stiffness")
    found = impact_of_recording(model, data, names, None, None, None, (0.01, 0.03))
    seconds, hit = time.process_time() - started, true["hit"]
    return {
        "kind": kind, "noise": noise, "seed": seed, "seconds": seconds,
        "place": float(np.linalg.norm(found.place - true["place"])) / SIDES[0],
        "peak_force": found.peak_force / hit.peak_force - 1,
        "impulse": found.impulse / hit.impulse - 1,
        "bars": {
            "place": found.bars["place"] / SIDES[0],
            **{name: found.bars[name] for name in ("peak_force", "impulse")},
        },
        "status": found.status, "rank": found.rank, "chi2": found.chi2,
    }  # fmt: skip


def many(cells: tuple[int, int]) -> str:
    """The CPU seconds of a search among the sites of so many cells."""
    started = time.process_time()
    structure = part("plate", cells, 1.0, 1.0)
    model = monitored_structure(structure, sensors_on("plate"), None, (0, 0, -1), None, None, None)
    mapped, truth = time.process_time() - started, part("plate", (31, 23), 1.01, 1.05)
    found = [case("plate", model, blow("plate", truth, seed), 0.04, seed) for seed in range(2)]
    return MANY.format(
        sites=len(model.free_sites.map_sites.sites.points),
        search=min(c["seconds"] for c in found),
        map=mapped,
    )


def row(name: str, cases: list[dict[str, Any]]) -> str:
    """A line of the table."""
    cells = [name, str(len(cases))]
    for quantity, aim in AIMS.items():
        errors = np.abs([c[quantity] for c in cases])
        bars = np.array([c["bars"][quantity] for c in cases])
        cells += [
            f"{np.median(errors):.2%}", f"{np.quantile(errors, 0.95):.2%}",
            f"{np.mean(errors <= aim):.0%}", f"{np.mean(errors <= bars):.0%}",
        ]  # fmt: skip
    told = np.mean([c["status"] == 2 for c in cases])
    return " | ".join(
        ["", *cells, f"{told:.0%}", f"{np.median([c['seconds'] for c in cases]):.1f}", ""]
    )


def main(
    blows: int = 3,
    page: str = "",
    log: str = "",
    first: int = 0,
    cells: tuple[int, int] | None = None,
) -> list[dict[str, Any]]:
    """So many blows on each structure, at 3 and at 5 % noise.

    Parameters
    ----------
    blows : of each structure and noise
    page : Markdown to write
    log : JSON lines of cases that are known; other cases are appended
    first : seed of the first blow
    cells : of a fine mesh, (52, 38) for 2000 sites, among which a search is timed
    """
    warnings.simplefilter("ignore", ao.AntioscWarning)
    known = Path(log).read_text().splitlines() if log and Path(log).exists() else []
    cases = [json.loads(line) for line in known]
    for kind in KINDS if blows else ():
        structure, truth = part(kind, (24, 18), 1.0, 1.0), part(kind, (31, 23), 1.01, 1.05)
        model = monitored_structure(structure, sensors_on(kind), None, (0, 0, -1), None, None, None)
        for seed in range(first, first + blows):
            true = blow(kind, truth, seed)
            for noise in (0.03, 0.05):
                cases.append(case(kind, model, true, noise, seed))
                if log:
                    with Path(log).open("a") as file:
                        file.write(json.dumps(cases[-1]) + "\n")
    text = told(cases, many(cells) if cells else "")
    print(text)
    if page:
        Path(page).write_text(text, encoding="utf-8")
    return cases


def told(cases: list[dict[str, Any]], more: str = "") -> str:
    """The page."""
    heads = [f"{name}, {what}" for name in AIMS for what in ("median", "95 %", "aim", "held")]
    head = " | ".join(["", "part, noise", "blows", *heads, "poor fit", "s a blow", ""])
    rule = "|---" * (len(heads) + 4) + "|"
    groups: dict[str, list[dict[str, Any]]] = {}
    for one in cases:
        groups.setdefault(f"{one['kind']}, {one['noise']:.0%}", []).append(one)
    rows = [row(name, some) for name, some in groups.items()]
    table = "\n".join(line.strip() for line in [head, rule, *rows])
    return PAGE.format(count=len(cases), rate=RATE / 1e3, samples=SAMPLES, table=table, many=more)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--blows", type=int, default=3, help="of each structure and noise")
    parser.add_argument("--page", default="", help="Markdown to write")
    parser.add_argument("--log", default="", help="JSON lines of all cases to append to")
    parser.add_argument("--first", type=int, default=0, help="seed of the first blow")
    parser.add_argument(
        "--cells", type=int, nargs=2, help="of a fine mesh on which a search is timed"
    )
    given = parser.parse_args()
    main(given.blows, given.page, given.log, given.first, given.cells)
