"""NAFEMS's benchmarks of natural frequencies: beams, membranes, plates, solids.

The frequencies are those of `superposition` at a site that all the modes move; a repeated
frequency counts once there.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from case import Case, Known, Row, drawing
from lines import line

import antiosc as ao

STEEL: dict[str, Any] = {"E": 200e9, "nu": 0.3, "rho": 8000.0}


def meshed(text: str, **options: Any) -> ao.Mesh:
    """The mesh of a .geo script."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "part.geo"
        path.write_text(text, encoding="ascii")
        return ao.read_mesh(path, **options)


def quadrilateral(corners: list[tuple[float, float]], cells: tuple[int, int]) -> str:
    """A .geo script of a plane quadrilateral in structured quadrilaterals; its edges are groups."""
    points = "".join(
        f"Point({i}) = {{{x:.17g}, {y:.17g}, 0}};\n" for i, (x, y) in enumerate(corners, 1)
    )
    lines = "".join(
        f'Line({i}) = {{{i}, {i % 4 + 1}}}; Physical Curve("edge{i}") = {{{i}}};\n'
        f"Transfinite Curve {{{i}}} = {cells[(i + 1) % 2] + 1};\n"
        for i in range(1, 5)
    )
    return (
        points
        + lines
        + "Curve Loop(1) = {1, 2, 3, 4}; Plane Surface(1) = {1}; Transfinite Surface {1};\n"
        + 'Recombine Surface {1}; Physical Surface("part") = {1};\n'
    )


def double_cross() -> tuple[ao.Structure, ao.Site]:
    """FV2: eight arms of 5 m, 0.125 m square, pinned at their ends, in their plane."""
    arms = [(5 * np.cos(a), 5 * np.sin(a)) for a in np.arange(8) * np.pi / 4]
    text = "Point(1) = {0, 0, 0};\n"
    for i, (x, y) in enumerate(arms, 2):
        text += f"Point({i}) = {{{x:.17g}, {y:.17g}, 0}}; Line({i}) = {{1, {i}}};\n"
    ends = ", ".join(str(i) for i in range(2, 10))
    text += f"Transfinite Curve {{{ends}}} = 9;\n"
    text += f'Physical Curve("arms") = {{{ends}}}; Physical Point("ends") = {{{ends}}};\n'
    beam = ao.Beam(**STEEL, section=ao.Section.rectangle(0.125, 0.125))
    part = ao.Structure(meshed(text, gdim=2), beam, [ao.Support("ends", fix=("x", "y"))])
    return part, ao.Site((1.25, 0.0), (0.0, 1.0))


def deep_beam() -> tuple[ao.Structure, ao.Site]:
    """FV5 in its plane: 10 m long, 2 m square, simply supported."""
    beam = ao.Beam(**STEEL, section=ao.Section.rectangle(2.0, 2.0))
    supports = [ao.Support("near", fix=("x", "y")), ao.Support("far", fix="y")]
    return ao.Structure(line(10.0, 20), beam, supports), ao.Site((3.1, 0.0), (0.6, 0.8))


def tapered_membrane() -> tuple[ao.Structure, ao.Site]:
    """FV32: 10 m long, 5 m high at the clamped end and 1 m at the free one, plane stress."""
    text = quadrilateral([(0.0, -2.5), (10.0, -0.5), (10.0, 0.5), (0.0, 2.5)], (16, 8))
    solid = ao.Solid(**STEEL, plane="stress", thickness=0.05)
    part = ao.Structure(meshed(text, gdim=2), solid, [ao.Support("edge4")])
    return part, ao.Site((10.0, 0.5), (0.6, 0.8))


def square_plate(*clamped: str) -> tuple[ao.Structure, ao.Site]:
    """FV12 (free) and FV16 (one edge clamped): 10 m square, 0.05 m thick."""
    text = quadrilateral([(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)], (10, 10))
    in_plane = ao.Support("part", fix=("x", "y", "rz"))
    supports = [in_plane, *(ao.Support(edge) for edge in clamped)]
    part = ao.Structure(meshed(text, gdim=3), ao.Shell(**STEEL, thickness=0.05), supports)
    return part, ao.Site((9.0, 7.7, 0.0), (0.0, 0.0, 1.0))


def solid_plate() -> tuple[ao.Structure, ao.Site]:
    """FV52: 10 m square, 1 m thick, its lower edges held upright, on the mesh of the source."""
    text = quadrilateral([(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)], (4, 4))
    text += (
        "out[] = Extrude {0, 0, 1} { Surface{1}; Layers{1}; Recombine; };\n"
        'Physical Volume("plate") = {out[1]};\n'
    )
    text = text.replace('Physical Surface("part") = {1};', "")

    def edges(x: np.ndarray) -> np.ndarray:
        border = np.isclose(x[:2], 0.0) | np.isclose(x[:2], 10.0)
        return np.asarray(border.any(axis=0) & np.isclose(x[2], 0.0))

    part = ao.Structure(meshed(text), ao.Solid(**STEEL), [ao.Support(edges, fix="z")])
    return part, ao.Site((9.0, 7.7, 1.0), (0.0, 0.0, -1.0), radius=1.0)


