"""Decks of CalculiX: a part and a sphere with contact between their surfaces; what comes back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from bodies import Blow, Body
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: time between two prints of the force, s, where the steps are shorter
PRINTED = 2e-7


def part_deck(body: Body, path: Path) -> None:
    """Write one body with its material and supports, as antiosc's `read_model` takes it."""
    path.write_text("\n".join([*_body("PART", body, 0, 0), *_held("PART", body, 0)]) + "\n")


def deck(
    blow: Blow, path: Path, *, step: float, duration: float, k: float, explicit: bool = False
) -> None:
    """Write the deck of both bodies, with linear penalty contact of k N/mm^3 between their faces.

    Implicit dynamics takes equal steps. Explicit dynamics takes the same step throughout too:
    CalculiX scales the mass of every element whose own limit, as CalculiX estimates it, is shorter.
    """
    n, m = len(blow.part.x), len(blow.part.cells)
    bodies = (("PART", blow.part, 0, 0), ("BALL", blow.ball, n, m))
    lines = [line for name, body, x0, c0 in bodies for line in _body(name, body, x0, c0)]
    for name, body, _, first in bodies:
        lines.append(f"*SURFACE, NAME=S{name}, TYPE=ELEMENT")
        for face, elements in enumerate(body.faces(), 1):
            lines += [f"{first + i + 1}, S{face}" for i in elements]
    lines += [line for name, body, x0, _ in bodies for line in _held(name, body, x0)]
    method = "*DYNAMIC, DIRECT, ALPHA=-0.05"
    times = f"{step:g}, {duration:g}"
    if explicit:  # with DIRECT, CalculiX 2.20 takes steps of zero
        method, times = "*DYNAMIC, EXPLICIT", f"{step:g}, {duration:g}, {step:g}"
    every = max(1, round(PRINTED / step))
    start = blow.speed * blow.direction
    lines += [
        "*INITIAL CONDITIONS, TYPE=VELOCITY",
        *(f"NBALL, {i}, {v:.12g}" for i, v in enumerate(start, 1) if v),
        "*SURFACE INTERACTION, NAME=TOUCH",
        f"*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n{k:g}",
        "*CONTACT PAIR, INTERACTION=TOUCH, TYPE=SURFACE TO SURFACE\nSBALL, SPART",
        f"*STEP, NLGEOM, INC={int(duration / step) + 10}",
        f"{method}\n{times}",
        f"*CONTACT PRINT, SLAVE=SBALL, MASTER=SPART, FREQUENCY={every}\nCF",
        "*END STEP",
    ]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


def _body(name: str, body: Body, x0: int, c0: int) -> list[str]:
    """Nodes, elements, material and section; numbers begin after x0 and c0."""
    lines = [f"*NODE, NSET=N{name}"]
    lines += [f"{x0 + i + 1}, {a:.9e}, {b:.9e}, {c:.9e}" for i, (a, b, c) in enumerate(body.x)]
    lines.append(f"*ELEMENT, TYPE=C3D10, ELSET=E{name}")
    for i, cell in enumerate(body.cells):
        lines.append(", ".join(str(v) for v in (c0 + i + 1, *(cell + x0 + 1))))
    one = body.material
    return [
        *lines,
        f"*MATERIAL, NAME=M{name}",
        f"*ELASTIC\n{one.E}, {one.nu}",
        f"*DENSITY\n{one.rho}",
        f"*SOLID SECTION, ELSET=E{name}, MATERIAL=M{name}",
    ]


def _held(name: str, body: Body, x0: int) -> list[str]:
    """Node sets that are held, and what holds them."""
    lines = []
    for i, (nodes, first, last) in enumerate(body.held):
        lines += [
            f"*NSET, NSET=H{name}{i}",
            *(f"{x0 + n + 1}," for n in np.flatnonzero(nodes)),
            f"*BOUNDARY\nH{name}{i}, {first}, {last}",
        ]
    return lines


def forces(path: Path, direction: Array) -> tuple[Array, Array]:
    """Times (s) and the force (N) against a direction, that the `.dat` file of CalculiX prints."""
    times, values = [0.0], [0.0]
    lines = path.read_text(encoding="ascii").splitlines()
    for i, line in enumerate(lines):
        if line.strip().startswith("statistics for slave set"):
            times.append(float(line.split()[-1]))
        if line.strip().startswith("total surface force (fx,fy,fz)"):
            force = np.array([float(v) for v in lines[i + 2].split()[:3]])
            values.append(abs(float(force @ direction)))
    return np.array(times), np.array(values)
