"""Two levels on sixty parts that are hard for them, beside a factor, and the solver that is chosen.

    benchmarks/solver_traps.py             writes speed/solver_traps.md
    benchmarks/solver_traps.py TRAP SEED   one line of it

Thin plates, nearly incompressible materials, slivers, free bodies, several sites, stiff springs,
anisotropy, hexahedra: five blocks of each, of sizes drawn by lot, twenty anti-oscillators, one
thread. Seconds are those of the processor for solver and model; the error is the largest difference
of Z(ω) from that of the factor at nine frequencies up to the fifth antiresonance, with a hundredth
of each as its imaginary part, which keeps off the poles, each over the Z of the factor. A solver
that refuses is quoted, and a warning of ill-conditioned matrices is told, also of the factor, whose
own error the difference then is. The parts have more than 30 000 dofs, below which a part is
factored: the solver is chosen by forecast. Other work on the machine changed the seconds of one and
the same solver by up to a factor of two.
"""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import dolfinx
import numpy as np
from mpi4py import MPI

import antiosc as ao

OUT = Path(__file__).parent / "speed" / "solver_traps.md"
SEEDS = range(5)
CELLS, PLATES = (17, 9, 8), (29, 34)
#: Dofs from which times are compared.
LARGE = 30_000
#: trap -> what differs from a held block of steel
TRAPS = (
    "plate, t = h", "plate, t = h/2", "plate, t = h/8", "nu 0.45", "nu 0.49", "nu 0.499",
    "slivers", "free", "two sites", "spring 1e12", "anisotropy", "hexahedra",
)  # fmt: skip
#: Error of Z from which a model counts as wrong, and the ratio of times that is accepted.
WRONG, RATIO = 1e-6, 1.5


def part_of(trap: str, seed: int, solver: str) -> ao.Structure:
    """The part of a line."""
    rng = np.random.default_rng(seed)
    cells = [int(n) for n in CELLS + rng.integers(-1, 2, 3)]
    while 3 * np.prod(2 * np.array(cells) + 1) < LARGE:
        cells = [n + 1 for n in cells]
    size = 0.01 * np.array(cells) * rng.uniform(0.8, 1.25, 3)
    if trap.startswith("plate"):
        cells = [int(n) for n in rng.integers(*PLATES, 2)] + [1]
        share = {"h": 1.0, "h/2": 0.5, "h/8": 0.125}[trap.split(" = ")[1]]
        size = 0.01 * np.array(cells) * (1.0, 1.0, share)
    kind = "hexahedron" if trap == "hexahedra" else "tetrahedron"
    cell = getattr(dolfinx.mesh.CellType, kind)
    mesh = dolfinx.mesh.create_box(MPI.COMM_SELF, [np.zeros(3), size], cells, cell_type=cell)
    if trap == "slivers":
        x = mesh.geometry.x
        inner = np.all((x > 1e-9) & (x < size - 1e-9), axis=1)
        x[inner] += 0.3 * (size / cells) * rng.uniform(-1, 1, (inner.sum(), 3))
    steel = ao.Solid(210e9, float(trap[3:]) if trap.startswith("nu") else 0.3, 7800.0)
    if trap == "anisotropy":
        E, G = (140e9, 10e9, 8e9), (5e9, 5e9, 3e9)
        steel = ao.AnisotropicSolid.orthotropic(E=E, nu=(0.3, 0.3, 0.4), G=G, rho=1600.0)
    held = [] if trap == "free" else [ao.Support(lambda x: np.isclose(x[0], 0.0))]
    top = (0.5 * size[0], 0.5 * size[1], size[2])
    springs = [ao.Spring(top, {"z": 1e12})] if trap == "spring 1e12" else []
    return ao.Structure(ao.read_mesh(mesh), steel, held, attached=springs, solver=solver)


