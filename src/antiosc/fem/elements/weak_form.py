"""What an element family (Solid, Beam, …) gives to a Structure: its contract, and shared helpers.

A family is the class of a material: a frozen dataclass of its constants with a method
`weak_form(mesh, parts, order)`, where `parts` lists (material, cells) and `cells` are the
cells of this rank that the material fills. All materials of one structure are of one family.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
import ufl
from numpy.typing import NDArray

from antiosc.fem import compat
from antiosc.fem.compat import IntArray
from antiosc.fem.mesh.mesh import Mesh

Array = NDArray[np.float64]
Parts = Sequence[tuple[Any, IntArray]]


@dataclass(frozen=True)
class WeakForm:
    """The space of a family on a mesh and its two quadratic forms."""

    #: the dolfinx function space
    space: Any
    #: bilinear forms whose sum is K; one quadrature degree each
    stiffness: Sequence[Any]
    #: bilinear forms whose sum is M
    mass: Sequence[Any]
    #: component ("x", …, "rz") -> path of the scalar subspace in `space`, in UFL's flat order
    components: Mapping[str, tuple[int, ...]]
    #: mass per unit of cell measure, a UFL expression (total mass = its integral)
    density: Any
    #: where a patch of pressure lies: on exterior "facets" or on the "cells" themselves; None where
    #: the compliance under a point load has a limit and no patch is needed
    patch: Literal["facets", "cells"] | None
    #: mass moment per unit of cell measure about the mesh, kg/m along the normal (UFL vector),
    #: where the mass of a sheet does not lie in its middle
    moment: Any = None
    #: strains times √stiffness of the trial function (UFL vector), and the quadrature degree with
    #: which their squares make K; None where K's entries alone are accurate enough
    strains: tuple[Any, int] | None = None

    def along(self, direction: Sequence[float]) -> Any:
        """The test function's displacement along `direction` (UFL)."""
        return self._contracted("xyz", direction)

    def momentum(self, direction: Any) -> Any:
        """Density of momentum along `direction`, the test function being the velocity (UFL)."""
        linear = self.density * self.along(direction)
        if self.moment is None:
            return linear
        # (θ × m)·d
        return linear + self._contracted(("rx", "ry", "rz"), ufl.cross(self.moment, direction))

    def _contracted(self, names: Sequence[str], vector: Any) -> Any:
        v = ufl.TestFunction(self.space)
        flat = list(self.components)
        return sum(vector[i] * v[flat.index(n)] for i, n in enumerate(names) if n in flat)


class Family(Protocol):
    """A material that knows its weak form."""

    def weak_form(self, mesh: Mesh, parts: Parts, order: int) -> WeakForm:
        """The space and forms of `parts` on `mesh` with displacements of degree `order`."""
        ...

    def half_space_compliance(self, cosine: float) -> float:
        """Compliance times radius (m²/N) of a half-space patch; 0 where the family has none.

        `cosine`: of the angle between the load and the surface normal.
        """
        ...


def coefficient(mesh: Mesh, parts: Parts, value: Callable[[Any], float | Array]) -> Any:
    """`value(material)`, a number or a matrix, as a cell-wise constant (UFL)."""
    shape = np.shape(value(parts[0][0]))
    size = int(np.prod(shape, dtype=int))
    function = compat.cellwise(mesh.dolfinx, size if shape else 0)
    values = function.x.array.reshape(-1, size)
    for material, cells in parts:
        values[cells] = np.ravel(value(material))
    if not shape:
        return function
    rows, columns = shape
    return ufl.as_matrix([[function[columns * i + j] for j in range(columns)] for i in range(rows)])


def measure(mesh: Mesh, degree: int | None) -> Any:
    """Integration over the cells with a fixed quadrature degree (None: UFL's estimate)."""
    metadata = {} if degree is None else {"quadrature_degree": degree}
    return ufl.Measure("dx", domain=mesh.dolfinx, metadata=metadata)
