"""Struts, panels, a block as beam, shell, plane part and solid: which model is enough?

All are clamped at their ends and struck in the middle, by a large sphere or by a small one.
Printed for each model: dofs, seconds, compliance (a solid's without what its patch has of a
half-space), the first anti-oscillators, peak force, contact time, and the error of the force
history against the solid's. Then what `antiosc.strikes.advice` says from the dimensions alone.

    .venv/bin/python benchmarks/fidelity.py --help
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import dolfinx
import numpy as np
import options
from mpi4py import MPI

import antiosc as ao
from antiosc import plotting
from antiosc.fem.platform import compat
from antiosc.strikes.advice import advise

ROOT = Path(__file__).resolve().parent.parent
STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}


class Case(NamedTuple):
    """A clamped box, struck in the middle of its top by a steel sphere."""

    length: float
    width: float
    thickness: float
    radius: float
    velocity: float

    @property
    def size(self) -> tuple[float, float, float]:
        return self.length, self.width, self.thickness

    @property
    def sphere(self) -> ao.Sphere:
        return ao.Sphere(self.radius, **STEEL, velocity=self.velocity)


CASES = {
    "strut, large sphere": Case(0.30, 0.020, 0.010, 10e-3, 1.0),
    "strut, small sphere": Case(0.30, 0.020, 0.010, 2e-3, 2.0),
    "strip, large sphere": Case(0.30, 0.100, 0.006, 10e-3, 1.0),
    "panel, large sphere": Case(0.30, 0.200, 0.006, 10e-3, 1.0),
    "panel, small sphere": Case(0.30, 0.200, 0.006, 1.5e-3, 2.0),
    "block, large sphere": Case(0.15, 0.120, 0.040, 15e-3, 3.0),
}


def main(
    cases: tuple[str, ...] = tuple(CASES), n: int = 60, fine: float = 1.0, out: Path = ROOT / "out"
) -> dict[str, dict[str, Any]]:
    """Climb the ladder for each case; return {case: {family: numbers, "advice": …}}.

    Parameters
    ----------
    cases : names of CASES
    n : anti-oscillators
    fine : factor on the number of elements along every side, which are at least 2
    out : folder of the picture
    """
    results: dict[str, dict[str, Any]] = {}
    histories = {}
    for name in cases:
        case = CASES[name]
        results[name], histories[name] = climb(case, n, fine)
        advice = advise(case.size, case.sphere, **STEEL)
        results[name]["advice"] = advice
        print_table(name, case, results[name])
        print(f"  advice: {advice}\n")
    out.mkdir(parents=True, exist_ok=True)
    plot(histories, out / "fidelity.png")
    print(f"written to {out}: fidelity.png")
    return results


def climb(case: Case, n: int, fine: float) -> tuple[dict[str, Any], dict[str, ao.History]]:
    """(numbers, histories) of every family."""
    contact = case.sphere.hertz(STEEL["E"], STEEL["nu"])
    advice = advise(case.size, case.sphere, **STEEL)
    duration = 3 * advice.contact_time
    numbers, histories = {}, {}
    for family, build in FAMILIES.items():
        if family in ("beam", "plane") and case.width > 0.5 * case.length:
            continue
        started = time.perf_counter()
        part, site = build(case, fine)
        model = ao.extract(part, site, n=n)
        extracted = time.perf_counter() - started
        hit = histories[family] = ao.simulate(model, case.sphere, contact, duration=duration)
        numbers[family] = {
            "dofs": part.dofs,
            "seconds": extracted,
            "compliance": 1 / model.k0 - model.local_compliance,
            "m_st": model.m_st,
            "first": model.omega[:3] / (2 * np.pi),
            "peak_force": hit.peak_force,
            "contact_time": hit.contact_time,
            "restitution": hit.restitution,
        }
    times = np.linspace(0, duration, 2000)
    force = {f: np.interp(times, h.time, h.force) for f, h in histories.items()}
    for family, row in numbers.items():
        away = np.linalg.norm(force[family] - force["solid"])
        row["error"] = float(away / np.linalg.norm(force["solid"]))
    return numbers, histories


# --- the four models ----------------------------------------------------------------------------


def at_ends(length: float) -> ao.Support:
    """Everything held at both ends."""
    return ao.Support(lambda x: np.isclose(x[0], 0, atol=1e-9) | np.isclose(x[0], length))


def beam(case: Case, fine: float) -> tuple[ao.Structure, ao.Site]:
    """Timoshenko's beam on a line."""
    elements = max(2, 2 * round(20 * fine))  # even: a node in the middle
    x = np.column_stack([np.linspace(0, case.length, elements + 1), np.zeros(elements + 1)])
    cells = np.column_stack([np.arange(elements), np.arange(1, elements + 1)])
    mesh = ao.read_mesh(compat.create_mesh(MPI.COMM_WORLD, cells, x, "interval", 1))
    section = ao.Section.rectangle(width=case.width, height=case.thickness)
    part = ao.Structure(mesh, ao.Beam(**STEEL, section=section), [at_ends(case.length)])
    return part, ao.Site((case.length / 2, 0), (0, -1))


def shell(case: Case, fine: float) -> tuple[ao.Structure, ao.Site]:
    """Reissner–Mindlin's plate on the middle plane."""
    across = max(4, round(24 * case.width / case.length))
    cells = (round(28 * fine), round(across * fine))
    mesh = graded((case.length, case.width), cells, case.thickness / 2)
    material = ao.Shell(**STEEL, thickness=case.thickness)
    part = ao.Structure(ao.read_mesh(mesh), material, [at_ends(case.length)])
    return part, ao.Site((case.length / 2, case.width / 2, 0), (0, 0, -1))


