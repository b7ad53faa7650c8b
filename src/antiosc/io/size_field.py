"""Wanted element sizes all over a geometry, given on the cells of a mesh of it."""

from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType

import numpy as np

#: gmsh's edges come out longer than the size asked, in the mean by this factor.
EDGE_OVER_SIZE = 1.1
#: Cells that gmsh makes over regular ones with the edges asked, by dimension (measured).
CELLS_MADE = {2: 1.35, 3: 0.95}
#: Least number of faces around a full turn of a curved surface: of flat faces, and of curved ones,
#: without which coarse elements cut off parts of a cylinder.
AROUND_FLAT, AROUND_CURVED = 12, 6
#: Gmsh's names of scalars on triangles and on tetrahedra.
LISTS = {3: "ST", 4: "SS"}


@dataclass
class SizeField:
    """Sizes at the corners of simplices.

    Lists, as they are sent to the reading process: points (n, 3) in m, cells (c, dim + 1), and the
    sizes of edges wanted at the points (n,) in m.
    """

    points: list[list[float]]
    cells: list[list[int]]
    sizes: list[float]

    def expected(self) -> float:
        """Estimated number of cells."""
        x, cells, sizes = (np.array(a) for a in (self.points, self.cells, self.sizes))
        sides = x[cells[:, 1:]] - x[cells[:, :1]]
        dim = cells.shape[1] - 1
        measure = np.sqrt(np.abs(np.linalg.det(sides @ sides.transpose(0, 2, 1))))
        # regular simplices of edge 1 hold √2/12 and √3/4
        share = {2: 0.5 / (3**0.5 / 4), 3: (1 / 6) / (2**0.5 / 12)}[dim]
        return float(CELLS_MADE[dim] * share * np.sum(measure / sizes[cells].mean(axis=1) ** dim))

    def lay(self, gmsh: ModuleType, scale: float, flat: bool) -> int:
        """Make it a field of gmsh's current model, whose unit is `scale` metres: its tag.

        `flat`: the cells have flat faces, of which curved surfaces need more.
        """
        x = np.array(self.points)[np.array(self.cells)] / scale
        sizes = np.array(self.sizes)[np.array(self.cells)] / (scale * EDGE_OVER_SIZE)
        rows = np.concatenate([x.transpose(0, 2, 1).reshape(len(x), -1), sizes], axis=1)
        view = gmsh.view.add("sizes")
        gmsh.view.addListData(view, LISTS[sizes.shape[1]], len(rows), rows.ravel())
        tag = int(gmsh.model.mesh.field.add("PostView"))
        gmsh.model.mesh.field.setNumber(tag, "ViewTag", view)
        # the sizes decide everywhere, not only on the boundary
        for option in ("FromPoints", "ExtendFromBoundary"):
            gmsh.option.setNumber(f"Mesh.MeshSize{option}", 0)
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", AROUND_FLAT if flat else AROUND_CURVED)
        return tag
