"""What an element family (Solid, Beam, …) gives to a Structure: its contract, and shared helpers.

A family is the class of a material: a frozen dataclass of its constants with a method
`weak_form(mesh, parts, order)`, where `parts` lists (material, cells) and `cells` are the
cells of this rank that the material fills. All materials of one structure are of one family.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import ufl

from antiosc.fem import compat
from antiosc.fem.compat import IntArray
from antiosc.fem.mesh import Mesh

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

    def along(self, direction: Sequence[float]) -> Any:
        """The test function's displacement along `direction` (UFL)."""
        v = ufl.TestFunction(self.space)
        flat = list(self.components)
        return sum(direction[i] * v[flat.index(n)] for i, n in enumerate("xyz") if n in flat)


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


def coefficient(mesh: Mesh, parts: Parts, value: Callable[[Any], float]) -> Any:
    """`value(material)` as a cell-wise constant function."""
    function = compat.cellwise(mesh.dolfinx)
    for material, cells in parts:
        function.x.array[cells] = value(material)
    return function


def measure(mesh: Mesh, degree: int | None) -> Any:
    """Integration over the cells with a fixed quadrature degree (None: UFL's estimate)."""
    metadata = {} if degree is None else {"quadrature_degree": degree}
    return ufl.Measure("dx", domain=mesh.dolfinx, metadata=metadata)
