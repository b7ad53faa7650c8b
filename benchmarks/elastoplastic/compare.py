"""Laws of contact that yields against the finite elements of small_strain.csv.

Prints, for each case and depth, by how much forces at equal indentation, restitution and dents are
off; then other laws against the rigid sphere.

    python benchmarks/elastoplastic/compare.py
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from curves import Curves, curves
from truth import CASES

import antiosc as ao

LAW = ao.ElasticPlastic(modulus=1e11, radius=0.01, yield_strength=3e8)
DEPTHS = (1.5, 2, 3, 6, 10, 30, 60, 100, 300, 1000)


def law_of(name: str) -> ao.ElasticPlastic:
    """The law of a case, as `contact="auto"` would take it."""
    case = CASES[name]
    share = 1 - (1 - case.nu**2) * case.modulus if case.sphere else 0.0
    return replace(LAW, elastic_share=share)


def measured(law: ao.Hysteretic, x: float) -> tuple[float, float, float]:
    """Force over that at yield, restitution and dent over the depth of a law, at x."""
    depth = x * LAW.yield_indentation
    state = law.advance(depth, 0.0, law.touch(1.0))
    back = law.energy(depth, state) / law.loading_work(depth)
    return law.force(depth, 0.0, state) / LAW.yield_force, back**0.5, law.permanent(depth) / depth


def differences(law: ao.Hysteretic, of: Curves, x: float) -> np.ndarray:
    """Relative of force; of restitution; of the dent over the depth."""
    force, restitution, dent = measured(law, x)
    true = float(of.force(np.array(x)))
    return np.array([force / true - 1, restitution - of.restitution(x), dent - of.dent(x) / x])


def jackson_green(x: float, nu: float = 0.3, strain: float = 1e-3) -> float:
    """F/F_y; R. L. Jackson, I. Green, J. Tribology 127 (2005) 343-354, from memory."""
    factor = 1.295 * np.exp(0.736 * nu)
    critical = (np.pi * factor * strain / 2) ** 2
    start = (np.pi * 1.6128 * strain / 2) ** 2
    w = x * start / critical
    radius = np.pi * factor * strain / 2 * w**0.5 * (w / 1.9) ** (0.07 * np.exp(23 * strain))
    hardness = 2.84 * (1 - np.exp(-0.82 * radius**-0.7))
    elastic = np.exp(-(w ** (5 / 12)) / 4) * w**1.5
    plastic = 4 * hardness / factor * (1 - np.exp(-(w ** (5 / 9)) / 25)) * w
    return float((elastic + plastic if w > 1.9 else w**1.5) * (critical / start) ** 1.5)


def kogut_etsion(x: float) -> float:
    """F/F_y; L. Kogut, I. Etsion, J. Appl. Mech. 69 (2002) 657-662, from memory."""
    return float(x**1.5 if x < 1 else 1.03 * x**1.425 if x < 6 else 1.4 * x**1.263)


def others(of: Curves) -> None:
    k, y, sides = LAW.stiffness, LAW.yield_indentation, (LAW.modulus, LAW.radius)
    laws = {
        "Thornton, 1.6 Y": ao.Thornton(k, y),
        "Thornton, 2.8 Y": ao.Thornton.from_material(*sides, 2.8 * LAW.yield_strength),
    }
    shown = (3.0, 10.0, 30.0, 100.0, 300.0)
    for name, law in laws.items():
        rows = [differences(law, of, x) for x in shown]
        print(name, *(f"{100 * row[0]:+.0f} % e {row[1]:+.2f};" for row in rows))
    forces = {
        "Hertz": lambda x: x**1.5,
        "Jackson-Green": jackson_green,
        "Kogut-Etsion": kogut_etsion,
    }
    for name, force in forces.items():
        off = (force(x) / float(of.force(np.array(x))) - 1 for x in shown)
        print(name, *(f"{100 * one:+.1f} %;" for one in off))


def main() -> None:
    known = curves()
    for name, of in known.items():
        for x in DEPTHS:
            if x in of.unloading:
                force, restitution, dent = differences(law_of(name), of, x)
                print(
                    f"{name:20} {x:6g} {100 * force:+.1f} % e {restitution:+.3f} dent {dent:+.3f}"
                )
    others(known["rigid"])


if __name__ == "__main__":
    main()
