"""A cantilever with a dashpot at its tip, struck there: error and time beside dashpots of any size.

The exact impulse comes from exponentials of the whole state matrix of the mesh. Damping ratios of
the modes, all that other programs have, are wrong: the dashpot couples the modes.

    .venv/bin/python demos/tip_damper.py --help
"""

from __future__ import annotations

import timeit
import warnings
from dataclasses import replace
from pathlib import Path
from time import process_time

import command_line
import numpy as np
import scipy.linalg
from matplotlib.figure import Figure

import antiosc as ao
from antiosc import closed_form

ROOT = Path(__file__).resolve().parent.parent
DAMPERS = (2.0, 5.0, 11.0, 20.0, 100.0)
BEAM = closed_form.UniformBeam.timoshenko(
    E=70e9, nu=0.3, rho=2700.0, area=2e-4, inertia=6.7e-9, length=1.0
)
#: The exponentials are those of a linear system: the law is given, a spring.
BALL, LAW, END = ao.RigidMass(0.16, velocity=1.0), ao.Linear(1.2e5), 16e-3


def main(modes: int = 20, n: int = 12, out: Path = ROOT / "out") -> dict[str, float]:
    """Strike the cantilever with every dashpot; return the largest errors and the ratio of times.

    `modes` of the cantilever are the dofs of the whole system; `n` anti-oscillators.
    """
    out.mkdir(parents=True, exist_ok=True)
    body = closed_form.cantilever(BEAM, 1.0).anti_oscillators(modes - 1).modal()
    K, M, site = np.diag(body.omega**2), np.eye(modes), ao.Site(vector=body.b)
    bare = ao.extract(ao.Structure.from_matrices(K, M, backend="scipy"), site, n=n)
    found, seconds = [], {0.0: timed(bare)}
    for c in DAMPERS:
        C = c * np.outer(body.b, body.b)
        part = ao.Structure.from_matrices(K, M, C=C, backend="scipy")
        model = ao.extract(part, site, n=n)
        free = model.modal()
        ratio = free.damping.matrix.diagonal() / (2 * free.omega)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ao.AntioscWarning)  # of large ratios
            other = replace(bare, damping=ao.Damping(ratio=np.minimum(ratio, 0.99).tolist()))
        impulses = [ao.simulate(one, BALL, LAW, END).impulse for one in (model, other)]
        found.append(np.array(impulses) / exact(K, C, body.b) - 1)
        seconds[c] = timed(model)
        print(f"c {c:g} N s/m: errors {abs(found[-1])}, {1e3 * seconds[c]:.2f} ms")
    plot(np.abs(found), out / "tip_damper.png")
    slower = max(seconds[c] for c in DAMPERS) / seconds[0.0]
    print(f"an undamped impact takes {1e3 * seconds[0.0]:.2f} ms; written to {out}: tip_damper.png")
    off, by_ratios = np.abs(found).max(axis=0)
    return {"error": off, "with ratios": by_ratios, "times slower": slower}


def exact(K: np.ndarray, C: np.ndarray, b: np.ndarray, steps: int = 12_000) -> float:
    """Impulse by the exponentials of all states, with the ball and without."""
    n, beside = len(K), np.append(b, -1.0)
    inverse = np.diag(np.append(np.ones(n), 1 / BALL.mass))
    moves = []
    for spring in (0.0, LAW.stiffness):
        A = np.zeros((2 * n + 2, 2 * n + 2))
        A[: n + 1, n + 1 :] = np.eye(n + 1)
        pressed = scipy.linalg.block_diag(K, 0.0) + spring * np.outer(beside, beside)
        A[n + 1 :] = -inverse @ np.hstack([pressed, scipy.linalg.block_diag(C, 0.0)])
        moves.append(scipy.linalg.expm(A * END / steps))
    z, total = np.zeros(2 * n + 2), 0.0
    z[-1] = BALL.velocity
    for k in range(steps):
        depth = -float(beside @ z[: n + 1])
        total += max(depth, 0.0)
        z = moves[k == 0 or depth > 0] @ z
    return LAW.stiffness * total * END / steps


def timed(model: ao.AntiOscillators) -> float:
    """CPU seconds of an impact, the least of five."""
    return min(timeit.repeat(lambda: ao.simulate(model, BALL, LAW, END), process_time, number=1))


def plot(errors: np.ndarray, path: Path) -> None:
    """Errors of the impulse beside the dashpot."""
    axes = (figure := Figure(figsize=(6, 3.6), layout="constrained")).subplots()
    for values, label in zip(errors.T, ("first-order modes", "damping ratios"), strict=True):
        axes.loglog(DAMPERS, values, "o-", label=label)
    axes.set(xlabel="dashpot [N s/m]", ylabel="error of the impulse")
    axes.legend()
    figure.savefig(path, dpi=120)


if __name__ == "__main__":
    command_line.command(main)
