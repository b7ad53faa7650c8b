"""Lines along x: meshes of beams."""

from __future__ import annotations

import tempfile
from pathlib import Path

import antiosc as ao


def line(length: float, elements: int) -> ao.Mesh:
    """[0, length] along x in a plane; groups "line", and "near" and "far" for its ends."""
    text = (
        f"Point(1) = {{0, 0, 0}}; Point(2) = {{{length:.17g}, 0, 0}}; Line(1) = {{1, 2}};\n"
        f"Transfinite Curve {{1}} = {elements + 1};\n"
        'Physical Curve("line") = {1}; Physical Point("near") = {1}; Physical Point("far") = {2};\n'
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "line.geo"
        path.write_text(text, encoding="ascii")
        return ao.read_mesh(path, gdim=2)