def compare(
    build: Callable[[], tuple[ao.Structure, ao.Site]],
    published: list[tuple[str, float]],
    bound: float,
    picture: Path,
    known: Known = "read",
    why: str = "",
) -> list[Row]:
    """Published frequencies (Hz) beside the first elastic ones found at the site."""
    part, site = build()
    modes = ao.superposition(part, site, n=len(published) + 4)
    found = modes.omega[modes.omega > 1.0][: len(published)] / (2 * np.pi)
    names, values = zip(*published, strict=True)
    place = np.arange(len(names))
    with drawing(picture, "mode (difference above the bars)", "frequency (Hz)") as axis:
        axis.bar(place - 0.2, values, 0.38, color="0.6", label="published")
        bars = axis.bar(place + 0.2, found, 0.38, label="antiosc")
        axis.bar_label(bars, [f"{change:+.1%}" for change in found / np.array(values) - 1])
        axis.margins(y=0.12)
        axis.set_xticks(place, names)

    return [
        Row(f"mode {name}, Hz", value, float(ours), bound, known, why=why)
        for (name, value), ours in zip(published, found, strict=True)
    ]


SHORT_SERIES = (
    "The value of the book comes from a short Ritz series, which lies above the frequency of the "
    "plate; converged series agree with ours within 0.4 % (`test_nafems_square_plates`)."
)
SHEAR = "The book neglects shear and rotary inertia of the arms, which lower this frequency."
NAFEMS = "NAFEMS, The Standard NAFEMS Benchmarks, TNSB Rev. 3 (1990)"
CASES = [
    Case(
        "fv2",
        "NAFEMS FV2: double cross with pinned ends, in its plane",
        "E = 200 GPa, ν = 0.3, ρ = 8000 kg/m³; eight arms, 5 m long, 0.125 m square (recalled; "
        "they give the 17.709 Hz of a hinged and clamped arm)",
        f"{NAFEMS}, read in the Abaqus benchmark manual, whose own elements differ by up to 2.5 %; "
        "bound 1 %",
        partial(
            compare,
            double_cross,
            [("1", 11.336), ("2, 3", 17.709), ("4–8", 17.709), ("9", 45.345), ("10, 11", 57.390)],
            0.01,
            why=SHEAR,
        ),
    ),
    Case(
        "fv5",
        "NAFEMS FV5: deep simply supported beam, in its plane",
        "E = 200 GPa, ν = 0.3, ρ = 8000 kg/m³; 10 m long, 2 m square (recalled)",
        f"{NAFEMS}, closed form, read in the OptiStruct verification manual; bound 1 %",
        partial(
            compare,
            deep_beam,
            [("1, 2", 42.649), ("4", 125.0), ("5, 6", 148.31), ("8, 9", 284.55)],
            0.01,
        ),
    ),
    Case(
        "fv12",
        "NAFEMS FV12: free thin square plate",
        "E = 200 GPa, ν = 0.3, ρ = 8000 kg/m³; 10 m square, 0.05 m thick; quadratic quadrilaterals",
        f"{NAFEMS}, read in the OptiStruct verification manual; bound 1 %",
        partial(
            compare,
            square_plate,
            [("4", 1.622), ("5", 2.360), ("6", 2.922), ("7, 8", 4.233), ("9", 7.416)],
            0.01,
            why=SHORT_SERIES,
        ),
    ),
    Case(
        "fv16",
        "NAFEMS FV16: square plate, clamped along one edge",
        "as FV12, one edge clamped",
        f"{NAFEMS}; bound 1 %",
        partial(
            compare,
            partial(square_plate, "edge1"),
            [("1", 0.421), ("2", 1.029), ("3", 2.582), ("4", 3.306), ("5", 3.753), ("6", 6.555)],
            0.01,
            known="recalled",
            why=SHORT_SERIES,
        ),
    ),
    Case(
        "fv32",
        "NAFEMS FV32: clamped tapered membrane",
        "E = 200 GPa, ν = 0.3, ρ = 8000 kg/m³; 10 m long (recalled), 5 m to 1 m high, 0.05 m thick",
        f"{NAFEMS}, read in the Abaqus benchmark manual; bound 0.1 %: quadratic triangles there "
        "differ by 0.02 %",
        partial(
            compare,
            tapered_membrane,
            list(zip("123456", (44.623, 130.03, 162.70, 246.05, 379.90, 391.44), strict=True)),
            0.001,
        ),
    ),
    Case(
        "fv52",
        "NAFEMS FV52: thick square plate of solids, held along its lower edges",
        "E = 200 GPa, ν = 0.3, ρ = 8000 kg/m³; 10 m square, 1 m thick; u_z = 0 on the four lower "
        "edges; 4 × 4 × 1 quadratic hexahedra as in the source. A line support of a solid has no "
        "limit: finer meshes lower the frequencies",
        f"{NAFEMS}, solution with 20-node hexahedra, read in code_aster's astest/sdls502a.comm; "
        "bound 3 %, as there (1 % for the first)",
        partial(
            compare,
            solid_plate,
            [("4", 44.762), ("5, 6", 110.52), ("7", 169.08), ("8", 193.93), ("9, 10", 206.64)],
            0.03,
        ),
    ),
]
