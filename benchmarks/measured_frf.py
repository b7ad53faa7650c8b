"""How near to the truth impacts on models from measured frequency responses are.

Random bars (Timoshenko), plates (Kirchhoff, supported) and solids (blocks of linear hexahedra) with
random modal damping are struck by random masses with Hertz's law. Their accelerance at the struck
point, with 1 % and 5 % noise, goes through `from_frf`; the same impact on the model is compared
with that on the part with all its modes. Printed for each kind and noise: the difference of the
force histories (L2), and how many of the errors of peak force, impulse and contact time the bars
hold.

    .venv/bin/python benchmarks/measured_frf.py --help
"""

from __future__ import annotations

import argparse
import json
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.linalg

import antiosc as ao
from antiosc.base._types import Array
from antiosc.impact.error_budget import pulse_time
from antiosc.impact.histories.bars import QUANTITIES
from antiosc.models.body import Body, ModalModel
from antiosc.models.closed_form import StruckBeam, UniformBeam

#: Steel.
E, NU, RHO = 210e9, 0.3, 7850.0
#: Frequency lines of a measurement.
LINES = 800
#: Band times the time of the pulse, from and to: where bars, solids and plates are compared with
#: the aims, and a low band.
PRODUCTS = {"bar": (1.0, 3.0), "solid": (1.0, 3.0), "plate": (2.0, 4.0)}
LOW = (0.3, 1.0)
#: Aims of L2 at 1 % and 5 % noise.
AIMS = {"bar": (0.005, 0.02), "solid": (0.005, 0.02), "plate": (0.02, 0.02)}

PAGE = """# Models from measured frequency responses

Written by `benchmarks/measured_frf.py`. {count} random parts; the band times the time of the pulse
is 1 to 3 (plates 2 to 4), in the rows "low" 0.3 to 1. The time of the pulse is that of a half-sine
whose spectrum reaches as far. "L2" is the relative difference of the force histories; "held" the
share of the errors of peak force, impulse and contact time that are within their bars; "said" the
share of the impacts with an error above its bar in which a warning says that the band is low; "bar
over error" the median for the peak force.

{table}

{together}

Not passive, of {passive} models at 2000 frequencies from 0 to 100 times the band: {active}.
"""


def bar(random: np.random.Generator) -> tuple[Array, Array, float]:
    """Frequencies, displacements of the site and mass of a random bar."""
    h = random.uniform(0.01, 0.03)
    L, width = h * random.uniform(12, 40), h * random.uniform(0.7, 2)
    beam = UniformBeam.timoshenko(
        E=E, nu=NU, rho=RHO, area=width * h, inertia=width * h**3 / 12, length=L
    )
    ends = [("clamped", "free"), ("pinned", "pinned"), ("clamped", "clamped"), ("free", "free")]
    left, right = ends[random.integers(4)]
    modes = StruckBeam(beam, left, right, random.uniform(0.1, 0.9) * L).modes(80, [0.5 * L]).modal()
    return modes.omega, modes.b, RHO * width * h * L


def plate(random: np.random.Generator) -> tuple[Array, Array, float]:
    """The same of a plate that is supported along its edges."""
    a, t = random.uniform(0.15, 0.4), random.uniform(0.004, 0.008)
    c = a * random.uniform(0.6, 1)
    mass = RHO * t * a * c
    k, m = np.meshgrid(np.arange(1, 61), np.arange(1, 61))
    bending = np.sqrt(E * t**2 / 12 / (1 - NU**2) / RHO)
    omega = (np.pi**2 * ((k / a) ** 2 + (m / c) ** 2) * bending).ravel()
    x, y = random.uniform(0.15, 0.5, 2)
    b = (2 * np.sin(k * np.pi * x) * np.sin(m * np.pi * y) / np.sqrt(mass)).ravel()
    order = np.argsort(omega)[:1500]
    return omega[order], b[order], mass


def solid(random: np.random.Generator) -> tuple[Array, Array, float]:
    """The same of a free block, struck at a node of its upper side."""
    n = np.array([6, 4, 3])
    size = random.uniform(0.03, 0.1) * np.array(
        [2.0, random.uniform(0.7, 1.5), random.uniform(0.4, 1)]
    )
    K, M, x = block(n, size / n)
    top = np.flatnonzero(np.isclose(x[:, 2], size[2]))
    site = 3 * int(random.choice(top)) + 2
    x2, shapes = scipy.linalg.eigh(K, M)
    omega = np.sqrt(np.maximum(x2, 0.0))
    omega[:6] = 0.0
    return omega, shapes[site], RHO * float(np.prod(size))


