"""Mesh files that several tests write, and what is said of those that are refused."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest

import antiosc as ao


def refusal(path: Path, **options) -> str:
    """What `read_mesh` says of a file that it refuses: one sentence that names it."""
    with pytest.raises(ao.MeshError) as caught:
        ao.read_mesh(path, **options)
    message = str(caught.value)
    assert "\n" not in message
    assert message.endswith(".")
    assert len(message) < 450
    assert path.name[:50] in message
    return message


def grid(path: Path, n: int, groups: int, extra: str = "") -> Path:
    """A square of 2 n² triangles, in as many physical groups, as a Gmsh file of version 2.2."""
    x = [(i / n, j / n) for j in range(n + 1) for i in range(n + 1)]
    lines = [f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{len(x)}"]
    lines += [f"{k + 1} {a!r} {b!r} 0" for k, (a, b) in enumerate(x)]
    cells = []
    for j in range(n):
        for i in range(n):
            p = j * (n + 1) + i + 1
            cells += [(p, p + 1, p + n + 2), (p, p + n + 2, p + n + 1)]
    if extra == "twice":
        cells += cells[100:140]
    rows = [
        f"{k + 1} 2 2 {k % groups + 1} {k % groups + 1} {a} {b} {c}"
        for k, (a, b, c) in enumerate(cells)
    ]
    lines += ["$EndNodes\n$Elements", str(len(rows)), *rows, "$EndElements\n"]
    path.write_text("\n".join(lines))
    return path


def write(path: Path, points, *cells) -> Path:
    meshio.Mesh(np.asarray(points, dtype=float), list(cells)).write(path)
    return path
