"""The structure in its natural modes: the modes, their superposition, and the unreduced model.

Both are references for an anti-oscillator model, and `simulate` accepts them as models:
`superposition` keeps n modes (as Goldsmith and Stronge, Article section 1); `full` keeps all modes
and is therefore the finite-element model in modal coordinates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array, IntArray
from antiosc.base.checks import flag, instance, whole, within_range
from antiosc.base.errors import AccuracyWarning, InputError, warn
from antiosc.base.process import one_thread
from antiosc.base.texts import ReprMixin
from antiosc.fem.linalg.algebra import dot
from antiosc.fem.platform import collective, on_root
from antiosc.fem.structure.structure import Structure, refuse_dampers
from antiosc.models.body import UNKNOWN_INFO, Body, ModelInfo
from antiosc.models.free_modes import RESIDUAL_ROUNDING, UNOBSERVABLE_SHARE, receptance_shares
from antiosc.models.modal import Damping, ModalBody, as_damping
from antiosc.recovery import source
from antiosc.recovery.series import write_vtu_file
from antiosc.reduce.extraction import elastic_response, site_shapes
from antiosc.reduce.extraction.eigenmodes import (
    EQUIVALENT_SITES,
    MOST_DENSE_ROWS,
    Modes,
    ModeSolver,
)
from antiosc.reduce.extraction.model import (
    DEFAULT_COUNT,
    REPEATED_DISTANCE,
    SEARCH_FACTOR,
    check_modes,
    inertia_of,
    participations,
)
from antiosc.reduce.site import functional
from antiosc.reduce.site.site import Site


@dataclass(frozen=True, eq=False, repr=False)
class StructureModes(ReprMixin):
    """The lowest natural modes of a structure, ascending; rigid-body modes first.

    Attributes
    ----------
    omega : (n,) circular frequencies, rad/s; exactly 0 for rigid-body modes.
    multiplicity : (n,) number of modes of the structure at each frequency. Frequencies with a
        relative difference below 1e-6 count as equal; their shapes are any basis of their space.
    participation : (n, 3) modal force of a unit acceleration of the supports along x, y, z,
        φᵀMe, kg^1/2; None for K and M without coordinates.
    mass : total mass, kg; None where it is not known.
    shapes : (rows of this rank, n) shapes of unit modal mass, kg^-1/2.
    structure : the structure.

    The sum of the effective masses over all modes is the total mass minus the mass of the fixed
    dofs.
    """

    omega: Array
    multiplicity: IntArray
    participation: Array | None
    mass: float | None
    shapes: Array
    structure: Structure = field(repr=False)

    @property
    def n(self) -> int:
        """Number of modes."""
        return len(self.omega)

    @property
    def frequency(self) -> Array:
        """(n,) frequencies, Hz."""
        return self.omega / (2 * np.pi)

    @property
    def effective_mass(self) -> Array | None:
        """Effective masses (n, 3) along x, y, z, kg: participation squared; None if unknown."""
        if self.participation is None:
            return None
        return self.participation**2

    def summary(self) -> str:
        """A table: frequency, multiplicity and effective masses as shares of the total mass."""
        rows = [f"{'mode':>4} {'Hz':>12} {'times':>5}"]
        shares = self.effective_mass
        if shares is not None:
            rows[0] += "".join(f" {'m_eff ' + axis:>9}" for axis in "xyz")
            shares = shares / (self.mass or 1.0)

        for i, f in enumerate(self.frequency):
            row = f"{i + 1:>4} {f:>12.6g} {self.multiplicity[i]:>5}"
            if shares is not None:
                row += "".join(f" {share:>9.2%}" for share in shares[i])
            rows.append(row)

        if shares is not None:
            total = " ".join(f"{share:>9.2%}" for share in shares.sum(axis=0))
            rows.append(f"{'sum':>4} {'':>12} {'':>5} {total}")
        return "\n".join(rows)

    @collective()
    def write(self, path: str | Path) -> Path:
        """Write the shapes to one `.vtu` file for ParaView, one field for each mode.

        The fields are "mode 1", "mode 2", …, scaled to a largest displacement of 1.

        Raises
        ------
        InputError
            The file cannot be written; matrices without coordinates.
        """
        points, cells, shapes = source(self.structure).at_nodes(self.structure, self.shapes)
        size = np.linalg.norm(shapes, axis=1).max(axis=0)
        scaled = shapes / np.where(size > 0, size, 1.0)
        fields = {f"mode {i + 1}": scaled[:, :, i] for i in range(self.n)}
        return on_root(self.structure.comm, lambda: write_vtu_file(path, points, cells, fields))


@collective()
@checks.within_range
@one_thread()
def natural_modes(structure: Structure, n: int = 10) -> StructureModes:
    """The n lowest natural modes of a structure on its supports, rigid-body modes included.

    Parameters
    ----------
    structure : Structure
    n : int
        Number of modes; fewer if the structure has fewer.

    Returns
    -------
    StructureModes
        With frequencies, multiplicity, participation, effective masses and shapes.

    Raises
    ------
    InputError
        n above the number of dofs.
    NotConvergedError, AccuracyError
        A solver that failed, or modes that fail their own check.
    """
    checks.instance("structure", structure, Structure, "a Structure")
    n = checks.whole("n", n)
    if n > structure.dofs:
        raise InputError(f"n must be at most the structure's {structure.dofs} dofs; got {n}.")
    rigid = structure.rigid_modes
    elastic = max(0, n - rigid.shape[1])
    omega = np.zeros(rigid.shape[1])
    shapes = rigid

    if elastic:
        solver = ModeSolver(structure)
        modes = solver.lowest(
            elastic + 1,  # and all of a repeated last frequency
            lambda modes: modes.omega[-1] > (1 + REPEATED_DISTANCE) * modes.omega[elastic - 1],
        )
        check_modes(structure, modes)
        omega = np.append(omega, modes.omega)
        shapes = np.hstack([rigid, modes.phi])

    # the multiplicity of each frequency
    group = np.cumsum(np.diff(omega, prepend=-1.0) > REPEATED_DISTANCE * omega)
    _, inverse, count = np.unique(group, return_inverse=True, return_counts=True)
    count = count[inverse.ravel()]

    try:
        mass: float | None = structure.mass
    except InputError:
        mass = None
    lowest = shapes[:, :n]

    return StructureModes(
        omega=omega[:n],
        multiplicity=count[:n],
        participation=participations(structure, lowest),
        mass=mass,
        shapes=lowest,
        structure=structure,
    )


#: Least share in the receptance of one of n modes, as of anti-oscillators at the default accuracy.
COUNTED_SHARE = 1e-5


@dataclass(frozen=True, eq=False, repr=False)
class SuperpositionModel(ReprMixin, Body):
    """Natural modes of a structure and their displacements at one site; `simulate` accepts it.

    Attributes
    ----------
    omega : natural circular frequencies in rad/s, ascending, shape (n,); 0 for the rigid-body mode.
    b : displacement of the site along the impact in each mode, kg^-1/2, shape (n,), > 0.
    shapes : mass-normalised modes as columns, kg^-1/2, on the rows of this rank, shape (rows, n).
    body : the modal body; it contains rigid-body motions that do not move the site, too.
    local_compliance, radius : half-space compliance and radius of the patch (`AntiOscillators`).
    damping : Damping of the modes, or None.
    info : record of the extraction.
    """

    omega: Array
    b: Array
    shapes: Array
    body: ModalBody
    local_compliance: float = 0.0
    radius: float | None = None
    damping: Damping | None = None
    info: ModelInfo = field(default_factory=ModelInfo)

    @property
    def n(self) -> int:
        """Number of modes."""
        return len(self.omega)

    @property
    def r(self) -> float:
        """Static compliance [m/N] of the truncated modes; 0 without static correction."""
        return self.body.r

    @property
    def patch_radius(self) -> float | None:
        """Radius of the site's patch, m; None for a point."""
        return self.radius

    def modal(self) -> ModalBody:
        """The model as the body of an impact."""
        return self.body


