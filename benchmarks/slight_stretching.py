"""How well the energy of second-order strain tells what it changes: thin solids, all dofs.

Angles, clips and ribbed plates of random size, held at one end, are struck so that they deflect by
a tenth to half of their walls' thickness. The reference has every nodal displacement of the same
mesh with the whole second-order strain, and again without it
(`tests/support/full_second_order.py`). The share is what the error bar has for a solid that is
taken as linear: `LEFT_OUT_SAFETY` times the energy of second-order strain over the linear one, at
least `LEFT_OUT_LEAST`.

    OMP_NUM_THREADS=1 .venv/bin/python benchmarks/slight_stretching.py --count 24
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import scipy.sparse

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests" / "support"))

import antiosc as ao
from antiosc.errors import AntioscError
from antiosc.impact.error_budget import LEFT_OUT_LEAST, LEFT_OUT_SAFETY
from antiosc.strikes import second_order
from full_second_order import Full

#: Steps of the reference: with twice as many two changes were -1.2 % for -1.3 % (blow 1), and
#: -2.0 % for -1.5 % (blow 8).
STEPS, SEED = 150, 1
#: Boxes (corner, sides) of a part in terms of its length L, height H, width W and wall h.
Boxes = list[tuple[tuple[float, float, float], tuple[float, float, float]]]


def angle(L: float, H: float, W: float, h: float) -> Boxes:
    return [((0, 0, 0), (L, W, h)), ((L - h, 0, 0), (h, W, H))]


def clip(L: float, H: float, W: float, h: float) -> Boxes:
    return [((0, 0, 0), (L, W, h)), ((0, 0, H - h), (L, W, h)), ((0, 0, 0), (h, W, H))]


def ribbed(L: float, H: float, W: float, h: float) -> Boxes:
    return [((0, 0, 0), (L, W, h)), ((0, W / 2 - h / 2, 0), (L, h, H / 2))]


#: Kinds of parts, and the face that is held: its axis, and whether its far side.
PARTS: dict[str, tuple[Callable[..., Boxes], int, bool]] = {
    "angle": (angle, 0, False),
    "clip": (clip, 0, True),
    "ribbed": (ribbed, 1, False),
}


def meshed(boxes: Boxes, size: float, folder: Path) -> ao.Mesh:
    """The union of boxes in tetrahedra."""
    lines = ['SetFactory("OpenCASCADE");']
    for number, (corner, sides) in enumerate(boxes, start=1):
        values = ", ".join(f"{value:.9g}" for value in (*corner, *sides))
        lines.append(f"Box({number}) = {{{values}}};")
    others = ", ".join(str(number) for number in range(2, len(boxes) + 1))
    lines.append(f"BooleanUnion{{ Volume{{1}}; Delete; }}{{ Volume{{{others}}}; Delete; }}")
    path = folder / "part.geo"
    path.write_text("\n".join(lines), encoding="utf-8")
    return ao.read_mesh(path, size=size)


def tried(kind: str, rng: np.random.Generator, folder: Path) -> tuple[float, float, float]:
    """(deflection over the wall, change of the peak force, energy) of one random blow."""
    shape, axis, far = PARTS[kind]
    h = rng.uniform(1.5e-3, 3e-3)
    L, H, W = rng.uniform(8, 14) * h, rng.uniform(6, 10) * h, rng.uniform(5, 8) * h
    boxes = shape(L, H, W, h)
    mesh = meshed(boxes, 1.5 * h, folder)
    ends = np.array([np.add(corner, sides) for corner, sides in boxes]).max(axis=0)
    place = ends[axis] if far else 0.0
    held = ao.Support(lambda x: np.isclose(x[axis], place))
    part = ao.Structure(mesh, ao.material("PETG printed"), [held])
    point = (rng.uniform(0.3, 0.7) * L, rng.uniform(0.6, 0.8) * W, 0.0)
    site = ao.Site(point, (0, 0, 1), snap=True, radius=0.8 * h)
    model = ao.extract(part, site, n=40)
    mass, depth = 10 ** rng.uniform(-2.5, -1), rng.uniform(0.1, 0.5) * h
    speed = depth * np.sqrt(model.k0 / mass)
    k = 10 * model.k0 / np.sqrt(depth)
    duration = 1.2 * np.pi * np.sqrt(mass / model.k0)
    striker, law = ao.RigidMass(mass, velocity=speed), ao.Power(k, 1.5)
    run = partial(ao.simulate, impactor=striker, contact=law, duration=duration)
    energy = second_order.energy_of_solid(part, run(model))
    full = Full(part, site)
    _, force, moved = full.impact(mass, speed, k, duration, STEPS)
    nothing = scipy.sparse.csr_matrix(full.K.shape)
    full.forces = np.zeros_like
    full.tangent = lambda _: nothing
    _, linear, _ = full.impact(mass, speed, k, duration, STEPS)
    return float(np.abs(moved).max()) / h, float(force.max() / linear.max() - 1), energy


def main(count: int) -> None:
    """Print each blow, and how many shares hold."""
    held = []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(count):
            kind = list(PARTS)[number % len(PARTS)]
            try:
                found = tried(kind, np.random.default_rng((SEED, number)), Path(folder))
            except (AntioscError, RuntimeError) as error:
                print(f"{number:2d} {kind:7} left out: {str(error)[:90]}", flush=True)
                continue
            ratio, change, energy = found
            share = max(LEFT_OUT_SAFETY * energy, LEFT_OUT_LEAST)
            slight = energy <= second_order.SLIGHT_ENERGY
            if slight:
                held.append(abs(change) <= share)
            print(
                f"{number:2d} {kind:7} w/h {ratio:.2f} change {change:+.2%} energy {energy:.2%}"
                f" share {share:.2%} {'' if abs(change) <= share else 'OUTSIDE '}"
                f"{'' if slight else 'not slight'}",
                flush=True,
            )
    print(f"{sum(held)} of {len(held)} shares of solids that are taken as linear hold")


if __name__ == "__main__":
    reader = argparse.ArgumentParser(description=__doc__)
    reader.add_argument("--count", type=int, default=24)
    warnings.simplefilter("ignore")
    main(reader.parse_args().count)
