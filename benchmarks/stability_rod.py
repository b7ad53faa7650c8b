"""A rod flies against a rigid wall: what fixed-step integrators make of its energy.

The exact rod rebounds as fast as it came, after 2 L/c. Beside antiosc stand central differences and
the implicit rules of Chung and Hulbert's family (J. Appl. Mech. 60 (1993) 371): the trapezoid rule,
HHT with α = −0.1, and generalized-α with a spectral radius of 0.8. The wall is a penalty spring a
hundred times as stiff as an element, or a Lagrange multiplier on the position.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

import antiosc as ao
from antiosc import plotting

Array = NDArray[np.float64]
ELEMENTS, N, PENALTY = (
    50,
    40,
    100.0,
)  # lengths, masses and stiffnesses of elements are 1, and the speed is 1
#: name -> α_m, α_f of the family
RULES = {"trapezoid": (0.0, 0.0), "HHT": (0.0, 0.1), "generalized-α": (1 / 3 - 1 / 9, 4 / 9)}
#: Renard's series, over the time of a wave along an element
STEPS = np.array(
    [d * p for d in (0.1, 1.0, 10.0) for p in (1, 1.25, 1.6, 2, 2.5, 3.15, 4, 5, 6.3, 8)]
)
STEPS = STEPS[STEPS <= 20.0]
SHOWN = (0.1, 0.5, 1.0, 5.0)
COLOURS = {"antiosc": "k", "central differences": "C3"} | {
    rule: f"C{i}" for i, rule in enumerate(RULES)
}


def matrices() -> tuple[Array, Array]:
    """K and the lumped masses."""
    K = 2 * np.eye(ELEMENTS + 1) - np.eye(ELEMENTS + 1, k=1) - np.eye(ELEMENTS + 1, k=-1)
    K[0, 0] = K[-1, -1] = 1.0
    masses = np.ones(ELEMENTS + 1)
    masses[[0, -1]] = 0.5
    return K, masses


def energy(K: Array, masses: Array, u: Array, v: Array, penalty: float) -> float:
    """That of the rod and of the penalty spring."""
    spring = penalty * np.minimum(u[0], 0.0) ** 2
    return float(u @ K @ u + masses @ v**2 + spring) / 2


def implicit(rule: str, h: float, multiplier: bool) -> float:
    """Energy after the blow over that before, by a rule of the family."""
    K, masses = matrices()
    M, (am, af) = np.diag(masses), RULES[rule]
    beta, gamma = (1 - am + af) ** 2 / 4, 0.5 - am + af
    penalty = 0.0 if multiplier else PENALTY
    inverse = np.linalg.inv((1 - am) * M + (1 - af) * beta * h**2 * K)
    reach = inverse[:, 0] * (1 - af)  # acceleration by a force at the wall
    u, a, force = np.zeros(len(K)), np.zeros(len(K)), 0.0
    v = -np.ones(len(K))
    before = energy(K, masses, u, v, penalty)

    for _ in range(int(np.ceil(3 * 2 * ELEMENTS / h))):
        guess_u = u + h * v + h**2 * (0.5 - beta) * a
        load = -am * masses * a - K @ ((1 - af) * guess_u + af * u)
        load[0] += af * force
        free = inverse @ load
        at_wall = guess_u[0] + beta * h**2 * free[0]
        moved = beta * h**2 * reach[0]  # displacement of the end by a unit force
        force = max(-at_wall / (moved if multiplier else moved + 1 / penalty), 0.0)

        new = free + reach * force
        u = guess_u + beta * h**2 * new
        v = v + h * ((1 - gamma) * a + gamma * new)
        a = new
    return energy(K, masses, u, v, penalty) / before


def central(h: float) -> float:
    """The same by central differences, the wall a penalty spring."""
    K, masses = matrices()
    u, v = np.zeros(len(K)), -np.ones(len(K))
    before = energy(K, masses, u, v, PENALTY)
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(int(np.ceil(3 * 2 * ELEMENTS / h))):
            force = -(K @ u)
            force[0] -= PENALTY * min(u[0], 0.0)
            v = v + h * force / masses
            u = u + h * v
        return energy(K, masses, u, v, PENALTY) / before


def reduced() -> ao.AntiOscillators:
    """The same rod in anti-oscillators."""
    K, masses = matrices()
    part = ao.Structure.from_matrices(csc_array(K), csc_array(np.diag(masses)))
    return ao.extract(part, ao.Site(dof=0), n=N)


def exact(model: ao.AntiOscillators, h: float) -> float:
    """The same by antiosc, the wall a penalty spring."""
    hit = ao.simulate(
        model, ao.Obstacle(), ao.Linear(PENALTY), 3 * 2 * ELEMENTS, step=h, initial_velocity=1.0
    )
    return float(hit.energy.total[-1] / hit.energy.total[0])


def survey() -> dict[str, Array]:
    """Energy after the blow over that before, of each integrator, at all steps."""
    model = reduced()
    found = {"antiosc, penalty": [exact(model, h) for h in STEPS]}
    found["central differences, penalty"] = [central(h) for h in STEPS]
    for rule in RULES:
        for word, multiplier in (("penalty", False), ("multiplier", True)):
            found[f"{rule}, {word}"] = [implicit(rule, h, multiplier) for h in STEPS]
    return {name: np.array(values) for name, values in found.items()}


def table(found: dict[str, Array]) -> str:
    """Energy at some steps, and the largest up to a step of one element."""
    heads = ["integrator, wall", *(f"{step:g}" for step in SHOWN), "largest up to 1"]
    lines = [heads, ["---"] * len(heads)]
    for name, values in found.items():
        shown = [values[step == STEPS][0] for step in SHOWN]
        cells = [*shown, values[STEPS <= 1.0].max()]
        lines.append([name, *(f"{c:.3f}" if c < 100 else "diverges" for c in cells)])
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def chart(found: dict[str, Array], path: Path) -> None:
    """Energy over steps."""
    figure, axes = plotting.panels(1, 2, size=(9, 4.2), sharey=True)
    for axis, word in zip(axes.ravel(), ("penalty", "multiplier"), strict=True):
        for name, values in found.items():
            rule, _, wall = name.partition(", ")
            if wall == word or rule == "antiosc":
                axis.plot(STEPS, np.fmin(values, 1e3), ".-", label=rule, color=COLOURS[rule])
        axis.axhline(1.0, color="0.6", lw=0.8)
        axis.set(
            xscale="log",
            yscale="log",
            ylim=(0.5, 30.0),
            xlabel="step (time of a wave along an element)",
        )
        axis.set_title(f"wall: {word}")
        axis.legend(fontsize=9)
    axes[0, 0].set_ylabel("energy after the blow / before")
    plotting.save_figure(figure, path, dpi=120)