def block(n: Array, h: Array) -> tuple[Array, Array, Array]:
    """K, M (dense) and nodes of n (3,) linear hexahedra of the sides h (3,)."""
    corner = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    lam, mu = E * NU / (1 + NU) / (1 - 2 * NU), E / 2 / (1 + NU)
    C = np.diag([2 * mu] * 3 + [mu] * 3)
    C[:3, :3] += lam
    Ke, Me = np.zeros((24, 24)), np.zeros((8, 8))
    gauss = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3)
    for point in np.array(np.meshgrid(gauss, gauss, gauss)).reshape(3, -1).T:
        one = np.where(corner == 1, point, 1 - point)
        N = np.prod(one, axis=1)
        slope = np.where(corner == 1, 1.0, -1.0) / h
        dN = np.stack([slope[:, i] * np.prod(np.delete(one, i, 1), axis=1) for i in range(3)])
        B = np.zeros((6, 24))
        for row, (i, j) in enumerate([(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)]):
            B[row, i::3] += dN[j]
            if i != j:
                B[row, j::3] += dN[i]
        Ke += B.T @ C @ B * np.prod(h) / 8
        Me += RHO * np.outer(N, N) * np.prod(h) / 8
    size = n + 1
    x = np.array(
        [[i, j, k] for i in range(size[0]) for j in range(size[1]) for k in range(size[2])]
    )
    number = np.arange(len(x)).reshape(size)
    K, M = np.zeros((3 * len(x), 3 * len(x))), np.zeros((3 * len(x), 3 * len(x)))
    for cell in np.ndindex(*n):
        nodes = number[tuple((np.array(cell) + corner).T)]
        dofs = (3 * nodes[:, None] + np.arange(3)).ravel()
        K[np.ix_(dofs, dofs)] += Ke
        M[np.ix_(dofs, dofs)] += np.kron(Me, np.eye(3))
    return K, M, x * h


KINDS: dict[str, Callable[[np.random.Generator], tuple[Array, Array, float]]] = {
    "bar": bar, "plate": plate, "solid": solid
}  # fmt: skip


def blow(part: Body, mass: float, random: np.random.Generator) -> tuple[ao.History, Any, Any]:
    """An impact that ends well before the run does; impactor and law."""
    while True:
        impactor = ao.RigidMass(mass * random.uniform(0.02, 0.3), random.uniform(0.5, 2))
        law = ao.Hertz(10 ** random.uniform(8, 10))
        duration = 1e-4
        for _ in range(12):
            hit = ao.simulate(part, impactor, law, duration, tol=1e-5)
            if hit.contacts and hit.status == 0 and hit.contact_time < 0.6 * duration:
                return hit, impactor, law
            duration *= 1.6


@dataclass(frozen=True, eq=False)
class Blow:
    """A part with all its modes, and an impact on it."""

    omega: Array
    part: ModalModel
    hit: ao.History
    impactor: ao.RigidMass
    law: ao.Hertz


def struck(kind: str, seed: int) -> Blow:
    """A random part, and its blow."""
    random = np.random.default_rng(seed)
    omega, b, mass = KINDS[kind](random)
    zeta = np.exp(random.normal(np.log(random.uniform(0.002, 0.015)), 0.4, omega.size))
    part = ModalModel(ao.ModalBody(omega, b, decay=zeta * omega))
    return Blow(omega, part, *blow(part, mass, random))


def measured(kind: str, one: Blow, noise: float, seed: int, low: bool) -> dict[str, Any]:
    """The same blow on the model of a measurement of the part."""
    random = np.random.default_rng([seed, round(1000 * noise), low])
    omega, part, hit = one.omega, one.part, one.hit
    pulse = pulse_time(hit)
    product = random.uniform(*(LOW if low else PRODUCTS[kind]))
    f = product / pulse * np.arange(1, LINES + 1) / LINES
    H = part.modal().receptance(2 * np.pi * f) * -((2 * np.pi * f) ** 2)
    H = H * (1 + noise * (random.standard_normal((2, LINES)).T @ [1, 1j]) / np.sqrt(2))
    start = time.process_time()
    model = ao.from_frf(ao.FRF(f, H, "accelerance"))
    seconds = time.process_time() - start
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        other = ao.simulate(model, one.impactor, one.law, float(hit.time[-1]), tol=1e-5)
    t = np.linspace(0, 0.999 * float(hit.time[-1]), 4000)
    force, again = hit.force_at(t), other.force_at(t)
    budget = other.error_budget
    w = np.append(0.0, np.geomspace(1e-3, 100.0, 2000)) * 2 * np.pi * f[-1]
    power = (1j * w * model.modal().receptance(w + (w == 0) * w[1])).real
    return {
        "kind": kind, "noise": noise, "seed": seed, "low": low, "product": product,
        "modes": int(np.sum((omega > 0) & (omega < 2 * np.pi * f[-1]))), "seconds": seconds,
        "L2": float(np.linalg.norm(again - force) / np.linalg.norm(force)),
        "errors": [getattr(other, q) / getattr(hit, q) - 1 for q in QUANTITIES],
        "noise_bar": [budget[q].noise for q in QUANTITIES],
        "band_bar": [budget[q].band for q in QUANTITIES],
        "bars": [budget[q].total for q in QUANTITIES],
        "said": any("half-sine" in str(one.message) for one in told),
        "passive": bool(power.min() >= -1e-9 * power.max()),
    }  # fmt: skip


