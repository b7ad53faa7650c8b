"""The stress outside three radii of a contact on a plate, over that on a half-space.

An axisymmetric elastic plate (Q2 elements, size 0.1 contact radii at the contact, nu = 0.3)
carries Hertz's pressure. It lies on a rigid base, bonded or smooth, or is clamped at its rim. The
largest von Mises stress on the surface of the ball of three contact radii, and anywhere outside of
it, is divided by Huber's closed form on that surface of a half-space.

The second table is of patches that spread the same force wider than the contact: the largest stress
outside of the ball under the patch, and with the difference of both on a half-space, and the larger
of this and that of a plate (`YieldingZone.spread_error`), over that under the contact.

    OMP_NUM_THREADS=1 .venv/bin/python benchmarks/plate_under_contact.py
"""

from __future__ import annotations

import itertools
from typing import Any

import basix
import numpy as np
import options
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI
from petsc4py import PETSc

from antiosc.engine.contact.half_space import hertz_stresses, von_mises
from antiosc.impact.histories.verdict import CONTACT_RADII, YieldingZone

NU = 0.3
#: Growth of the cells beyond `REACH` contact radii, and the share of the radius that is looked at.
GROWTH, REACH, INNER = 1.12, 4.5, 0.9
#: Width of the layer of points that counts as the surface of the ball, in contact radii.
LAYER = 0.15


def main(
    thicknesses: tuple[float, ...] = (1, 2, 3, 4, 6, 10, 20),
    rims: tuple[float, ...] = (10, 20, 60),
    patches: tuple[float, ...] = (3, 8, 15),
    base: float = 40,
    size: float = 0.1,
) -> None:
    """Print the ratios of all plates.

    Parameters
    ----------
    thicknesses : of the plates, in contact radii
    rims : radii of the plates that are clamped at the rim
    patches : radii of the patches
    base : radius of the plates on a rigid base
    size : of the cells at the contact
    """
    edge = float(von_mises(half_space()).max())
    plates = [("bonded", base), ("smooth", base), *(("rim", rim) for rim in rims)]
    print("| plate | thickness | at three radii | outside |", "|---|---|---|---|", sep="\n")
    for support, radius in plates:
        for thickness in thicknesses:
            x, stress = solved(thickness, radius, support, size)
            distance = np.linalg.norm(x, axis=1)
            outside = (distance >= CONTACT_RADII) & (x[:, 0] < INNER * radius)
            at_edge = outside & (distance < CONTACT_RADII + LAYER)
            ratios = (f"{stress[where].max() / edge:.2f}" for where in (at_edge, outside))
            print(f"| {support} {radius:g} | {thickness:g} | {' | '.join(ratios)} |", flush=True)
    print("", "| plate | thickness | patch | under it | half-space | plate |", sep="\n")
    print("|---|---|---|---|---|---|")
    for rim, thickness, patch in itertools.product(rims, thicknesses, patches):
        if patch < rim:
            x, contact = solved(thickness, rim, "rim", 2 * size)
            _, model = solved(thickness, rim, "rim", 2 * size, patch)
            outside = (np.linalg.norm(x, axis=1) >= CONTACT_RADII) & (x[:, 0] < INNER * rim)
            points = np.column_stack([x[:, 0], 0 * x[:, 0], -x[:, 1]])
            down = np.array([0.0, 0.0, -1.0])
            zone = YieldingZone(np.zeros(3), down, (1.0, patch), 2 * np.pi / 3, NU)
            spreads = (z.spread_error(points) for z in (zone, zone._replace(depth=thickness)))
            sums = (model, *(model + spread for spread in spreads))
            ratios = (f"{s[outside].max() / contact[outside].max():.2f}" for s in sums)
            print(f"| rim {rim:g} | {thickness:g} | {patch:g} | {' | '.join(ratios)} |", flush=True)


def half_space() -> Any:
    """Stresses at three radii on a half-space with a largest pressure of 1."""
    angles = np.linspace(0, np.pi / 2, 91)
    r, z = CONTACT_RADII * np.sin(angles), CONTACT_RADII * np.cos(angles)
    return hertz_stresses(2 * np.pi / 3, 1.0, NU, r, z)