@collective()
@within_range
@one_thread()
def superposition(
    structure: Structure,
    site: Site,
    n: int,
    *,
    static_correction: bool = False,
    damping: float | Sequence[float] | Damping | None = None,
) -> SuperpositionModel:
    """The first n natural modes that move the site, the rigid-body mode included.

    Parameters
    ----------
    structure : Structure
    site : Site
    n : int
        Number of modes; fewer if the structure has fewer. Modes with a node at the site are not
        counted; modes of equal frequency count as one.
    static_correction : bool
        Add the static compliance of the truncated modes (a massless contact point).
    damping : float, sequence of float, or Damping, optional
        As in `extract`.

    Raises
    ------
    InputError, NotConvergedError, AccuracyError
        As `extract`.
    """
    n = whole("n", n)
    flag("static_correction", static_correction)
    checked_damping = as_damping(damping)
    at_site = _ModesAtSite(structure, site)
    if n > structure.dofs:
        raise InputError(f"n must be at most the structure's {structure.dofs} dofs; got {n}.")

    solver = ModeSolver(structure)
    most = SEARCH_FACTOR * (n + DEFAULT_COUNT)
    modes = solver.lowest(
        n + 2, lambda modes: len(at_site.observable(modes, COUNTED_SHARE).omega) >= n, most
    )
    visible = at_site.observable(modes, COUNTED_SHARE)
    if len(visible.omega) < n and not modes.complete:
        message = (
            f"only {len(visible.omega)} of the first {len(modes.omega)} modes are observable at "
            f"the site, fewer than n = {n}: the model contains these."
        )
        on_root(structure.comm, partial(warn, message, AccuracyWarning))

    selected = Modes(visible.omega[:n], visible.phi[:, :n], len(visible.omega) <= n)
    all_kept = selected.complete and len(modes.omega) == solver.limit
    return at_site.model(selected, static_correction and not all_kept, checked_damping)


