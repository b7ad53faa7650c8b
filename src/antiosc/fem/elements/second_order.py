"""Second-order strain η(a, b) of solids and of sheets: strains are ε(u) + η(u, u)/2.

Solids have Green and Lagrange's strain, η(a, b) = (∇aᵀ∇b + ∇bᵀ∇a)/2. Of sheets it is that of the
middle surface, by tangential derivatives of all three displacements: it holds on folded and curved
sheets too, and of a flat one it is von Kármán's. Stretching, prestress and spin are built of it:
with the forces N of a state, K_σ(a, b) = ∫ N : η(a, b).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import ufl

from antiosc.base._types import Array
from antiosc.fem.elements.shell import Frame, frames, section_fields, strains_of
from antiosc.fem.elements.weak_form import measure
from antiosc.fem.platform import compat

if TYPE_CHECKING:
    from ufl.core.expr import Expr

    from antiosc.fem.structure.meshed import MeshedStructure


def of_solid(a: Expr, b: Expr) -> Expr:
    """η (gdim, gdim) of displacements a and b (UFL)."""
    A, B = ufl.grad(a), ufl.grad(b)
    return ufl.sym(ufl.dot(ufl.transpose(A), B))


def of_sheet(frame: Frame, a: Expr, b: Expr) -> Expr:
    """(η11, η22, 2 η12) in the frame of a sheet, of motions of its six components (UFL)."""
    (a1, a2), (b1, b2) = (_tangential(frame, motion) for motion in (a, b))
    return ufl.as_vector([ufl.dot(a1, b1), ufl.dot(a2, b2), ufl.dot(a1, b2) + ufl.dot(a2, b1)])


def _tangential(frame: Frame, motion: Expr) -> tuple[Expr, Expr]:
    """Derivatives (3,) of the displacement along e1 and e2."""
    u = ufl.as_vector([motion[i] for i in range(3)])
    slopes = ufl.dot(ufl.grad(u), ufl.transpose(frame.along))
    first, second = (ufl.as_vector([slopes[i, j] for i in range(3)]) for j in (0, 1))
    return first, second


#: Distance of nodes from a plane, over the thickness, up to which a sheet is flat.
FLAT = 1e-3


def quadratic_share(part: MeshedStructure, shape: Array, stiffness: float) -> float:
    """Change [1/m] of the force on a sheet, a share of it, for each metre of displacement.

    `shape` (rows of this rank): displacements and rotations for 1 m of the site under its static
    force `stiffness` [N/m]. The strain energy of the motion q shape is k q²/2 + g q³/2 + …, with
    g = ∫ N : η, N the membrane forces of the shape: its force is k q (1 + 3 g q/(2 k)). 0 of flat
    sheets; < 0: softer. Quartic terms, by which each sheet stiffens, are not in it.
    """
    x = part.mesh.dolfinx.geometry.x
    thickness = min(material.section.thickness for material, _ in part.parts)
    if part.mesh.gdim == 2 or _out_of_plane(part.comm.allgather(x)) <= FLAT * thickness:
        return 0.0
    frame, section = frames(part.mesh, part.parts), section_fields(part.mesh, part.parts)
    motion = compat.function_of(part.form.space, shape)
    strains = strains_of(frame, motion, section.middle)
    stretch = strains.membrane
    if section.coupling is not None:
        stretch = stretch + section.coupling * strains.bending
    energy = ufl.inner(section.A * stretch, of_sheet(frame, motion, motion))
    g = compat.integrate(energy * measure(part.mesh, 6), part.mesh.dolfinx)
    return 1.5 * g / stiffness


def _out_of_plane(points: list[Array]) -> float:
    """Largest distance [m] of points from their plane."""
    x = np.vstack(points)
    x = x - x.mean(axis=0)
    normal = np.linalg.svd(x, full_matrices=False)[2][2]
    return float(np.abs(x @ normal).max(initial=0.0))