def graded(length: float, size: float) -> Any:
    """Coordinates of the sides of cells from 0 to a length."""
    x = [0.0]
    while x[-1] < length:
        x.append(x[-1] + size)
        size *= GROWTH if x[-1] > REACH else 1.0
    return np.array(x) * (length / x[-1])


def solved(
    thickness: float, radius: float, support: str, size: float, patch: float = 1.0
) -> tuple[Any, Any]:
    """(points (n, 2), von Mises stresses (n,)) at the Gauss points of a plate."""
    ticks = graded(radius, size), graded(thickness, min(size, thickness / 16))
    counts = [len(tick) - 1 for tick in ticks]
    unit = [[0.0, 0.0], [1.0, 1.0]]
    plate = mesh.create_rectangle(MPI.COMM_SELF, unit, counts, mesh.CellType.quadrilateral)
    for axis, tick in enumerate(ticks):
        even = np.linspace(0, 1, len(tick))
        plate.geometry.x[:, axis] = np.interp(plate.geometry.x[:, axis], even, tick)
    space = fem.VectorFunctionSpace(plate, ("CG", 2))
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    x = ufl.SpatialCoordinate(plate)
    work = ufl.inner(stress_of(u, x), strain_of(v, x)) * x[0]
    height = ufl.sqrt(abs(1 - (x[0] / patch) ** 2)) / patch**2
    pressure = ufl.conditional(ufl.lt(x[0], patch), height, 0)
    top = mesh.locate_entities_boundary(plate, 1, lambda y: np.isclose(y[1], 0))
    tags = mesh.meshtags(plate, 1, np.sort(top), np.ones(len(top), dtype=np.int32))
    ds = ufl.Measure("ds", plate, subdomain_data=tags, metadata={"quadrature_degree": 12})
    held = conditions(space, thickness, radius, support)
    dx = ufl.Measure("dx", plate, metadata={"quadrature_degree": 6})
    K = fem.petsc.assemble_matrix(fem.form(work * dx), bcs=held)
    K.assemble()
    load = fem.petsc.assemble_vector(fem.form(pressure * v[1] * x[0] * ds(1)))
    fem.petsc.set_bc(load, held)
    solver = PETSc.KSP().create()
    solver.setOperators(K)
    solver.setType("preonly")
    solver.getPC().setType("lu")
    solver.getPC().setFactorSolverType("mumps")
    solution = fem.Function(space)
    solver.solve(load, solution.vector)
    stress = stress_of(solution, x)
    deviator = stress - ufl.tr(stress) / 3 * ufl.Identity(3)
    points, _ = basix.make_quadrature(basix.CellType.quadrilateral, 3)
    cells = np.arange(plate.topology.index_map(2).size_local, dtype=np.int32)
    equivalent = fem.Expression(ufl.sqrt(1.5 * ufl.inner(deviator, deviator)), points)
    places = fem.Expression(x, points).eval(cells).reshape(-1, 2)
    return places, equivalent.eval(cells).ravel()


def strain_of(u: Any, x: Any) -> Any:
    """Axisymmetric strains of displacements along the radius and the depth."""
    shear = (u[0].dx(1) + u[1].dx(0)) / 2
    return ufl.as_tensor([[u[0].dx(0), 0, shear], [0, u[0] / x[0], 0], [shear, 0, u[1].dx(1)]])


def stress_of(u: Any, x: Any) -> Any:
    """Stresses for a Young's modulus of 1."""
    strain = strain_of(u, x)
    lam = NU / ((1 + NU) * (1 - 2 * NU))
    return strain / (1 + NU) + lam * ufl.tr(strain) * ufl.Identity(3)


def conditions(space: Any, thickness: float, radius: float, support: str) -> list[Any]:
    """The supports of a plate."""
    held = [(0, 0, 0.0)]  # component, axis, coordinate
    if support == "rim":
        held += [(0, 0, radius), (1, 0, radius)]
    else:
        held += [(1, 1, thickness), *([(0, 1, thickness)] if support == "bonded" else [])]
    found = []
    for component, axis, place in held:
        part = space.sub(component)
        own, _ = part.collapse()
        dofs = fem.locate_dofs_geometrical(
            (part, own), lambda y, axis=axis, place=place: np.isclose(y[axis], place)
        )
        found.append(fem.dirichletbc(fem.Function(own), dofs, part))
    return found


if __name__ == "__main__":
    options.command(main)
