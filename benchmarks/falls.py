"""Random falls to rest: what they cost, how they end, and what they keep.

Rigid blocks, straight beams and solid boxes of random proportions fall in random orientations on
stiff and soft floors, with and without friction and losses. The script prints the processor seconds
of each fall with its impacts and contacts, the energy that hand-overs between flight and contact
change, and what the fall gains in all, over its energy at the start; then the summary.

    .venv/bin/python benchmarks/falls.py --help
"""

from __future__ import annotations

import time
import warnings

import dolfinx
import numpy as np
from mpi4py import MPI
from options import command

import antiosc as ao
from antiosc.fem.platform import compat

CONCRETE = ao.Solid(30e9, 0.2, 2400.0)
MATERIALS = {
    "steel": (210e9, 0.3, 7800.0),
    "aluminium": (70e9, 0.33, 2700.0),
    "ABS": (2.3e9, 0.36, 1050.0),
}
KINDS = ("block", "beam", "box")


def main(falls: int = 100, first: int = 0) -> dict[str, float]:
    """Let parts fall; return the summary.

    Parameters
    ----------
    falls : number of falls
    first : seed of the first fall
    """
    seconds, gains, failed = [], [], 0
    for seed in range(first, first + falls):
        own = KINDS[seed % len(KINDS)]
        part, given = case(own, seed)
        begun = time.process_time()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                fall = ao.drop(part, **given)
        except ao.AntioscError as error:
            failed += 1
            print(f"{seed:4} {own:5} failed after {time.process_time() - begun:.1f} s: {error}")
            continue
        seconds.append(time.process_time() - begun)
        energy = fall.energy()[1].sum(axis=1)
        gains.append(max(float((energy - np.minimum.accumulate(energy)).max()) / energy[0], 0.0))
        print(
            f"{seed:4} {own:5} {seconds[-1]:6.2f} s, {len(fall.impacts):3} impacts, "
            f"{len(fall.episodes):4} contacts, gain {gains[-1]:.1e}, tol {given['tol']:g}, "
            f"{fall.message}",
            flush=True,
        )
    found = {
        "falls": float(falls),
        "failed": float(failed),
        "median seconds": float(np.median(seconds)),
        "most seconds": max(seconds),
        "more than 20 s": float(np.sum(np.array(seconds) > 20.0)),
        "largest gain": max(gains),
    }
    print(", ".join(f"{name} {value:.3g}" for name, value in found.items()))
    return found


def case(kind: str, seed: int) -> tuple[ao.Structure | ao.RigidBody, dict[str, object]]:
    """A part, and what else `drop` takes."""
    rng = np.random.default_rng(seed)
    length = 10 ** rng.uniform(-1.2, 0.0)
    size = length * np.array([1.0, *10 ** rng.uniform(-1.7, 0.0, 2)])
    material = tuple(MATERIALS.values())[rng.integers(3)]
    tilt = rng.uniform(-90, 90, 3) if rng.random() < 0.7 else rng.choice([0.0, 0.01, 1.0, 5.0], 3)
    given = {
        "height": float(10 ** rng.uniform(-1.5, 0.3)),
        "tilt": tuple(tilt.tolist()),
        "floor": floor(rng, kind),
        "modes": int(rng.choice([3, 6, 10, 20])),
        "tol": float(rng.choice([1e-2, 1e-3, 1e-4], p=[0.4, 0.5, 0.1])),
        "until": "rest",
    }
    return PARTS[kind](size, material, rng), given


def floor(rng: np.random.Generator, kind: str) -> ao.Floor:
    """A half-space, a sheet, or a law."""
    friction, loss = float(rng.choice([0.0, 0.3, 0.6])), bool(rng.random() < 0.75)
    how = rng.integers(3)
    if how == 0:
        loses = loss or kind == "block"
        restitution = float(rng.uniform(0.3, 0.9)) if loses else None
        return ao.Floor(CONCRETE, friction=friction, restitution=restitution)
    if how == 1:
        sheet = ao.SoftLayer(0.01, 10 ** rng.uniform(5.5, 8), loss * float(rng.uniform(0.03, 0.3)))
        return ao.Floor(layer=sheet, friction=friction)
    restitution = float(rng.uniform(0.3, 0.9)) if loss else 1.0
    return ao.Floor(law=ao.HuntCrossley(10 ** rng.uniform(6, 9), restitution), friction=friction)


def block(size: np.ndarray, material: tuple[float, ...], rng: np.random.Generator) -> ao.RigidBody:
    """Rigid, touching with its corners."""
    signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    mass = material[2] * float(size.prod())
    moments = mass / 12 * (size @ size - size**2)
    sites = {f"{i}": (corner, (0, 0, 1)) for i, corner in enumerate(signs * size / 2)}
    return ao.RigidBody(mass, moments, sites)


def beam(size: np.ndarray, material: tuple[float, ...], rng: np.random.Generator) -> ao.Structure:
    """Straight, of one to twelve elements, touching with its ends."""
    nodes = np.zeros((int(rng.integers(2, 13)), 3))
    nodes[:, 0] = np.linspace(-size[0] / 2, size[0] / 2, len(nodes))
    cells = np.column_stack([np.arange(len(nodes) - 1), np.arange(1, len(nodes))])
    mesh = compat.create_mesh(MPI.COMM_SELF, cells, nodes, "interval", 1)
    section = ao.Section.rectangle(*np.minimum(size[1:], size[0] / 5).tolist())
    return ao.Structure(ao.read_mesh(mesh), ao.Beam(*material, section, orientation=(0, 0, 1)))


def box(size: np.ndarray, material: tuple[float, ...], rng: np.random.Generator) -> ao.Structure:
    """Of linear hexahedra."""
    cells = np.maximum(np.round(5 * size / size.max()), 1).astype(int).tolist()
    corners = [-size / 2, size / 2]
    kind = dolfinx.mesh.CellType.hexahedron
    mesh = dolfinx.mesh.create_box(MPI.COMM_SELF, corners, cells, cell_type=kind)
    return ao.Structure(ao.read_mesh(mesh), ao.Solid(*material))


PARTS = {"block": block, "beam": beam, "box": box}


if __name__ == "__main__":
    command(main)
