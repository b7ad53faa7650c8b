"""Blows between metals through `simulate`: `contact="auto"` against finite elements as the law.

Twelve pairs of materials, three speeds, two radii; a ball on a heavy body. The truth is a table of
small_strain.csv: forces interpolated between its cases by the share of the elastic side and, as
factors, by Poisson's ratio; unloading from the depth that is reached. It is perfectly plastic, or
hardens by E/50. Yield strengths count as exact, so that the row "law" has no range of them.

    python benchmarks/elastoplastic/pairs.py
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from curves import Curves, curves
from truth import CASES

import antiosc as ao
from antiosc.engine.contact.choice import choose
from antiosc.engine.contact.surfaces import Matter, Surface, ball, matter_of

PAIRS = (
    ("aluminium 6061-T6", "100Cr6"), ("aluminium 2024-T3", "glass, soda-lime"),
    ("aluminium 7075-T6", "100Cr6"), ("steel S235", "100Cr6"), ("steel S355", "alumina"),
    ("stainless steel 1.4301", "100Cr6"), ("titanium Ti-6Al-4V", "100Cr6"),
    ("copper C11000 cold", "100Cr6"), ("brass C26000 cold", "alumina"),
    ("zinc Zamak 3", "100Cr6"), ("steel S235", "steel S235"), ("steel S355", "6061"),
)  # fmt: skip
SPEEDS, RADII = (0.1, 1.0, 4.0), (0.002, 0.010)
#: Cases of an elastic side by its share, and of Poisson's ratio.
SIDES = ("rigid", "steel on aluminium", "alike", "soft sphere")
RATIOS = {0.2: "nu 0.2", 0.3: "rigid", 0.4: "nu 0.4", 0.45: "nu 0.45"}
HARD = ("hardening", "hardening alike")
LAST, POINTS = 300.0, 400
#: Tables end this much beyond the depth that is reached.
AND_MORE = 1.03
#: Errors of the runs, where nothing yields.
NUMERICAL = 1e-4


def share_of(name: str) -> float:
    """The share of the flexibility of the side that stays elastic in a case."""
    case = CASES[name]
    return float(1 - (1 - case.nu**2) * case.modulus) if case.sphere else 0.0


@dataclass
class Truth:
    """Finite elements between their cases."""

    known: dict[str, Curves]
    share: float
    nu: float
    hardens: bool = False

    def between(self, take: dict[str, np.ndarray]) -> np.ndarray:
        """Numbers of the cases at this share and Poisson's ratio."""
        names = HARD if self.hardens else SIDES
        shares = np.array([share_of(name) for name in names])
        base = interpolated(self.share, shares, [take[name] for name in names])
        factors = [take[name] / take["rigid"] for name in RATIOS.values()]
        return np.asarray(base * interpolated(self.nu, np.array(list(RATIOS)), factors))

    def law(self, law: ao.ElasticPlastic, top: float) -> ao.Tabulated:
        """A table of the force up to x = top, and of unloading from there."""
        x = np.geomspace(1e-3, top, POINTS)
        force = self.between({name: of.force(x) for name, of in self.known.items()})
        z, back, dent = np.linspace(0.0, 1.0, 60), {}, {}
        for name, of in self.known.items():
            back[name], dent[name] = unloading(of, top, z)
        shape = np.maximum.accumulate(self.between({n: b + 1e-9 for n, b in back.items()}))
        low = top - self.between(dent)
        points = low + (top - low) * z
        shape = (shape - shape[0]) / (shape[-1] - shape[0])
        rising = np.append(True, np.diff(shape) > 1e-6)
        y, F = law.yield_indentation, law.yield_force
        unload = points[rising] * y, shape[rising] * force[-1] * F
        return ao.Tabulated(np.append(0, x) * y, np.append(0, force) * F, unload)


def interpolated(at: float, places: np.ndarray, values: list[np.ndarray]) -> np.ndarray:
    """Linear between places, the last ones beyond."""
    i = int(np.clip(np.searchsorted(places, at) - 1, 0, len(places) - 2))
    t = float(np.clip((at - places[i]) / (places[i + 1] - places[i]), 0.0, 1.0))
    return (1 - t) * values[i] + t * values[i + 1]


