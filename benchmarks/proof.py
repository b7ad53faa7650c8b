"""Whether proved bounds hold: random structures and impacts against every mode of the structure.

    python benchmarks/proof.py [--runs 300] [--largest 4000] [--seed 1] [--most 50] [--wrong NAME]

The structures are solids of hexahedra and beams of 200 to 4000 dofs, free or held, of random
stiffness, with Rayleigh's damping, one ratio of all modes or none; a rigid mass or another
structure strikes one site, or two masses strike two; the law is a power, or yields. The truth is
integrated here in all their modes, the force linear in steps of 1/40 000 of the run. With `--wrong`
the residual is made smaller than it is, and runs of few vectors (`--most 7`) fall outside.
"""

from __future__ import annotations

import argparse
import time
import warnings
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np
import scipy.linalg
import scipy.sparse as sp

import antiosc as ao
from antiosc.engine.contact.laws import yield_factor
from antiosc.errors import AntioscError
from antiosc.impact.enclosure import enclosures

STEPS = 40_000
#: csrc/laws.c: of the force and of what unloading recovers; behind it what an elastic side adds.
FITTED = (
    (
        (10.156065, -28.117782, 42.624046, -40.571769, 21.962204, -5.052764),
        (2.4294718, -3.6671647, -4.0542905, 9.392188, -4.1002046, 0.0),
    ),
    (
        (4.506655, -7.059605, 5.444735, -1.891785),
        (0.16412376, 3.3252718, -7.3789789, 3.8895833),
    ),
)
#: Error of the truth over the largest force, 1e-8 but for a touch between two of its steps.
SLACK = 1e-6


def hexahedron(sides, E, nu, rho):
    """Stiffness and mass (24, 24) of a linear brick."""
    corners = np.array(list(product((-1, 1), repeat=3)))
    mu, lam = E / 2 / (1 + nu), E * nu / (1 + nu) / (1 - 2 * nu)
    D = np.diag([2 * mu] * 3 + [mu] * 3)
    D[:3, :3] += lam
    K, M = np.zeros((24, 24)), np.zeros((24, 24))
    for point in corners / np.sqrt(3):
        factors = (1 + corners * point) / 2
        N = factors.prod(axis=1)
        others = [np.delete(factors, i, 1).prod(1) for i in range(3)]
        dN = [corners[:, i] / sides[i] * others[i] for i in range(3)]
        B = np.zeros((6, 24))
        for i in range(3):
            B[i, i::3] = dN[i]
            j, k = (i + 1) % 3, (i + 2) % 3
            B[3 + i, j::3], B[3 + i, k::3] = dN[k], dN[j]
        weight = np.prod(sides) / 8
        K += weight * B.T @ D @ B
        M += weight * rho * np.kron(np.outer(N, N), np.eye(3))
    return K, M


def solid(rng, dofs):
    """(K, M, loads of three patches) of a steel block, plate or lever of random stiffness."""
    shape = rng.uniform(0.15, 1.0, 3)
    cells = np.maximum(np.round(shape * (dofs / 3 / shape.prod()) ** (1 / 3)), 2).astype(int)
    sides = 0.01 * rng.uniform(0.5, 1.5, 3)
    Ke, Me = hexahedron(sides, 210e9, 0.3, 7850.0)
    number = np.arange((cells + 1).prod()).reshape(cells + 1)
    blocks = [
        number[tuple(slice(o, o + c) for o, c in zip(corner, cells, strict=True))].ravel()
        for corner in product((0, 1), repeat=3)
    ]
    nodes = np.stack(blocks, axis=1)
    dof = (3 * nodes[:, :, None] + np.arange(3)).reshape(len(nodes), 24)
    soft = rng.uniform(0.3, 1.0, len(nodes))
    place = np.repeat(dof, 24, 1).ravel(), np.tile(dof, (1, 24)).ravel()
    factors = (soft, Ke), (np.sqrt(soft), Me)
    K, M = (sp.csr_matrix(((w[:, None, None] * A).ravel(), place)) for w, A in factors)
    x = np.stack(np.unravel_index(np.arange(number.size), cells + 1), axis=1) * sides
    held = x[:, rng.integers(3)] == 0 if rng.random() < 0.6 else np.zeros(len(x), bool)
    top = np.isclose(x[:, 2], x[:, 2].max()) & ~held
    loads = []
    for centre in x[rng.choice(np.flatnonzero(top), 3)]:
        far = np.linalg.norm(x - centre, axis=1) / (1.6 * sides.max())
        weights = np.where(top, np.sqrt(np.clip(1 - far**2, 0, None)), 0.0)
        loads.append(np.kron(weights / weights.sum(), [0, 0, -1.0]))
    free = np.repeat(~held, 3)
    return K[free][:, free], M[free][:, free], [b[free] for b in loads]