def plane(case: Case, fine: float) -> tuple[ao.Structure, ao.Site]:
    """Plane stress in the side view; the load is a strip across the width."""
    cells = (round(40 * fine), round(6 * fine))
    mesh = graded((case.length, case.thickness), cells, patch(case) / 4, top=True)
    material = ao.Solid(**STEEL, plane="stress", thickness=case.width)
    part = ao.Structure(ao.read_mesh(mesh), material, [at_ends(case.length)])
    radius = patch(case)
    return part, ao.Site((case.length / 2, case.thickness), (0, -1), radius=radius)


def solid(case: Case, fine: float) -> tuple[ao.Structure, ao.Site]:
    """Quadratic hexahedra, small ones around the patch."""
    across = max(8, round(36 * case.width / case.length))
    along = (round(32 * fine), round(across * fine), round(4 * fine))
    mesh = graded(case.size, along, patch(case) / 4, top=True)
    part = ao.Structure(ao.read_mesh(mesh), ao.Solid(**STEEL), [at_ends(case.length)])
    x, y, z = case.length / 2, case.width / 2, case.thickness
    return part, ao.Site((x, y, z), (0, 0, -1), radius=patch(case))


FAMILIES = {"beam": beam, "shell": shell, "plane": plane, "solid": solid}


def patch(case: Case) -> float:
    """Radius over which a solid's site is averaged: above the contact's, below the thickness."""
    return case.thickness / 2


def graded(
    size: tuple[float, ...], cells: tuple[int, ...], smallest: float, top: bool = False
) -> dolfinx.mesh.Mesh:
    """A box of quadrilaterals or hexahedra, no larger than `smallest` (m) at its middle.

    `top`: in the last direction at the end instead. Away from there they grow by a power of the
    distance.
    """
    corners = [np.zeros(len(size)), np.ones(len(size))]
    numbers = [max(2, n + n % 2) for n in cells]
    if len(size) == 2:
        kind = dolfinx.mesh.CellType.quadrilateral
        mesh = dolfinx.mesh.create_rectangle(MPI.COMM_WORLD, corners, numbers, kind)
    else:
        kind = dolfinx.mesh.CellType.hexahedron
        mesh = dolfinx.mesh.create_box(MPI.COMM_WORLD, corners, numbers, kind)
    for axis, (extent, n) in enumerate(zip(size, numbers, strict=True)):
        s = mesh.geometry.x[:, axis]
        if top and axis == len(size) - 1:
            mesh.geometry.x[:, axis] = extent * (1 - (1 - s) ** power(smallest / extent, n))
        else:
            s = 2 * s - 1
            s = np.sign(s) * np.abs(s) ** power(2 * smallest / extent, n // 2)
            mesh.geometry.x[:, axis] = extent * (1 + s) / 2
    return mesh


def power(first: float, n: int) -> float:
    """Exponent with which the first of n steps to 1 is `first`, or all are equal and smaller."""
    return 1.0 if n == 1 or n * first >= 1 else float(np.log(first) / np.log(1 / n))


# --- output -------------------------------------------------------------------------------------


def print_table(name: str, case: Case, numbers: dict[str, Any]) -> None:
    """One line a family."""
    print(
        f"{name}: {1e3 * case.length:g} x {1e3 * case.width:g} x {1e3 * case.thickness:g} mm, "
        f"sphere of radius {1e3 * case.radius:g} mm at {case.velocity:g} m/s"
    )
    print(
        "  family    dofs      s  compliance (m/N)  m_st (kg)  first AOs (kHz)      "
        "peak (N)  contact (µs)  restitution  error"
    )
    for family in FAMILIES:
        if family not in numbers:
            continue
        row = numbers[family]
        first = " ".join(f"{1e-3 * f:6.3f}" for f in row["first"])
        print(
            f"  {family:7s} {row['dofs']:6d} {row['seconds']:6.1f} {row['compliance']:17.4g} "
            f"{row['m_st']:10.4f}  {first} {row['peak_force']:10.1f} "
            f"{1e6 * row['contact_time']:13.1f} {row['restitution']:12.3f} {row['error']:6.1%}"
        )


def plot(histories: dict[str, dict[str, ao.History]], path: Path) -> None:
    """The force of every family, a panel for each case."""
    figure, axes = plotting.panels(1, len(histories), size=(4 * len(histories), 3.6))
    for axis, (name, hits) in zip(axes[0], histories.items(), strict=True):
        plotting.plot_force(hits, axis).set_title(name)
    plotting.save_figure(figure, path, dpi=120)


def names(text: str) -> tuple[str, ...]:
    """Case names from a list separated by semicolons."""
    given = tuple(part.strip() for part in text.split(";"))
    unknown = [name for name in given if name not in CASES]
    if unknown:
        known = "; ".join(CASES)
        raise argparse.ArgumentTypeError(f"{unknown[0]!r} is none of the cases: {known}")
    return given


def command(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=names, default=tuple(CASES), help="a; b; …")
    parser.add_argument("--n", type=options.count, default=60, help="anti-oscillators")
    parser.add_argument("--fine", type=options.positive, default=1.0, help="factor on elements")
    parser.add_argument("--out", type=Path, default=ROOT / "out", help="folder of the picture")
    options.run(parser, main, arguments)


if __name__ == "__main__":
    command()
