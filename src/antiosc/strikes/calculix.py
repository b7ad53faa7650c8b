"""The impact in CalculiX, where its `ccx` is installed, on the same mesh of quadratic tetrahedra.

The deck has the cells and the fixed dofs. The mean motion of the patch is the displacement of a
node of its own, by an equation with the entries of b. The striker is a mass there, and the contact
law a nonlinear spring between both. `ccx` takes equal steps with Newmark's average acceleration.
"""

from __future__ import annotations

import math
import os
import resource
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import cast

import numpy as np

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError, NotConvergedError
from antiosc.fem.elements.solid import Solid
from antiosc.fem.linalg.forecast import seconds_of_steps
from antiosc.fem.platform import compat
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.strikes.unreduced import Blow, Curve, Outcome, entries_of

PROGRAM = "ccx"
#: Words of its log when it has come to the end.
FINISHED = "Job finished"
#: Nodes of a tetrahedron of dolfinx in CalculiX's order.
ORDER = (0, 1, 2, 3, 9, 6, 8, 7, 5, 4)
#: The same with two corners swapped.
MIRRORED = (0, 2, 1, 3, 8, 6, 9, 7, 4, 5)
#: Points of the table of the law (CalculiX takes at most 200).
POINTS = 190
#: Last indentation of the table over the expected one.
DEEPEST = 1.5
#: Least entry of b in the equation over the largest.
LEAST = 1e-12
#: Factors of A a step; seconds of each over those of CHOLMOD's, and besides: SPOOLES took 5.8 to
#: 7.5 times as long for blocks of 3 900 to 28 000 dofs, and 0.011 s for 600 dofs.
ITERATIONS, SLOWER, LEAST_SECONDS = 2.0, 6.5, 0.01


def forecast(blow: Blow) -> float:
    """Seconds that `ccx` is expected to take; InputError for an impact that it cannot run."""
    _check(blow)
    factor = SLOWER * seconds_of_steps(entries_of(blow.structure), 0)
    return ITERATIONS * blow.steps * (factor + LEAST_SECONDS)


def run(blow: Blow, limit: float) -> Outcome:
    """Run CalculiX for at most `limit` seconds of processor time; returns its contact force."""
    with tempfile.TemporaryDirectory() as folder:
        deck = Path(folder, "impact.inp")
        with deck.open("w", encoding="ascii") as file:
            file.writelines(f"{line}\n" for line in lines_of(blow))
        usage = _finished(deck, limit)
        time, closing = _motions(deck.with_suffix(".dat"))
    depth = closing - blow.gap
    state = blow.law.touch(0.0)
    force = np.array([blow.law.force(depth_now, 0.0, state) for depth_now in depth.tolist()])
    seconds = usage.ru_utime + usage.ru_stime
    return Outcome(Curve(time, force, depth), seconds, 1024.0 * usage.ru_maxrss)


def _check(blow: Blow) -> None:
    """InputError for a blow that the deck does not describe."""
    structure = blow.structure
    matrices = cast("MeshedStructure", structure.matrices)
    ball = blow.striker
    attached = bool(matrices.springs) or bool(matrices.attached_inertia.any())
    reasons = {
        f"{PROGRAM} is not on the PATH": shutil.which(PROGRAM) is None,
        "the part is spread over several ranks": structure.comm.size > 1,
        "the deck is of quadratic tetrahedra": not _quadratic(matrices),
        "the deck is of isotropic solids": any(
            type(material) is not Solid for material, _ in matrices.parts
        ),
        "the part carries masses or springs": attached,
        "the part is prestressed": matrices.preload is not None,
        "the impactor vibrates": len(ball.omega) != 1 or bool(ball.omega.any()),
        "the contact law has memory or damping, and a spring has none": blow.law.has_memory
        or blow.law.rate_dependent,
    }
    for reason, applies in reasons.items():
        if applies:
            raise InputError(reason)


def _quadratic(matrices: MeshedStructure) -> bool:
    """Whether a part has quadratic tetrahedra."""
    return matrices.mesh.cell == "tetrahedron" and matrices.form.degree == 2


def lines_of(blow: Blow) -> Iterator[str]:
    """Yield the lines of the deck, SI units."""
    matrices = cast("MeshedStructure", blow.structure.matrices)
    x = matrices.places.nodes
    patch, striker = len(x) + 1, len(x) + 2
    yield "*NODE, NSET=ALL"
    for number, (a, b, c) in enumerate([*x.tolist(), *2 * [[0.0, 0.0, 0.0]]], 1):
        yield f"{number}, {a:.12e}, {b:.12e}, {c:.12e}"
    yield from _cells(matrices)
    yield "*BOUNDARY"
    for node, component in _places(matrices.fixed, matrices.block):
        yield f"{node}, {component}, {component}"
    yield f"{patch}, 2, 3\n{striker}, 2, 3"
    yield from _mean(blow.b, matrices.block, patch)
    yield from _contact(blow, patch, striker)
    yield from _step(blow, striker)


def _cells(matrices: MeshedStructure) -> Iterator[str]:
    """Yield the lines of the elements and materials."""
    nodes = matrices.places.nodes
    for number, (material, cells) in enumerate(matrices.parts):
        dofs = compat.cell_dofs(matrices.form.space, (0,), cells) // matrices.block
        yield f"*ELEMENT, TYPE=C3D10, ELSET=PART{number}"
        for cell, node_numbers in zip(cells.tolist(), _oriented(dofs, nodes), strict=True):
            yield ", ".join(map(str, (cell + 1, *(node_numbers + 1).tolist())))
        solid = cast("Solid", material)
        yield f"*MATERIAL, NAME=M{number}"
        yield f"*ELASTIC\n{solid.E:.12g}, {solid.nu:.12g}\n*DENSITY\n{solid.rho:.12g}"
        yield f"*SOLID SECTION, ELSET=PART{number}, MATERIAL=M{number}"


