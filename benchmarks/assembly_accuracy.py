"""Beam ends and shell edges on solids, against solids throughout: errors over the size of elements.

A bar of square section, half of it solid and half a beam (its end on `Rigid` or on `Mean`), and a
strip, half of it solid and half a shell (its edge on `Tie`), are clamped at the solid end and
pulled across at the other one. The script compares static stiffness and first frequency with those
of one solid with a finer mesh, and draws the errors beside those of solids with the same elements
throughout:

    .venv/bin/python benchmarks/assembly_accuracy.py --help
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import dolfinx
import numpy as np
import options
from mpi4py import MPI
from numpy.typing import NDArray

import antiosc as ao
from antiosc import plotting

Array = NDArray[np.float64]
ROOT = Path(__file__).resolve().parent.parent
E, NU, RHO = 70e9, 0.3, 2700.0
BAR, SIDE = 0.3, 0.02  # length and side of the bar, m
STRIP, WIDE, THICK = 0.2, 0.06, 0.01  # length, width and thickness of the strip, m
FINER = 2  # elements over the height of the reference more than in the finest joined structure
LEVELS = 3e-4, 1e-3, 3e-3  # marks of the axis of errors
#: structure -> (errors of k0, errors of the first frequency), one for each number of elements
Errors = dict[str, tuple[Array, Array]]


def main(most: int = 3, out: Path = ROOT / "out") -> tuple[Errors, Errors]:
    """Chart the errors of bar and strip with 1 to `most` elements over the height.

    Parameters
    ----------
    most : elements over the height of the finest joined structures
    out : folder of the picture
    """
    bar = errors(
        {
            "beam on Rigid": lambda n: bar_with_beam(n, ao.Rigid),
            "beam on Mean": lambda n: bar_with_beam(n, ao.Mean),
            "solid throughout": solid_bar,
        },
        solid_bar(most + FINER),
        most,
    )
    strip = errors(
        {"shell on Tie": strip_with_shell, "solid throughout": solid_strip},
        solid_strip(most + FINER),
        most,
    )
    print_table({**bar, **{f"strip: {name}": pair for name, pair in strip.items()}})
    out.mkdir(parents=True, exist_ok=True)
    plot(bar, strip, out / "assembly_accuracy.png")
    print(f"written to {out}: assembly_accuracy.png")
    return bar, strip


def errors(
    builds: Mapping[str, Callable[[int], ao.Structure]], reference: ao.Structure, most: int
) -> Errors:
    """Relative errors of static stiffness and first frequency of each structure."""
    exact = measured(reference)
    found = {}
    for name, build in builds.items():
        values = np.array([measured(build(n)) for n in range(1, most + 1)])
        stiffness, frequency = (values / exact - 1).T
        found[name] = stiffness, frequency
    return found


def measured(part: ao.Structure) -> tuple[float, float]:
    """Static stiffness (N/m) at the pulled end, and the first frequency (rad/s) in that plane."""
    model = ao.extract(part, ao.Site("hub", (0, 0, -1)), n=0)
    return model.k0, float(part.natural_modes(1).omega[0])


# -- the structures


def solid_bar(n: int) -> ao.Structure:
    """The bar as one solid with n × n elements over its section."""
    return pulled({"bar": solid((BAR, SIDE, SIDE), (14 * n, n, n))}, [ao.Mean("bar:x1", "hub")])


def bar_with_beam(n: int, joint: type[ao.Rigid] | type[ao.Mean]) -> ao.Structure:
    """The second half as a beam."""
    section = ao.Section.rectangle(SIDE, SIDE)
    points = [(x, SIDE / 2, SIDE / 2) for x in (BAR / 2, BAR)]
    axis = options.line(points[0], points[1], count=8)
    beam = ao.Structure(axis, ao.Beam(E, NU, RHO, section, orientation=(0, 0, 1)))
    root = solid((BAR / 2, SIDE, SIDE), (7 * n, n, n))
    ends = [("beam", point) for point in points]
    return pulled(
        {"root": root, "beam": beam}, [joint("root:x1", ends[0]), ao.Weld(ends[1], "hub")]
    )


def solid_strip(n: int) -> ao.Structure:
    """The strip as one solid with n elements over its thickness."""
    part = solid((STRIP, WIDE, THICK), (12 * n, 3 * n, n))
    return pulled({"strip": part}, [ao.Mean("strip:x1", "hub")])


def strip_with_shell(n: int) -> ao.Structure:
    """The second half as a shell."""
    corners = [np.zeros(2), np.array([STRIP / 2, WIDE])]
    flat = dolfinx.mesh.create_rectangle(MPI.COMM_SELF, corners, [6 * n, 4 * n])
    sheet = ao.Structure(ends_named(flat, STRIP / 2), ao.Shell(E, NU, RHO, THICK))
    root = solid((STRIP / 2, WIDE, THICK), (6 * n, 3 * n, n))
    joints = [ao.Tie("root:x1", "sheet:x0"), ao.Mean("sheet:x1", "hub")]
    return pulled({"root": root, "sheet": sheet}, joints, {"sheet": (STRIP / 2, 0.0, THICK / 2)})


def pulled(
    parts: Mapping[str, ao.Structure],
    joints: Sequence[ao.Mean | ao.Rigid | ao.Tie | ao.Weld],
    at: Mapping[str, Sequence[float]] | None = None,
) -> ao.Structure:
    """An assembly with the reference point "hub" at its end, symmetric about the middle plane."""
    strip = {"strip", "sheet"} & set(parts)
    end = (STRIP, WIDE / 2, THICK / 2) if strip else (BAR, SIDE / 2, SIDE / 2)
    middle = ao.Support(lambda x: np.isclose(x[1], end[1]), "y")
    return ao.assemble(parts, joints, at, points={"hub": end}, supports=[middle])


def solid(size: tuple[float, float, float], count: tuple[int, int, int]) -> ao.Structure:
    """A block of quadratic hexahedra, clamped at x = 0."""
    corners = [np.zeros(3), np.array(size)]
    kind = dolfinx.mesh.CellType.hexahedron
    mesh = ends_named(dolfinx.mesh.create_box(MPI.COMM_SELF, corners, count, kind), size[0])
    clamp = ao.Support(lambda x: np.isclose(x[0], 0.0))
    return ao.Structure(mesh, ao.Solid(E, NU, RHO), [clamp])


def ends_named(mesh: dolfinx.mesh.Mesh, length: float) -> ao.Mesh:
    """A mesh with groups "x0" and "x1" of its sides at x = 0 and x = `length`."""
    dim, groups = mesh.topology.dim - 1, {}
    for name, x in (("x0", 0.0), ("x1", length)):
        sides = dolfinx.mesh.locate_entities_boundary(mesh, dim, lambda p, x=x: np.isclose(p[0], x))
        ones = np.ones(len(sides), dtype=np.int32)
        groups[name] = dolfinx.mesh.meshtags(mesh, dim, np.sort(sides), ones), 1
    return ao.read_mesh(mesh, groups=groups)


# -- table and picture


def print_table(found: Errors) -> None:
    counts = range(1, len(next(iter(found.values()))[0]) + 1)
    print(f"{'errors of k0 and the first frequency':<40}" + "".join(f"{n:>20}" for n in counts))
    for name, (stiffness, frequency) in found.items():
        cells = (f"{k:>10.1e}{w:>10.1e}" for k, w in zip(stiffness, frequency, strict=True))
        print(f"{name:<40}" + "".join(cells))


def plot(bar: Errors, strip: Errors, path: Path) -> None:
    """Sizes of the errors over the size of elements, the height of the section being 1."""
    figure, axes = plotting.panels(2, 2, size=(9, 7), sharex=True, sharey=True)
    titles = "static stiffness", "first frequency"
    for row, (what, found) in enumerate((("bar", bar), ("strip", strip))):
        for column, title in enumerate(titles):
            ax = axes[row, column]
            for name, pair in found.items():
                size = 1 / np.arange(1, len(pair[column]) + 1)
                style = {"color": "0.6", "linestyle": "--"} if name.startswith("solid") else {}
                ax.loglog(size, np.abs(pair[column]), marker="o", label=name, **style)
            ax.set_title(f"{what}: {title}", fontsize=10)
            ax.grid(visible=True, which="major", alpha=0.3)
            ax.legend(fontsize=8, loc="upper left")
            if row:
                ax.set_xlabel("size of elements / height of the section")
            if not column:
                ax.set_ylabel("relative error")
    ticks = [1 / n for n in range(1, len(next(iter(bar.values()))[0]) + 1)]
    for ax in axes.ravel():
        ax.set_xticks(ticks, [f"1/{round(1 / t)}" if t < 1 else "1" for t in ticks])
        ax.minorticks_off()
        ax.set_yticks(LEVELS, [f"{level:.2%}" for level in LEVELS])
    plotting.save_figure(figure, path, dpi=110)


def command(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--most", type=options.count, default=3, help="elements over the height of the finest"
    )
    parser.add_argument("--out", type=Path, default=ROOT / "out")
    options.run(parser, main, arguments)


if __name__ == "__main__":
    command()