def site_of(trap: str, part: ao.Structure) -> ao.Site | dict[str, ao.Site]:
    """Where the part is struck; a point, since an anisotropic material has no patch."""
    _, high = part.matrices.mesh.box
    one = ao.Site((0.9 * high[0], 0.3 * high[1], high[2]), (0.1, 0, -1))
    if trap != "two sites":
        return one
    return {"top": one, "side": ao.Site((0.5 * high[0], 0.0, 0.5 * high[2]), (0, 1, 0))}


class Measured(NamedTuple):
    """Seconds, the model or the refusal, and whether a warning told of its accuracy."""

    seconds: float
    found: ao.AntiOscillators | str
    warned: bool


def measured(trap: str, seed: int, solver: str) -> Measured:
    """A solver on the part of a line."""
    part = part_of(trap, seed, solver)
    site = site_of(trap, part)
    began = time.process_time()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ao.AccuracyWarning)
        try:
            found: ao.AntiOscillators | str = ao.extract(part, site, n=20, shapes=False)
        except ao.AntioscError as error:
            found = str(error)
    seconds = time.process_time() - began
    warned = any("ill-conditioned" in str(one.message) for one in caught)
    return Measured(seconds, found, warned)


def stiffness(model: ao.AntiOscillators, reference: ao.AntiOscillators) -> np.ndarray:
    """Z at the frequencies of a line."""
    omega = np.linspace(0.1, 1.0, 9) * reference.omega[4] * (1 - 0.01j)
    return np.asarray(model.dynamic_stiffness(omega)).reshape(len(omega), -1)


def line_of(trap: str, seed: int) -> tuple[str, bool, bool]:
    """(the line, whether the model of two levels is right or refused, whether the choice is)."""
    exact_time, exact, doubtful = measured(trap, seed, "direct")
    own_time, own, warned = measured(trap, seed, "iterative")
    chosen_time, chosen, _ = measured(trap, seed, "auto")
    assert not isinstance(exact, str), exact
    assert not isinstance(chosen, str), chosen
    best = min(exact_time, own_time) if not isinstance(own, str) else exact_time
    if isinstance(own, str):
        told, right = own[:80], True
    else:
        Z = stiffness(exact, exact)
        lost = np.abs(stiffness(own, exact) - Z).max(axis=1)
        error = np.max(lost / np.abs(Z).max(axis=1))
        told, right = f"{error:.0e}", bool(error <= WRONG) or warned or doubtful
        if warned:
            told += ", with a warning"
        if doubtful:
            told += ", the factor with a warning"
    dofs = part_of(trap, seed, "auto").dofs
    times = " | ".join(f"{one:.2f}" for one in (exact_time, own_time, chosen_time))
    fast = chosen_time <= RATIO * best
    name = "factor" if str(chosen.info.solver).startswith("factor") else "two levels"
    return f"| {trap} | {dofs} | {times} | {name} | {told} |", right, fast


def main(arguments: Sequence[str]) -> None:
    """Write the table, after every line."""
    if arguments:
        print(line_of(arguments[0], int(arguments[1]))[0])
        return
    head = "| part | dofs | factor s | two levels s | chosen s | chosen | error of two levels |"
    about = " ".join(__doc__.split("\n\n")[2].split())
    warnings.filterwarnings("ignore", "the compliance under a point load")
    lines: list[str] = []
    right = fast = 0
    line_of("free", 0)  # forms are compiled before the clock
    for seed in SEEDS:
        for trap in TRAPS:
            line, is_right, is_fast = line_of(trap, seed)
            lines.append(line)
            right, fast = right + is_right, fast + is_fast
            count = (
                f"Of {len(lines)} parts {len(lines) - right} are wrong by more than {WRONG:.0e} "
                f"without a word; the chosen solver is within {RATIO} of the faster one on {fast}."
            )
            text = ["# Traps for two levels", "", about, "", count, "", head, "|" + "---|" * 7]
            OUT.write_text("\n".join([*text, *lines]) + "\n")
            print(line, flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
