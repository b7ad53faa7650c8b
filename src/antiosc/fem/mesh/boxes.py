"""`box_mesh`: a bar, a plate or a block of given lengths, without a file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from mpi4py import MPI

from antiosc.base.checks import array, choice, positive, shown
from antiosc.base.errors import InputError
from antiosc.fem.mesh.mesh import Mesh
from antiosc.fem.mesh.reading import Refinement, read_mesh

#: by the number of lengths: a name, a script of gmsh, and the sides by their groups
KINDS = {
    1: ("bar", "Point(1) = {{0, 0, 0}}; Point(2) = {{{0!r}, 0, 0}}; Line(1) = {{1, 2}};",
        {"-x": "1", "+x": "2"}),
    2: ("plate", "Rectangle(1) = {{0, 0, 0, {0!r}, {1!r}}};",
        {"-x": "4", "+x": "2", "-y": "1", "+y": "3", "rim": "1, 2, 3, 4"}),
    3: ("block", "Box(1) = {{0, 0, 0, {0!r}, {1!r}, {2!r}}};",
        {"-x": "1", "+x": "2", "-y": "3", "+y": "4", "-z": "5", "+z": "6"}),
}  # fmt: skip
GROUPS = ("Point", "Curve", "Surface", "Volume")


def box_mesh(
    lengths: Sequence[float],
    size: float,
    *,
    refine: Sequence[Refinement] = (),
    gdim: int = 3,
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> Mesh:
    """Mesh a bar, a plate or a block, with a corner at the origin and its sides along the axes.

    Parameters
    ----------
    lengths : one, two or three floats
        Along x, y and z, m: lines (for `Beam`), triangles (for `Shell`) or tetrahedra (`Solid`).
    size : float
        Largest element size, m.
    refine : sequence of (point, size)
        As for `read_mesh`.
    gdim : 3 or 2
        2 puts a bar or a plate into the plane: plane frames and plane stress.
    comm : MPI communicator that shares the mesh

    Returns
    -------
    Mesh
        Its sides are the groups "-x", "+x", "-y", …; all edges of a plate are "rim".
    """
    sides = array("lengths", lengths, None)
    if sides.ndim != 1 or len(sides) not in KINDS:
        raise InputError(f"lengths must be one to three, as (0.2, 0.1); got {shown(lengths)}.")
    choice("gdim", gdim, (2, 3))
    name, body, groups = KINDS[len(sides)]
    own = body.format(*(positive("a length", float(side), "m") for side in sides))
    last, outside = GROUPS[len(sides)], GROUPS[len(sides) - 1]
    lines = ['SetFactory("OpenCASCADE");', own, f'Physical {last}("{name}") = {{1}};']
    lines += [f'Physical {outside}("{side}") = {{{them}}};' for side, them in groups.items()]
    with TemporaryDirectory() as folder:
        script = Path(folder, f"{name}.geo")
        script.write_text("\n".join(lines) + "\n", encoding="ascii")
        made = read_mesh(script, size, gdim, order=1, refine=refine, comm=comm)
    return replace(made, name=name)
