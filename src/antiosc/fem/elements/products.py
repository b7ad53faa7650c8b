"""The choice of cell-by-cell products for a part."""

from __future__ import annotations

from collections.abc import Mapping

from antiosc.base._types import IntArray
from antiosc.fem.elements.cell_by_cell import CellByCell
from antiosc.fem.elements.compiled_cells import CompiledCells
from antiosc.fem.elements.solid import Solid
from antiosc.fem.elements.tetrahedra import Tetrahedra
from antiosc.fem.elements.weak_form import Parts, WeakForm
from antiosc.fem.mesh import Mesh

#: Least number of dofs for products cell by cell.
FEWEST_DOFS = 20_000


def cell_by_cell(
    mesh: Mesh,
    form: WeakForm,
    parts: Parts,
    conditions: Mapping[tuple[int, ...], IntArray],
) -> CellByCell | None:
    """The cells of a large quadratic solid in space, for products; None for other parts."""
    imap = form.space.dofmap.index_map
    is_large = imap.size_global * form.space.dofmap.index_map_bs >= FEWEST_DOFS
    solid = parts[0][0].kind.name == "solid" and mesh.gdim == 3
    if not (is_large and solid) or form.degree != 2 or form.strains is not None:
        return None
    if mesh.cell == "hexahedron":
        return CompiledCells(mesh, form, parts, conditions)
    if mesh.order != 1:  # the entries are twice as fast as the many points of a curved cell
        return None
    isotropic = all(isinstance(material, Solid) for material, _ in parts)
    family = Tetrahedra if isotropic else CompiledCells
    return family(mesh, form, parts, conditions)