def _oriented(dofs: IntArray, nodes: Array) -> IntArray:
    """Nodes of cells (n, 10) in CalculiX's order, with positive volumes."""
    corners = nodes[dofs[:, :4]]
    edges = corners[:, 1:] - corners[:, :1]
    positive = np.linalg.det(edges) > 0
    order = np.where(positive[:, None], ORDER, MIRRORED)
    return np.take_along_axis(dofs, order, axis=1)


def _places(dofs: IntArray, block: int) -> Iterator[tuple[int, int]]:
    """(node, component) of dofs, both from 1 on."""
    for dof in np.asarray(dofs).tolist():
        yield dof // block + 1, dof % block + 1


def _mean(b: Array, block: int, patch: int) -> Iterator[str]:
    """Yield the lines of the equation bᵀu - u_patch = 0."""
    dofs = np.flatnonzero(np.abs(b) > LEAST * np.abs(b).max())
    yield f"*EQUATION\n{len(dofs) + 1}\n{patch}, 1, -1.0"
    for (node, component), entry in zip(_places(dofs, block), b[dofs].tolist(), strict=True):
        yield f"{node}, {component}, {entry:.12e}"


def _contact(blow: Blow, patch: int, striker: int) -> Iterator[str]:
    """Yield the lines of the striker's mass and of the contact law between it and the patch."""
    ball = blow.striker
    yield f"*ELEMENT, TYPE=MASS, ELSET=BALL\n{_first(blow)}, {striker}"
    yield f"*MASS, ELSET=BALL\n{1 / ball.beta[0] ** 2:.12g}"
    yield f"*ELEMENT, TYPE=SPRING2, ELSET=LAW\n{_first(blow) + 1}, {patch}, {striker}"
    yield "*SPRING, ELSET=LAW, NONLINEAR\n1, 1"
    state = blow.law.touch(0.0)
    for share in np.linspace(1.0, 0.0, POINTS + 1).tolist():
        depth = DEEPEST * blow.depth * share**2
        yield f"{-blow.law.force(depth, 0.0, state):.12e}, {-depth - blow.gap:.12e}"
    yield "0.0, 1.0"


def _step(blow: Blow, striker: int) -> Iterator[str]:
    """Yield the lines of the initial velocity, load, time steps and output."""
    ball = blow.striker
    beta = float(ball.beta[0])
    yield f"*INITIAL CONDITIONS, TYPE=VELOCITY\n{striker}, 1, {beta * ball.start[0]:.12e}"
    yield f"*NSET, NSET=CONTACT\n{striker - 1}, {striker}"
    yield f"*STEP, INC={blow.steps + 10}\n*DYNAMIC, DIRECT, ALPHA=0."
    yield f"{blow.step:.12e}, {blow.steps * blow.step:.12e}"
    yield f"*CLOAD\n{striker}, 1, {ball.load[0] / beta:.12e}"
    yield "*NODE PRINT, NSET=CONTACT\nU\n*END STEP"


def _first(blow: Blow) -> int:
    """The number of the first element after the cells."""
    return cast("MeshedStructure", blow.structure.matrices).mesh.n_cells + 1


def _finished(deck: Path, limit: float) -> resource.struct_rusage:
    """Resources that `ccx` used for a deck on one thread; NotConvergedError if it fails or exceeds
    `limit`.
    """
    log = deck.with_suffix(".log")
    limited = f"ulimit -t {math.ceil(limit)}; exec {PROGRAM} -i {deck.stem}"
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    with log.open("wb") as file:
        process = subprocess.Popen(
            ["sh", "-c", limited],
            cwd=deck.parent,
            stdout=file,
            stderr=subprocess.STDOUT,
            env=environment,
        )
        try:
            _, status, usage = os.wait4(process.pid, 0)
        except BaseException:
            process.kill()
            process.wait()
            raise
    process.returncode = os.waitstatus_to_exitcode(status)
    if usage.ru_utime + usage.ru_stime >= limit:
        raise NotConvergedError(f"ended after {limit:g} s, the limit of compare")
    if process.returncode or FINISHED not in log.read_text(errors="replace"):
        raise NotConvergedError(_failure(log))
    return usage


def _failure(log: Path) -> str:
    """The last error in the log of `ccx`."""
    lines = [line.strip() for line in log.read_text(errors="replace").splitlines()]
    errors = [line for line in lines if line.startswith("*ERROR")]
    return errors[0] if errors else "it ended before its last step"


def _motions(path: Path) -> tuple[Array, Array]:
    """Times and approach w - u (n,) of the nodes that the `.dat` file lists, patch first."""
    times = [0.0]
    approaches: list[float] = []
    for line in path.read_text(encoding="ascii").splitlines():
        words = line.split()
        if line.strip().startswith("displacements"):
            times.append(float(words[-1]))
        elif len(words) == 4 and words[0].isdigit():
            approaches.append(float(words[1]))
    patch, striker = np.array(approaches).reshape(-1, 2).T
    return np.array(times), np.append(0.0, striker - patch)
