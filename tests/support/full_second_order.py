"""All degrees of freedom of a part under its second-order strain: a reference of few modes.

The energy is a form of UFL, its derivatives automatic; the linear stiffness and mass alone are
those of the package.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.sparse
import scipy.sparse.linalg
import ufl
from dolfinx import fem

import antiosc as ao
from antiosc.fem.elements import second_order
from antiosc.fem.elements.beam import Beam, tangent
from antiosc.fem.elements.shell import Sheet, frames, section_fields, strains_of
from antiosc.fem.elements.weak_form import measure
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.platform import compat
from antiosc.reduce.site import functional


class Full:
    """All dofs of a part under its second-order strain."""

    def __init__(self, part: ao.Structure, site: ao.Site) -> None:
        matrices = part.matrices
        self.K, self.M = csr(part.K), csr(part.M)
        self.b = functional(part, site).b
        self.space = matrices.form.space
        self.u = fem.Function(self.space)
        self.extra = extra_energy(matrices, self.u)
        self.first = ufl.derivative(self.extra, self.u, ufl.TestFunction(self.space))
        self.free = np.ones(len(self.b), dtype=bool)
        self.free[part.fixed] = False

    @cached_property
    def of_energy(self) -> fem.Form:
        return compat._compiled(self.extra)

    @cached_property
    def of_force(self) -> fem.Form:
        return compat._compiled(self.first)

    @cached_property
    def of_slope(self) -> fem.Form:
        trial = ufl.TrialFunction(self.space)
        return compat._compiled(ufl.derivative(self.first, self.u, trial))

    def energy(self, u: np.ndarray) -> float:
        """Strain energy, all of it."""
        self.u.x.array[:] = u
        return float(0.5 * u @ (self.K @ u) + fem.assemble_scalar(self.of_energy))

    def forces(self, u: np.ndarray) -> np.ndarray:
        """Second-order forces (dofs,)."""
        self.u.x.array[:] = u
        vector = fem.petsc.assemble_vector(self.of_force)
        return np.array(vector.array_r)

    def tangent(self, u: np.ndarray) -> scipy.sparse.csr_matrix:
        """Their derivatives."""
        self.u.x.array[:] = u
        matrix = fem.petsc.assemble_matrix(self.of_slope)
        matrix.assemble()
        return csr(matrix)

    def impact(self, mass, speed, k, duration, steps, exponent=1.5):
        """Times, forces and displacements of the site under a mass by the law k δ^exponent.

        Newton's method keeps a tangent until it converges slowly. `motion` (steps + 1, dofs) then
        has the displacements.
        """
        free, n = self.free, int(self.free.sum())
        K, M = self.K[free][:, free].tocsc(), self.M[free][:, free].tocsc()
        b, h = self.b[free], duration / steps
        u, v, a = np.zeros((3, n))
        w, s, acc = 0.0, speed, 0.0
        out, factor, m = np.zeros((steps + 1, 3)), None, 4 / h**2 * mass
        self.motion = np.zeros((steps + 1, len(free)))
        for step in range(1, steps + 1):
            u0, w0 = u + h * v + h * h / 4 * a, w + h * s + h * h / 4 * acc
            x, y = u + h * v, w + h * s
            for tries in range(40):
                whole = np.zeros(len(free))
                whole[free] = x
                f, delta = self.forces(whole)[free], y - b @ x
                F = k * max(delta, 0.0) ** exponent
                slope = exponent * k * max(delta, 0.0) ** (exponent - 1)
                r = 4 / h**2 * (M @ (x - u0)) + K @ x + f - b * F
                if factor is None or tries % 6 == 5:
                    A = (4 / h**2 * M + K + self.tangent(whole)[free][:, free]).tocsc()
                    factor = scipy.sparse.linalg.splu(
                        A, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.01
                    )
                    q = factor.solve(b)
                p = factor.solve(-r)
                small = np.array([[1 + slope * (b @ q), -slope * (b @ q)], [-slope, m + slope]])
                bx, dy = np.linalg.solve(small, [b @ p, -m * (y - w0) - F])
                dx = p - q * slope * (bx - dy)
                x, y = x + dx, y + dy
                if np.abs(dx).max() <= 1e-5 * max(np.abs(x).max(), 1e-6):
                    break
            else:
                raise RuntimeError("Newton's method did not converge")
            a_new, acc_new = 4 / h**2 * (x - u0), 4 / h**2 * (y - w0)
            v, s = v + h / 2 * (a + a_new), s + h / 2 * (acc + acc_new)
            u, w, a, acc = x, y, a_new, acc_new
            self.motion[step, free] = x
            out[step] = step * h, k * max(w - b @ u, 0.0) ** exponent, b @ u
        return out.T


def extra_energy(part, u):
    """∫ N(u):η(u, u)/2 + η:C:η/8."""
    material = part.parts[0][0]
    if isinstance(material, Sheet):
        frame, section = frames(part.mesh, part.parts), section_fields(part.mesh, part.parts)
        eta = second_order.sheet_eta(frame, u, u)
        found = strains_of(frame, u, section.middle)
        stretch = found.membrane
        if section.coupling is not None:
            stretch = stretch + section.coupling * found.bending
        force = section.A * (stretch / 2 + eta / 8)
        return ufl.inner(force, eta) * measure(part.mesh, 8)
    if isinstance(material, Beam):
        t, d = tangent(part.mesh), part.mesh.gdim
        moved = ufl.as_vector([u[i] for i in range(d)])
        slope = ufl.dot(ufl.grad(moved), t)
        eta = ufl.dot(slope, slope)
        EA = material.E * material.section.A
        return EA * (ufl.dot(slope, t) / 2 + eta / 8) * eta * measure(part.mesh, 8)
    eta = second_order.solid_eta(u, u)
    d = part.mesh.gdim
    strain = ufl.sym(ufl.grad(u)) / 2 + eta / 8
    nu = material.nu
    below = 1 - nu if material.plane == "stress" else 1 - 2 * nu
    lame = material.E * nu / ((1 + nu) * below)
    stress = lame * ufl.tr(strain) * ufl.Identity(d) + material.E / (1 + nu) * strain
    depth = 1.0 if material.plane is None else material.thickness
    return depth * ufl.inner(stress, eta) * measure(part.mesh, 5)