@collective()
@within_range
@one_thread()
def full(
    structure: Structure, site: Site, *, damping: float | Sequence[float] | Damping | None = None
) -> SuperpositionModel:
    """The unreduced model: all natural modes; dofs without mass give a residual compliance.

    `damping` as in `extract`.

    Raises
    ------
    InputError
        More dofs than a dense eigensolver can treat; several MPI ranks.
    """
    instance("structure", structure, Structure, "a Structure")
    if structure.dofs > MOST_DENSE_ROWS or structure.comm.size > 1:
        raise InputError(
            f"full() takes at most {MOST_DENSE_ROWS} dofs on one rank; got {structure.dofs} on "
            f"{structure.comm.size} rank(s): use a coarser mesh, superposition() or extract()."
        )

    checked_damping = as_damping(damping)
    at_site = _ModesAtSite(structure, site)
    solver = ModeSolver(structure)
    modes = solver.lowest(structure.dofs)
    massless = len(modes.omega) < solver.limit  # such motions have no mode, but a compliance
    model = at_site.model(at_site.observable(modes, UNOBSERVABLE_SHARE), massless, checked_damping)
    return replace(model, info=model.info.having(method="full"))


class _ModesAtSite:
    """Natural modes of a structure without dampers, and their displacements at one site."""

    def __init__(self, structure: Structure, site: Site) -> None:
        instance("structure", structure, Structure, "a Structure")
        instance("site", site, Site, "a Site(point, direction)")
        refuse_dampers(structure, "a model of natural modes")
        self._structure = structure
        self._comm = structure.comm
        self._where = functional(structure, site)
        self._solver = structure.factorize(EQUIVALENT_SITES)
        self._static = static = site_shapes(structure, self._solver, self._where.b[:, None])

        # M-orthonormal rigid-body modes (rows, r), displacements >= 0 of the site in them
        a = np.append(static.rigid[0], np.zeros(static.nodal.shape[1]))
        self._rigid = static.rigid_shapes * np.where(a < 0, -1.0, 1.0)
        self._a = np.abs(a)

    def observable(self, modes: Modes, tol: float) -> Modes:
        """Modes with receptance shares above `tol`, rigid ones first; equal frequencies merged."""
        check_modes(self._structure, modes)
        moves_site = self._a != 0
        b = np.append(self._a.sum(), dot(self._comm, modes.phi, self._where.b))
        shares = receptance_shares(b, np.append(0.0, modes.omega**2))
        visible = shares[1:] > tol
        omega = modes.omega[visible]
        b = b[1:][visible]
        phi = modes.phi[:, visible]

        if len(omega):
            start = np.flatnonzero(np.diff(omega, prepend=-np.inf) > REPEATED_DISTANCE * omega)
            size = np.sqrt(np.add.reduceat(b**2, start))
            phi = np.add.reduceat(phi * b, start, axis=1) / size
            omega = omega[start]

        omega = np.append(np.zeros(int(moves_site.sum())), omega)
        return Modes(omega, np.hstack([self._rigid[:, moves_site], phi]), modes.complete)

    def model(
        self, modes: Modes, static_correction: bool, damping: Damping | None
    ) -> SuperpositionModel:
        """The model of `modes`, all of which must move the site."""
        structure, where = self._structure, self._where
        b = np.asarray(dot(self._comm, modes.phi, where.b))
        hidden = self._rigid[:, self._a == 0]
        if structure.rigid_inertia is None:
            hidden = hidden[:, :0]
        phi = np.hstack([hidden, modes.phi])
        omega = np.append(np.zeros(hidden.shape[1]), modes.omega)

        basis: tuple[Array, ...] = (hidden, modes.phi)
        r, shape, residual = 0.0, None, None
        if static_correction:
            r, deflection = self._static_remainder(modes, b)
        if r > 0:  # the massless deflection is one more shape, its amplitude the force
            basis = (*basis, deflection[:, None])
            shape = np.eye(len(omega) + 1, len(omega))
            residual = np.eye(len(omega) + 1)[-1]

        load = None if where.direction is None else structure.uniform_inertia(where.direction)
        body = ModalBody(
            omega,
            np.append(np.zeros(hidden.shape[1]), b),
            r,
            decay=None if damping is None else damping.decay(omega),
            weight=None if load is None else np.asarray(dot(self._comm, phi, load)),
            shape=shape,
            residual=residual,
            basis=basis,
            direction=where.direction,
            inertia=inertia_of(structure, phi),
        )
        info = UNKNOWN_INFO.having(
            structure=structure.describe(),
            dofs=structure.dofs,
            method="superposition",
            converged=len(modes.omega),
            point=None if where.point is None else where.point.tolist(),
        )
        patch = where.local_compliance, where.radius
        return SuperpositionModel(modes.omega, b, modes.phi, body, *patch, damping, info)

    def _static_remainder(self, modes: Modes, b: Array) -> tuple[float, Array]:
        """(compliance [m/N], shape) of the part of the static deflection that `modes` lack."""
        structure, where = self._structure, self._where
        elastic = self._static.y[:, 0] / self._static.W[0, 0]
        if structure.rigid_modes.shape[1]:
            elastic = elastic_response(structure, self._solver, where.B)[:, 0]
        compliance = float(dot(self._comm, where.b, elastic))
        poles = np.where(modes.omega > 0, modes.omega, np.inf) ** 2
        r = compliance - float(np.sum(b**2 / poles))
        if r <= RESIDUAL_ROUNDING * compliance:
            return 0.0, np.zeros_like(elastic)
        return r, elastic - modes.phi @ (b / poles)
