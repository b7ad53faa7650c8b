"""The anti-oscillator model of a structure: N one-degree-of-freedom systems on a residual one.

At one site:

F -> [m0] lambda_0 --k1-- [m1] lambda_1        Article Fig. 1: the contact force F acts on the
      |   \\---k2-- [m2] lambda_2               residual mass m0, whose displacement lambda_0 is
      k0    ...                                 that of the impact site; mass m_i hangs on m0 by
    ground  \\--kN-- [mN] lambda_N               k_i = omega_i^2 m_i.

At p sites k0, m0 and m_i are matrices (p, p), m_i = P_i P_i' of rank one: P_i (p,) is the inertia
of the constraint mode i of unit mass, with all sites fixed, against unit accelerations of the
sites.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks
from antiosc.base._types import Array, Numbers
from antiosc.base.errors import AccuracyWarning, InputError, warn
from antiosc.base.texts import ReprMixin, engineering
from antiosc.engine.contact.curvature import CURVED
from antiosc.engine.contact.surfaces import Surface, matter_of
from antiosc.engine.damping import DampingMatrix, in_coordinates
from antiosc.models import model_file, parameters, reduced_modes
from antiosc.models.body import ModelInfo, several_sites_message
from antiosc.models.modal import Damping, ModalBody, SiteModes
from antiosc.models.model_file import ReducedMatrices, reduced_matrices
from antiosc.models.parameters import (
    Parameters,
    checked_at_one_site,
    checked_at_sites,
    sorted_damping,
)
from antiosc.models.stretch import Stretch

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False, repr=False)
class AntiOscillators(ReprMixin, Parameters):
    """Anti-oscillator model of a structure at one impact site along one direction, or at several.

    What follows "Several:" applies to models of several sites. Their displacements u (p,) are those
    of `columns` that can move independently of each other, usually all: one for each site, and two
    more for a site with tangential directions.

    Parameters
    ----------
    m0 : float
        Residual mass [kg], >= 0; 0 is a massless contact point. Several: (p, p), positive
        semidefinite.
    k0 : float
        Static stiffness at the site [N/m]; 0 if a rigid-body mode moves the site. Several: (p, p),
        positive semidefinite.
    m, omega : array_like, shape (N,)
        Masses [kg], > 0, and circular frequencies [rad/s], > 0, of the anti-oscillators.
        They are sorted by frequency. N may be 0: the classical one-degree-of-freedom model.
        Several: m follows from P, m_i = P_i P_i' (N, p, p).
    local_compliance : float
        Half-space compliance of the patch [m/N], contained in 1/k0. Hertz's law contains it as
        well, so `simulate` subtracts it from the contact law. Several: one for each site.
    radius : float, optional
        Radius of the patch [m]; None for a point. Several: one for each site.
    participation : array_like, shape (N + 1,), optional
        Generalised masses [kg] of a unit uniform acceleration along the impact direction:
        phi_0^T M e for the residual mode, then psi_i^T M e. Needed for gravity on a structure
        with a rigid-body mode. Several: (p + N, 3), of the shapes along the three axes.
    shapes : array_like, shape (n_dofs, N + 1), optional
        Columns psi_0 = phi_st and psi_i = c_i phi_i of Article eq. (9); not saved to files.
        Several: (n_dofs, p + N), the p shapes of unit displacements and the N of unit mass.
    direction : array_like, shape (3,), optional
        Unit vector of the direction of impact, in the axes of the mesh. Several: (C, 3), of the
        columns.
    inertia : Inertia, optional
        For a structure with rigid-body modes: the momentum (N + 1 + h, 6) of unit amplitudes of
        psi_0 ... psi_N and of the h hidden rigid-body motions (mass-normalised), which do not move
        the site. The contact force does not act on them; initial velocity and gravity do.
    hidden : array_like, shape (n_dofs, h), optional
        Shapes of those h motions; not saved to files.
    damping : Damping or DampingMatrix, optional
        Damping of the free modes, each for itself, or a matrix that couples them.
    info : ModelInfo, or dict
        Record of the extraction (`antiosc.models.body`).
    P : array_like, shape (p, N), optional
        Several sites: inertias [kg^1/2] of the constraint modes, in place of `m`.
    sites : sequence of str
        Names of several sites; () for the one site without a name.
    columns : mapping, optional
        Name of a site -> its columns among C, the normal one first, then tangential ones; default:
        one column each, in order.
    dependence : array_like, shape (C, p), optional
        Displacements of all columns for unit displacements u; default: the columns are u.
    rigid : array_like, shape (p, q), optional
        Displacements u of several sites in the rigid-body modes of unit mass that move them;
        default: from the null vectors of k0.
    strain_error : array_like, shape (N + 1, N + 1), optional
        One site: energies [N/m] of the errors of the strains of psi_0 ... psi_N that the mesh
        leaves, by `extract(..., error="estimate")`; see `corrected`.
    strain_misfit : array_like, shape (N + 1, N + 1), optional
        For shells with `strain_error`: work [N/m] of the section forces of one shape on the change
        of the strains of the other by the interpolation of the elements, of either sign.

    stretch : Stretch, optional
        Second-order forces of some free modes, by `extract(..., stretch=...)`.
    recurrence : Recurrence, optional
        What bounds the motion that the model leaves out, by `extract(..., proof=...)`.

    Raises
    ------
    InputError
        For masses, stiffnesses or frequencies outside their range, and mismatched shapes.
    """

    def __post_init__(self) -> None:
        if self.damping is not None:
            kinds = (Damping, DampingMatrix)
            checks.instance("damping", self.damping, kinds, "a Damping or a DampingMatrix")
        if self.stretch is not None:
            checks.instance("stretch", self.stretch, Stretch, "a Stretch, as extract makes it")
        checks.store(self, info=ModelInfo.of(self.info))
        as_passed = self.omega
        if self.P is not None or len(checks.instance("sites", self.sites, (list, tuple), "names")):
            for name in ("strain_error", "strain_misfit"):
                if getattr(self, name) is not None:
                    raise InputError(f"{name} belongs to a model of one site.")
            checks.store(self, **checked_at_sites(self))
        else:
            checks.store(self, **checked_at_one_site(self))
        if isinstance(self.damping, DampingMatrix):
            checks.store(self, damping=sorted_damping(self, self.damping, as_passed))

    def _facts(self) -> list[tuple[str, str]]:
        lowest = ", ".join(f"{w / (2 * np.pi):.5g}" for w in self.omega[:3])
        ellipsis = ", …" if self.n > 3 else ""
        frequencies = f"{self.n}, {lowest}{ellipsis} Hz" if self.n else "0"
        if self.sites:
            sites = ", ".join(self.sites)
            stiffest = engineering(np.max(self.k0.diagonal()), "N/m", 4)
            return [
                ("sites", sites if len(sites) <= 60 else f"{len(self.sites)}"),
                ("K0", f"{self.k0.shape}, at most {stiffest}"),
                ("anti-oscillators", frequencies),
            ]
        mass_share = 1 - self.m0 / self.m_st if self.m_st else 0.0
        return [
            ("k0", engineering(self.k0, "N/m", 4)),
            ("m_st", f"{engineering(self.m_st, 'kg', 4)}, {100 * mass_share:.2f} % of it captured"),
            ("anti-oscillators", frequencies),
            *([("from", self.info["structure"])] if "structure" in self.info else []),
        ]

    def dynamic_stiffness(self, omega: ArrayLike) -> Numbers:
        """Z(omega) = F/lambda_0 [N/m] of the undamped model under a harmonic force at the site.

        Z = k0 - omega^2 m0 - sum_i m_i omega^2 omega_i^2 / (omega_i^2 - omega^2). Its poles are
        the antiresonances, its zeros the free frequencies; at a pole the value is infinite.
        `omega` [rad/s] may be an array of any shape, real or complex. Several sites: the matrix of
        forces per displacement u, (..., p, p).
        """
        x = checks.spectrum("omega", omega) ** 2
        poles = self.omega**2
        with np.errstate(divide="ignore", invalid="ignore"):
            dynamic_mass = np.tensordot(poles / (poles - x[..., np.newaxis]), self.m, axes=1)
        if self.sites:
            x = x[..., np.newaxis, np.newaxis]
        return np.asarray(self.k0 - x * (self.m0 + dynamic_mass))

    def truncated(self, n: int) -> AntiOscillators:
        """The model with the `n` lowest anti-oscillators; the mass of the others returns to m0."""
        n = checks.whole("n", n, least=0)
        if n > self.n:
            raise InputError(f"n must be <= {self.n}, the number of anti-oscillators; got {n}.")
        n_sites = self.n_sites
        left_out = np.arange(n_sites + n, n_sites + self.n)
        damping = self.damping
        if self.stretch is not None:
            raise InputError(
                "a model that stretches keeps its anti-oscillators: extract it with fewer, or"
                " without stretch."
            )
        if isinstance(damping, DampingMatrix):
            remaining = np.delete(np.arange(damping.n), left_out)
            damping = in_coordinates(damping, np.eye(damping.n)[:, remaining])
        p = self.participation
        shapes = self.shapes
        inertia = self.inertia
        E = self.strain_error
        misfit = self.strain_misfit
        if p is not None:
            lumped_mass = 0.0 if self.sites else p[left_out].sum()
            p = np.delete(p, left_out, axis=0)
            p[0] += lumped_mass
        return replace(
            self,
            m0=self.m0 + self.m[n:].sum(axis=0),
            m=self.m[:n],
            P=None if self.P is None else self.P[:, :n],
            omega=self.omega[:n],
            damping=damping,
            participation=p,
            shapes=None if shapes is None else shapes[:, : n_sites + n],
            inertia=inertia and inertia.along(np.delete(inertia.momentum, left_out, axis=0)),
            strain_error=None if E is None else E[: n + 1, : n + 1],
            strain_misfit=None if misfit is None else misfit[: n + 1, : n + 1],
        )

    def corrected(self) -> AntiOscillators:
        """The model softened by its `strain_error`: closer to the exact structure.

        The excess stiffness of the mesh is removed, for all shapes together
        (`antiosc.models.parameters`); the masses of the shapes stay. A shell that is softer than
        the part for its `strain_misfit` is stiffened. The error that is left is unknown.

        Raises
        ------
        InputError
            For a model that was extracted without `error="estimate"`.
        """
        softened = parameters.corrected(self)
        if self.stretch is None:
            return softened
        return replace(softened, stretch=self._stretch_of_corrected(self.stretch))

    def _stretch_of_corrected(self, stretch: Stretch) -> Stretch:
        """The second-order forces for the free modes of the corrected model: the same motions."""
        shapes = np.eye(self.n + 1)  # the motions are expressed in the shapes of this model
        raw = replace(self, stretch=None, inertia=None, hidden=None, shapes=shapes)
        before = raw.free_modes
        after = parameters.corrected(raw).free_modes
        assert before.shape is not None
        assert after.shape is not None
        motions = before.field((before.shape @ stretch.modes).T).T
        modes = np.linalg.lstsq(after.field(after.shape.T).T, motions, rcond=None)[0]
        left, _, right = np.linalg.svd(modes, full_matrices=False)
        return replace(stretch, modes=left @ right)

    def field(self, coordinates: ArrayLike) -> Array:
        """Nodal displacements (..., n_dofs) of Article eq. (8) for lambda (..., N + 1).

        Hidden motions follow lambda, (..., N + 1 + h); without them they are at rest. Several
        sites: for u and the amplitudes of the constraint modes of unit mass, (..., p + N).
        """
        size = self.n_sites + self.n
        x = checks.floats("coordinates", coordinates, None)
        hidden = self.hidden_count
        if x.ndim == 0 or x.shape[-1] not in (size, size + hidden):
            raise InputError(
                f"coordinates must have {size} entries along their last axis, or {size + hidden}"
                f" with the hidden motions; got shape {x.shape}."
            )
        at_rest = np.zeros((*x.shape[:-1], size + hidden - x.shape[-1]))
        return self.free_modes.field(np.concatenate((x, at_rest), axis=-1))

    def with_surface(self, material: object, radius: float = inf) -> AntiOscillators:
        """This model with a material at its sites, from which `contact="auto"` takes the law.

        It is for a model without the surface of a mesh: measured, from matrices, in closed form.

        Parameters
        ----------
        material : a name, or a `Solid`.
        radius : radius of the surface at the sites [m]; inf: a flat face.

        Raises
        ------
        InputError
            A name that is not known, a material with directions, a radius that is not positive.
        """
        matter = matter_of(material)
        if matter is None:
            raise InputError("material must be a name or a Solid; got None.")
        surface = Surface(matter)
        if not checks.is_infinite(radius):
            bent = 1 / checks.positive("radius", radius, "m")
            surface = Surface(matter, (bent, bent), kind=CURVED)
        surfaces = dict.fromkeys(self.sites or ("",), surface.as_dict())
        return replace(self, info=replace(self.info, surfaces=surfaces))

    def plot(self, path: str | os.PathLike[str] | None = None) -> Figure | Path:
        """Dynamic stiffness and masses as a matplotlib figure; see `plotting.plot_model`.

        With `path` (PNG, PDF, SVG, …) the picture is written, and the path returned.
        """
        from antiosc.plot.charts import plot_model

        return plot_model(self, path)

    @property
    def patch_radius(self) -> float | None:
        """Radius of the site's patch, m; None for a point, and for several sites."""
        return None if self.sites else self.radius

    def modal(self) -> ModalBody:
        """The same model in its free modes.

        Its coordinates are lambda_0 ... lambda_N, then the amplitudes of the hidden motions.
        """
        if self.sites:
            raise InputError(several_sites_message("this model", self.sites))
        assert isinstance(self.free_modes, ModalBody)
        return self.free_modes

    def site_modes(self) -> SiteModes:
        """A model of several sites in its free modes, as a scene takes it.

        Its coordinates are u (p,), the amplitudes of the constraint modes (N,) and those of the
        hidden motions.
        """
        if not self.sites:
            raise InputError("this model has one site: modal() is its form in free modes.")
        assert isinstance(self.free_modes, SiteModes)
        return self.free_modes

    @cached_property
    def free_modes(self) -> ModalBody | SiteModes:
        """The model in its free modes: `modal()` of one site, `site_modes()` of several."""
        if self.sites:
            return reduced_modes.site_modes(self)
        return reduced_modes.modal(self)

    def to_matrices(
        self,
        nodes: int | Sequence[int] | None = None,
        dofs: int | str | Sequence[int | str] = 0,
    ) -> ReducedMatrices:
        """K and M of the undamped model, the dofs of the sites first: a superelement.

        A warning names damping of the model, which is left out. Hidden rigid-body motions,
        which do not move the sites, are left out.

        Parameters
        ----------
        nodes : int or sequence of int, optional
            Numbers of the nodes of the sites in the other program; default 1, 2, ….
        dofs : int, str or sequence
            Their dofs: "x" … "rz", 1 to 6, or 0 for scalar points.

        Raises
        ------
        InputError
            Numbers that do not fit the sites, or sites that depend on each other.
        """
        if self.damping is not None:
            warn("the damping of the model is left out of its matrices.", AccuracyWarning)
        if self.dependence is not None and len(self.dependence) != self.n_sites:
            raise InputError(
                "some sites follow from others: extract a model without them for its matrices."
            )
        P = np.sqrt(self.m)[None, :] if self.P is None else self.P
        k0 = np.atleast_2d(self.k0)
        m_st = np.atleast_2d(self.m_st)
        return reduced_matrices(k0, m_st, P, self.omega, nodes, dofs)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the model to one NumPy .npz file with a header in JSON.

        The file is complete or absent. Shapes are not stored. InputError where it cannot be
        written.
        """
        model_file.save(self, path)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> AntiOscillators:
        """Read a model written by `save`; InputError for any other file."""
        arguments = model_file.arguments(path)
        try:
            return cls(**arguments)
        except (InputError, KeyError, TypeError, ValueError) as error:
            raise model_file.damaged_file(path, error) from error