def unloading(of: Curves, top: float, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """F/F_top at shares z of what comes back, and how much comes back, from x = top."""
    tops = np.array(sorted(of.unloading))
    rows, backs = [], []
    for each in tops:
        x, force = of.unload(each)
        rows.append(np.interp(z, (x - x[0]) / (x[-1] - x[0]), force / force[-1]))
        backs.append(np.array((x[-1] - x[0]) / x[-1]))
    at = float(np.clip(top, tops[0], tops[-1]))
    row, back = (interpolated(np.log(at), np.log(tops), each) for each in (rows, backs))
    return row, back * top


def sure(name: str) -> Matter:
    """A material whose yield strength is exact."""
    found = matter_of(name)
    assert found is not None
    return replace(found, yield_range=None, rate=None)


def truths(struck: Matter, striker: Matter, law: ao.ElasticPlastic) -> list[tuple[float, bool]]:
    """Shares of the elastic side that may be meant, each without hardening and with it."""
    choice = choose(Surface(struck), ball(striker, 0.01))
    shares = choice.shares or (law.elastic_share,)
    return [(share, hardens) for share in shares for hardens in (False, True)]


def main() -> None:
    known, rows = curves(), []
    for one, other in PAIRS:
        struck, striker = sure(one), sure(other)
        surface = Surface(struck).as_dict()
        for radius in RADII:
            for speed in SPEEDS:
                mass = 4 / 3 * np.pi * radius**3 * 7800
                model = ao.AntiOscillators(
                    m0=2000 * mass, k0=1.0, m=[], omega=[], strain_error=np.zeros((1, 1)),
                    info={"surfaces": {"": surface}},
                )  # fmt: skip
                hitter = ao.RigidMass(mass, speed, tip_radius=radius, material=striker)
                hit = ao.simulate(model, hitter, duration=0.5 * radius, tol=1e-5)
                assert isinstance(hit.law, ao.ElasticPlastic)
                rows += compared(known, hit, truths(struck, striker, hit.law), (one, other))
    told(rows)


def compared(
    known: dict[str, Curves], hit: ao.History, cases: list[tuple[float, bool]], names: object
) -> list[tuple[float, ...]]:
    """For each truth: x, hardening, errors of peak and restitution, the row "law"."""
    law, found = hit.law, []
    row = hit.error_budget["peak_force"].law
    for share, hardens in cases:
        truth = Truth(known, share, law.nu, hardens)
        top = hit.deepest / law.yield_indentation
        for _ in range(3):
            if top > LAST:
                break
            again = ao.simulate(
                hit.model,
                hit.impactor,
                truth.law(law, AND_MORE * top),
                duration=hit.time[-1],
                tol=1e-5,
            )
            top = min(again.deepest / law.yield_indentation, 2 * LAST)
        else:
            off = hit.peak_force / again.peak_force - 1, hit.restitution - again.restitution
            found.append((top, hardens, *off, row))
            print(
                *names, f"R {1e3 * hit.impactor.tip_radius:g} mm, {hit.impactor.velocity:g} m/s:",
                f"x {top:.3g}, share {share:.2f}{', hardening' if hardens else ''}:",
                f"peak {100 * off[0]:+.1f} %, e {off[1]:+.3f}, row {100 * row:.1f} %",
            )  # fmt: skip
    return found


def told(rows: list[tuple[float, ...]]) -> None:
    x, hardens, peak, e, row = np.array(rows, dtype=float).T
    holds = np.abs(peak) <= row + NUMERICAL
    for name, which in (("perfectly plastic", hardens == 0), ("hardening E/50", hardens == 1)):
        print(
            f"{name}: {which.sum()} blows to x = {x[which].max():.3g}; peak within"
            f" {100 * np.abs(peak[which]).max():.1f} %, e within {np.abs(e[which]).max():.3f};"
            f" the row contains the truth in {100 * np.mean(holds[which]):.1f} %"
        )


if __name__ == "__main__":
    main()
