"""Every family on every kind of mesh, in the working folder, as another program runs it."""

from __future__ import annotations

import antiosc as ao
import antiosc.fem  # before dolfinx, as packages of PyPI ask for it
import parts

SOLID = ao.Solid(**parts.STEEL)
SHEET = ao.Solid(**parts.STEEL, plane="stress", thickness=1e-3)
SHELL = ao.Shell(**parts.STEEL, thickness=1e-3)
BEAM = ao.Beam(**parts.STEEL, section=ao.Section.rectangle(0.01, 0.01))
SLENDER = ao.Beam(**parts.STEEL, section=ao.Section.rectangle(0.01, 0.01), shear=False)
BARS = ao.Truss(**parts.STEEL, area=1e-4)


def families():
    """Name -> what is compiled for it."""
    for cell in ("tetrahedron", "hexahedron"):
        yield cell, lambda cell=cell: parts.box((1, 1, 1), cell=cell), SOLID
    for cell in ("triangle", "quadrilateral"):
        yield cell, lambda cell=cell: parts.box((1, 1), (0.2, 0.1), cell=cell), SHEET
    yield "shell", lambda: parts.plate((1, 1)), SHELL
    yield "beam", lambda: parts.line(0.2, 2), BEAM
    yield "beam in space", lambda: parts.line(0.2, 2, (1.0, 0.0, 0.0)), BEAM
    yield "slender beam", lambda: parts.line(0.2, 2), SLENDER
    yield "truss", lambda: parts.line(0.2, 1), BARS


if __name__ == "__main__":
    for name, mesh, material in families():
        part = ao.Structure(mesh(), material)
        print(name, part.mass)