def row(name: str, cases: list[dict[str, Any]]) -> str:
    """A line of the table."""
    L2 = np.array([case["L2"] for case in cases])
    errors, bars = (np.abs([case[key] for case in cases]) for key in ("errors", "bars"))
    beyond = [c for c, bad in zip(cases, np.any(errors > bars, axis=1), strict=True) if bad]
    said = f"{np.mean([c['said'] for c in beyond]):.0%} of {len(beyond)}" if beyond else "–"
    aims = [AIMS[c["kind"]][c["noise"] > 0.03] for c in cases]
    ratio = np.median(bars[:, 0] / np.maximum(errors[:, 0], 1e-9))
    seconds = np.median([c["seconds"] for c in cases])
    return (
        f"| {name} | {len(cases)} | {np.median(L2):.2%} | {np.quantile(L2, 0.9):.2%} |"
        f" {np.mean(aims >= L2):.0%} | {np.mean(errors <= bars):.0%} | {ratio:.2g} | {said} |"
        f" {seconds:.1f} |"
    )


def main(
    parts: int = 100,
    kinds: Sequence[str] = tuple(KINDS),
    page: str = "",
    log: str = "",
    first: int = 0,
) -> list[dict[str, Any]]:
    """The parts of each kind at both noises, and one in ten with a low band too.

    Parameters
    ----------
    parts : of each kind
    kinds : of parts
    page : Markdown to write
    log : JSON lines; the parts in it are not tried again, other cases are appended
    first : seed of the first part of each kind
    """
    warnings.simplefilter("ignore", ao.AntioscWarning)
    known = Path(log).read_text().splitlines() if log and Path(log).exists() else []
    cases = [json.loads(line) for line in known]
    ready = {(case["kind"], case["seed"]) for case in cases}
    for seed in range(first, first + parts):
        for kind in kinds:
            if (kind, seed) in ready:
                continue
            one = struck(kind, seed)
            for noise in (0.01, 0.05):
                for low in (False, True)[: 1 + (seed % 10 == 0)]:
                    case = measured(kind, one, noise, seed, low)
                    cases.append(case)
                    if log:
                        with Path(log).open("a") as file:
                            file.write(json.dumps(case) + "\n")
    text = told(cases)
    print(text)
    if page:
        Path(page).write_text(text, encoding="utf-8")
    return cases


def together(cases: list[dict[str, Any]]) -> str:
    """A sentence on all impacts but those of a low band, and one on these."""
    found = []
    for low, name in ((False, "With the band that is asked for"), (True, "With a low band")):
        some = [case for case in cases if case["low"] == low]
        aims = sum(case["L2"] <= AIMS[case["kind"]][case["noise"] > 0.03] for case in some)
        held = np.array([np.less_equal(np.abs(c["errors"]), c["bars"]) for c in some])
        beyond = [case for case, own in zip(some, held, strict=True) if not own.all()]
        found.append(
            f"{name}: L2 within the aim in {aims} of {len(some)} impacts, {held.sum()} of"
            f" {held.size} errors within their bars"
            + (
                f"; a warning in {sum(case['said'] for case in beyond)} of the {len(beyond)}"
                " impacts with an error above its bar."
                if low
                else "."
            )
        )
    return "\n".join(found)


def told(cases: list[dict[str, Any]]) -> str:
    """The page."""
    head = (
        "| parts | impacts | L2, median | L2, 90 % | within the aim | held | bar over error |"
        " said | s a fit |\n|---|---|---|---|---|---|---|---|---|"
    )
    groups: dict[tuple[bool, str, float], list[dict[str, Any]]] = {}
    for case in cases:
        groups.setdefault((case["low"], case["kind"], case["noise"]), []).append(case)
    rows = [
        row(f"{kind}, {noise:.0%}{', low' * low}", part)
        for (low, kind, noise), part in sorted(groups.items())
    ]
    return PAGE.format(
        count=len({(case["kind"], case["seed"]) for case in cases}),
        table="\n".join([head, *rows]),
        together=together(cases),
        passive=len(cases),
        active=sum(not case["passive"] for case in cases),
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--parts", type=int, default=100, help="of each kind")
    parser.add_argument("--page", default="", help="Markdown to write")
    parser.add_argument(
        "--log", default="", help="JSON lines: cases that are known, and to append to"
    )
    parser.add_argument("--first", type=int, default=0, help="seed of the first part of each kind")
    given = parser.parse_args()
    main(given.parts, page=given.page, log=given.log, first=given.first)
