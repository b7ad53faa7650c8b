"""Parts under load against closed forms, and the time that the load adds.

    OMP_NUM_THREADS=1 .venv/bin/python benchmarks/prestress.py [--write]

Each row builds the part without and with its load. The time added is that of the equilibrium, the
tangent, its factor and the reserve. `--write` puts the table into benchmarks/speed/prestress.md.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests" / "support"))

import antiosc as ao  # noqa: E402
from loaded_beams import EI, RHO, THIN_BEAM, UNIT, E, at_ends, at_root, beams  # noqa: E402
from loaded_parts import SIZE, THIN, WRIGHT, blade, drum, plate, ritz_drum  # noqa: E402
from parts import box  # noqa: E402

HEAD = """# Parts under load: error and time

Written by `make bench-prestress`: each part without and with its load, on one core. Added is what
the equilibrium, its tangent, the second factor and the reserve take. Wright's blades are slender
beams, of which solids of L/h = 50 are 0.1 % softer by shear; h is the thickness.

| part | load | dofs | result | known | antiosc | error | without load | added |
|---|---|---|---|---|---|---|---|---|
"""
Make = Callable[[bool], ao.Structure]
Quantity = Callable[[ao.Structure], float]


def row(
    name: str,
    load: str,
    make: Callable[[bool], ao.Structure],
    what: str,
    known: float,
    of: Quantity,
) -> str:
    """One line of the table; make(loaded) builds the part."""
    make(True)  # compiles its forms
    times = []
    for loaded in (False, True):
        start = time.perf_counter()
        part = make(loaded)
        part.factorize()
        times.append(time.perf_counter() - start)
    found = of(part)
    numbers = f"{known:.6g} | {found:.6g} | {found / known - 1:+.3%}"
    cost = f"{times[0]:.2f} s | {max(times[1] - times[0], 0.0):.2f} s"
    return f"| {name} | {load} | {part.size} | {what} | {numbers} | {cost} |"


def blades() -> list[str]:
    """Wright's table: the second flapping, which is further off than the first."""
    found = []
    for family, fine in (("beam", 1), ("quadrilateral", 1), ("solid", 1), ("solid", 3)):
        unit = blade(family, 0.0)[1]
        for speed, (_, flap) in WRIGHT.items():

            def nearest(part: Any, flap: float = flap, unit: float = unit) -> float:
                omega = part.natural_modes(6).omega / unit
                return float(omega[np.argmin(np.abs(omega - flap))])

            def make(loaded: bool, family: str = family, fine: int = fine, speed=speed):
                return blade(family, speed if loaded else 0.0, fine)[0]

            load = f"spin {speed} √(EI/mL⁴)"
            found.append(row(f"blade, {family}", load, make, "ω2/√(EI/mL⁴)", flap, nearest))
    return found


def beams_between_walls() -> list[str]:
    """ω² of pinned ends grows by the share N/N_E, N_E = π² EI/L²; 1e4 times is a string."""
    euler, found = np.pi**2 * EI, []
    pinned = ao.Support(at_ends, fix=("x", "y", "z", "rx"))
    for share in (-0.9, 0.1, 10.0, 1e4):

        def make(loaded: bool, share: float = share) -> ao.Structure:
            loads = ao.Prestress(tension={"all": share * euler}) if loaded else None
            return ao.Structure(beams(), THIN_BEAM, [pinned], prestress=loads)

        exact = np.pi**2 * UNIT * np.sqrt(1 + share) / (2 * np.pi)
        load = f"{share:g} Euler loads"
        found.append(row("beam, pinned", load, make, "f1 [Hz]", exact, first))
    return found


def first(part: ao.Structure) -> float:
    """The lowest natural frequency [Hz]."""
    return float(part.natural_modes(1).omega[0] / (2 * np.pi))


def others() -> list[str]:
    """Plates under an edge load, a column, a drum."""
    critical = 4 * np.pi**2 * E * THIN**3 / 12 / (1 - 0.3**2) / SIZE**2
    still = plate(0.0, "quadrilateral", False).natural_modes(1).omega[0] ** 2
    found = []
    for share in (3.0, -0.8):
        more = share * critical * np.pi**2 / (RHO * THIN * SIZE**2)
        exact = float(np.sqrt(still + more) / (2 * np.pi))

        def make(loaded: bool, share: float = share) -> ao.Structure:
            return plate(share * critical * SIZE if loaded else 0.0, "quadrilateral", False)

        found.append(row("plate, shell", f"{share:g} N_cr", make, "f1 [Hz]", exact, first))
    held, euler = [ao.Support(at_root)], np.pi**2 * E * 0.02**4 / 12 / 4

    def column(loaded: bool) -> ao.Structure:
        mesh = box((64, 4, 4), (1.0, 0.02, 0.02), groups={"tip": (2, lambda x: x[0] > 1 - 1e-9)})
        loads = ao.Prestress(force={"tip": (-0.5 * euler, 0, 0)}) if loaded else None
        return ao.Structure(mesh, ao.Solid(E, 0.0, RHO), held, prestress=loads)

    found.append(
        row("column, solid", "Euler/2", column, "reserve", 2.0, lambda part: part.prestress.reserve)
    )

    def drummed(loaded: bool) -> ao.Structure:
        return drum(2e4 if loaded else 0.0)

    def deflected(part: Any) -> float:
        return float(np.abs(part.prestress.displacement[:, 2]).max())

    deflection, omega = ritz_drum(2e4)
    pairs = ("deflection [m]", deflection, deflected), ("f1 [Hz]", omega / (2 * np.pi), first)
    for what, known, of in pairs:
        found.append(row("drum, shell", "20 kPa, 1.8 h", drummed, what, known, of))
    return found


def main() -> None:
    table = HEAD + "\n".join([*blades(), *beams_between_walls(), *others()]) + "\n"
    print(table)
    if "--write" in sys.argv:
        (ROOT / "benchmarks/speed/prestress.md").write_text(table, encoding="utf-8")


if __name__ == "__main__":
    main()
