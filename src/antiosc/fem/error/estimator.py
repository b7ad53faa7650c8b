"""`estimator`: the estimate of the error of the strains of a structure's shapes, by family."""

from __future__ import annotations

from typing import Protocol

from antiosc._types import Array
from antiosc.errors import InputError
from antiosc.fem.structure.structure import Structure, on_mesh

#: Message for matrices.
NO_MESH = "the error of a mesh needs the mesh: given matrices have none, so leave error=None."
#: Why the recovery of strains does not tell the errors of other families.
WHY = {
    "sheet": (
        "whose interpolated strains can make a coarse mesh softer than the part: leave error=None "
        "and compare two element sizes"
    ),
    "beam": (
        "which are compared with a finer mesh: leave error=None and compare two element sizes"
    ),
    "truss": "whose nodes are hinges, so that no mesh could be finer: leave error=None",
}


class StrainErrors(Protocol):
    """Energies of the errors e_j of the strains of shapes u_j (rows of this rank, k)."""

    def gram(self, shapes: Array) -> Array:
        """E_ij = ∫ e_i:C:e_j over the structure, (k, k), the same on all ranks."""
        ...

    def gram_and_layers(self, shapes: Array, layers: Array) -> tuple[Array, Array]:
        """(E, energies (k,) of the strains in layers (F,) [m³] on the outer faces of this rank)."""
        ...

    def of_cells(self, shapes: Array) -> Array:
        """Σ_j ∫ e_j:C:e_j over each cell of this rank, ghosts excluded: (cells,)."""
        ...


def estimator(structure: Structure) -> StrainErrors:
    """The estimator of the structure's element family; InputError where there is none."""
    matrices = on_mesh(structure, NO_MESH)
    if matrices.kind.name != "solid":
        raise InputError(
            f"error='estimate' holds for solids and beams; {matrices.mesh.name} is made of "
            f"{matrices.kind.name} elements, {WHY[matrices.kind.name]}."
        )
    from antiosc.fem.error.solid import SolidErrors  # needs dolfinx

    return SolidErrors(matrices)