def beam(rng, dofs):
    """(K, M, loads of three nodes) of a bending beam of random stiffness."""
    n, h = dofs // 2, 1.0 / (dofs // 2)
    EI, m = 10 ** rng.uniform(2, 5), 10 ** rng.uniform(-1, 1)
    scale = np.array([1, h, 1, h])
    bending = [[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]]
    inertia = [[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]]
    Ke = EI / h**3 * scale[:, None] * bending * scale
    Me = m * h / 420 * scale[:, None] * inertia * scale
    dof = 2 * np.arange(n)[:, None] + np.arange(4)
    place = np.repeat(dof, 4, 1).ravel(), np.tile(dof, (1, 4)).ravel()
    soft = rng.uniform(0.5, 1.0, n)
    K = sp.csr_matrix(((soft[:, None, None] * Ke).ravel(), place))
    M = sp.csr_matrix((np.tile(Me.ravel(), n), place))
    ends = [[0, 1], [0, 2 * n], [0, 1, 2 * n, 2 * n + 1], []][rng.integers(4)]
    kept = np.setdiff1d(np.arange(2 * n + 2), ends)
    loads = [np.eye(1, 2 * n + 2, 2 * i)[0][kept] for i in rng.integers(n // 10, n - 1, 3)]
    return K[kept][:, kept], M[kept][:, kept], loads


def after_a_step(omega, decay, h):
    """(J, 2, 4): q, v after a step by q, v before it, the modal force at its start and end."""
    A = np.zeros((omega.size, 4, 4))
    A[:, 0, 1] = A[:, 1, 2] = h
    A[:, 1, 0], A[:, 1, 1] = -h * omega**2, -2 * h * decay
    A[:, 2, 3] = 1  # the force in its own units, its change over the step
    steps = np.array([scipy.linalg.expm(each) for each in A])[:, :2]
    steps[:, :, 2] -= steps[:, :, 3]
    return steps


class Power:
    """F = k d^p of the whole indentation d."""

    def __init__(self, k, p):
        self.k, self.p = k, p

    def at(self, d):
        """Force and its slope."""
        root = self.k * d ** (self.p - 1)
        return root * d, self.p * root

    def press(self, d):
        """The law remembers nothing."""


class Yielding(Power):
    """A sphere that yields: its curves in the docstring of `ElasticPlastic`, fitted numbers."""

    def __init__(self, law):
        super().__init__(law.stiffness, 1.5)
        share = law.elastic_share**1.5
        self.y, self.deepest, self.back = law.yield_indentation, 0.0, None
        self.pressing, self.recovery = (
            [a + share * b for a, b in zip(*row, strict=True)] for row in FITTED
        )

    def first(self, d):
        """Force and slope of the first loading."""
        if d <= self.y:
            return super().at(d)
        s, top = (self.y / d) ** 0.25, self.k * self.y**1.5
        value = slope = 0.0
        for c in reversed(self.pressing):
            slope = slope * s + value
            value = value * s + c
        return top * d / self.y * value, top / self.y * (value - s * slope / 4)

    def at(self, d):
        if d >= self.deepest:
            return self.first(d)
        low, width, force, n = self.back
        z = max((d - low) / width, 0.0)
        return force * z**n, force * n / width * z ** (n - 1)

    def press(self, d):
        """Remember an indentation."""
        if d <= self.deepest:
            return
        s = min(self.y / d, 1.0) ** 0.25
        width = d if d <= self.y else d * s * s * sum(c * s**i for i, c in enumerate(self.recovery))
        n = 1.25 + 0.25 * s * s
        self.deepest, self.back = d, (d - width, width, self.first(d)[0], n)


def true_forces(omega, decay, beta, v, laws, c, duration):
    """Forces (m, steps) of the truth, of laws of the indentation and c F; beta (m, J)."""
    step = after_a_step(omega, decay, duration / STEPS)
    (C, S, first, last), (own, rate, kick, late) = step.transpose(1, 2, 0)
    one = np.eye(len(beta))
    give = (beta * last) @ beta.T - c * one
    q, F, force, forces = np.zeros_like(v), np.zeros(len(beta)), 0.0, [np.zeros(len(beta))]
    for _ in range(STEPS):
        free = C * q + S * v - first * (F @ beta)
        reach = beta @ free
        new = F
        for _ in range(60):
            gap = [max(d, 0.0) for d in reach - give @ new]
            values, slopes = np.transpose([law.at(d) for law, d in zip(laws, gap, strict=True)])
            change = np.linalg.solve(one + slopes[:, None] * give, new - values)
            new = np.maximum(new - change, 0.0)
            if np.abs(change).max() <= 1e-13 * force:
                break
        for law, d in zip(laws, gap, strict=True):
            law.press(d)
        v = own * q + rate * v - kick * (F @ beta) - late * (new @ beta)
        q = free - last * (new @ beta)
        F, force = new, max(force, new.max())
        forces.append(F)
    return np.array(forces).T


def random_damping(rng, contact):
    """A damping ratio and Rayleigh's, or none; ratios up to 5 % at the times of the contact."""
    ratio, alpha, tau = rng.choice([0, 1], 3, p=[0.6, 0.4]) * 10 ** rng.uniform(-3.5, -1.3, 3)
    return ao.Damping(ratio, alpha * 2 / contact, tau * contact / np.pi)


def scene(rng, most, one, other, beside):
    """(run, power of the law, duration, truth) of a random impact, and its kinds.

    one : (K, M, b, omega, UᵀB).
    `other` strikes in place of a rigid mass; `beside` is a second site, which another mass strikes.
    """
    K, M, b, omega, shares = one
    weight = M.diagonal().sum() / (3 if len(b) % 3 == 0 else 2)
    mass, speed = weight * 10 ** rng.uniform(-2.5, 0.5), 10 ** rng.uniform(-1, 0.5)
    p = rng.choice([1.5, 1.5, 1.0, rng.uniform(1.0, 2.5)])
    lowest = omega[omega > 0][0] / (2 * np.pi)
    contact = 10 ** rng.uniform(-1.7, 0.3) / lowest
    deep = speed * contact / 3
    k = mass * speed**2 / deep ** (p + 1)
    law = ao.Linear(k) if p == 1 else ao.Hertz(k) if p == 1.5 else ao.laws.Power(k, p)
    c = 0.0
    if p == 1.5 and rng.random() < 0.3:
        c = 0.2 * deep / (k * deep**1.5)
        law = ao.Hertz(k, c)
    if p == 1.5 and rng.random() < 0.5:  # from a hundredth of the depth on, or hardly
        radius, depth = 50 * deep, deep * 10 ** rng.uniform(-2.0, 0.3)
        modulus = 0.75 * k / np.sqrt(radius)
        strength = 2 * modulus / np.pi * np.sqrt(depth / radius) / yield_factor(0.3)
        share = float(rng.choice([0, 0.3, 0.6]))
        law = ao.ElasticPlastic(modulus, radius, strength, 0.3, share, compliance=c)
    laws = [Yielding(law) if isinstance(law, ao.ElasticPlastic) else Power(k, p) for _ in range(2)]
    n = int(rng.integers(3, most))
    damping = random_damping(rng, contact)
    options = {"n": n, "proof": True if rng.random() < 0.3 else contact, "damping": damping}
    duration = contact * rng.uniform(0.5, 3)
    kinds = f"{len(b)} dofs, {type(law).__name__}, n {n}"
    kinds += f", damping {damping.ratio:.1e} {damping.alpha:.1e} {damping.beta:.1e}"

    part = ao.Structure.from_matrices(K, M)
    decay = damping.decay(omega)
    root, none = np.array([np.sqrt(mass)]), np.zeros(1)
    body, mover = (omega, decay, -shares, 0 * omega), (none, none, 1 / root, speed * root)
    if beside is not None:
        sites = {"a": ao.Site(vector=b), "b": ao.Site(vector=beside[2])}
        bodies = {"part": ao.extract(part, sites, **options)}
        bodies |= {f"ball {name}": ao.RigidMass(mass, speed) for name in sites}
        contacts = [ao.Contact(f"part:{name}", f"ball {name}", law) for name in sites]
        sets = [np.concatenate([x, y, y]) for x, y in zip(body, mover, strict=True)]
        sets[2] = np.zeros((2, omega.size + 2))
        sets[2][:, :-2] = -shares, -beside[4]
        sets[2][:, -2:] = np.eye(2) / root
        truth = partial(true_forces, *sets, laws, c, duration)
        return bodies, contacts, p, duration, truth, kinds + ", two sites"

    model, rigid = ao.extract(part, ao.Site(vector=b), **options), ao.RigidMass(mass, speed)
    if other is not None:
        K2, M2, b2, omega2, shares2 = other
        second = ao.extract(ao.Structure.from_matrices(K2, M2), ao.Site(vector=b2), **options)
        rigid = ao.Impactor(second, speed)
        moved = np.where(omega2 == 0, shares2, 0.0)
        mover = omega2, damping.decay(omega2), shares2, speed * moved / (moved @ moved)
        kinds += ", two structures"
    sets = [np.concatenate(x) for x in zip(body, mover, strict=True)]
    sets[2] = sets[2][None]
    bodies = {"part": model, "ball": rigid}
    truth = partial(true_forces, *sets, laws[:1], c, duration)
    return bodies, [ao.Contact("part", "ball", law)], p, duration, truth, kinds


def spoiled(known, how):
    """The recurrence with a residual that is smaller than it is."""
    H = known.H.copy()
    if how == "coupling":
        H[known.n :, : known.n] *= 0.01
    else:
        H[known.n :, known.n :] *= 1e-4
    return replace(known, H=H)


def structures(rng, largest):
    """Random structures with all their modes, ten impacts on each; a free one for the impactor."""
    free = None
    while True:
        dofs = int(np.exp(rng.uniform(np.log(200), np.log(largest))))
        K, M, loads = (solid if rng.random() < 0.7 else beam)(rng, dofs)
        x, U = scipy.linalg.eigh(K.toarray(), M.toarray(), overwrite_a=True, overwrite_b=True)
        omega = np.sqrt(np.where(x > 1e-7 * x[8], x, 0.0))
        sites = [(K, M, b, omega, U.T @ b) for b in loads]
        if not omega[0]:
            free = sites[0]
        for _ in range(10):
            place = rng.integers(3)
            kind = rng.random()
            other = free if kind < 0.1 else None
            yield sites[place], other, sites[place - 1] if kind > 0.75 else None


def checked(blow, wrong):
    """(whether force, peak and impulse are inside, width of the peak, cost over the run's)."""
    bodies, contacts, p, duration, truth, _ = blow
    known = bodies["part"].recurrence
    if wrong and known is not None:  # without one it is refused
        bodies["part"] = replace(bodies["part"], recurrence=spoiled(known, wrong))
    start = time.process_time()
    hit = ao.Scene(bodies, contacts).run(duration)
    middle = time.process_time()
    found = enclosures(hit.assembly, hit.run)
    cost = (time.process_time() - middle) / (middle - start)

    inside, widths = True, []
    for bounds, forces in zip(found, truth(), strict=True):
        roots = np.interp(bounds.time, np.linspace(0, duration, STEPS + 1), forces ** (1 / p))
        F, peak = roots**p, forces.max()
        slack = SLACK * peak
        low, high = bounds.impulse
        impulse = duration / STEPS * (forces.sum() - forces[-1] / 2)
        inside &= np.all(bounds.lower - slack <= F) and np.all(bounds.upper + slack >= F)
        inside &= bounds.peak[0] - slack <= peak <= bounds.peak[1] + slack
        inside &= low - SLACK * impulse <= impulse <= high + SLACK * impulse
        widths.append((bounds.peak[1] - bounds.peak[0]) / peak)
    return bool(inside), max(widths), cost


def main():
    parser = argparse.ArgumentParser()
    for name, value in (("runs", 300), ("largest", 4000), ("seed", 1), ("most", 50)):
        parser.add_argument(f"--{name}", type=int, default=value)
    parser.add_argument("--wrong", choices=["coupling", "inertia"])
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    warnings.simplefilter("ignore")

    rows = []
    refused = 0
    for places in structures(rng, arguments.largest):
        try:
            blow = scene(rng, arguments.most, *places)
            rows.append(checked(blow, arguments.wrong))
        except AntioscError as error:
            refused += 1
            print("refused:", error)
            continue
        inside, width, _ = rows[-1]
        told = "inside" if inside else "OUTSIDE"
        print(f"{len(rows)}: {blow[-1]}: {100 * width:.3g} %, {told}", flush=True)
        if len(rows) == arguments.runs:
            break

    inside, widths, costs = np.array(rows, float).T
    print(f"{inside.sum():.0f} of {len(rows)} inside their bounds, {refused} refused")
    print(f"width of the peak, quartiles: {np.percentile(100 * widths, [25, 50, 75]).round(2)} %")
    half, most, all_of_them = np.percentile(costs, [50, 90, 100])
    print(
        f"time of the bounds over that of the run: median {half:.2f}, nine in ten at most"
        f" {most:.2f}, all at most {all_of_them:.2f}"
    )


if __name__ == "__main__":
    main()
