"""`estimator`: the estimate of the error of the strains of a structure's shapes, by family."""

from __future__ import annotations

from typing import TYPE_CHECKING

from antiosc.errors import InputError
from antiosc.fem.structure.structure import Structure, on_mesh

if TYPE_CHECKING:
    from antiosc.fem.error.shell import ShellErrors
    from antiosc.fem.error.solid import SolidErrors

#: Message for matrices.
NO_MESH = "the error of a mesh needs the mesh: given matrices have none, so leave error=None."
#: Why the recovery of strains does not tell the errors of other families.
WHY = {
    "beam": (
        "which are compared with a finer mesh: leave error=None and compare two element sizes"
    ),
    "truss": "whose nodes are hinges, so that no mesh could be finer: leave error=None",
}


def estimator(structure: Structure) -> SolidErrors | ShellErrors:
    """The estimator of the structure's element family; InputError where there is none."""
    matrices = on_mesh(structure, NO_MESH)
    if matrices.kind.name in WHY:
        raise InputError(
            f"error='estimate' holds for solids, beams and shells; {matrices.mesh.name} is made of "
            f"{matrices.kind.name} elements, {WHY[matrices.kind.name]}."
        )
    # needs dolfinx
    if matrices.kind.sheet:
        from antiosc.fem.error.shell import ShellErrors

        return ShellErrors(matrices)
    from antiosc.fem.error.solid import SolidErrors

    return SolidErrors(matrices)
