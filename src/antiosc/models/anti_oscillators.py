r"""The anti-oscillator model of a structure: N one-degree-of-freedom systems on a residual mass.

At one site:

F -> [m0] lambda_0 --k1-- [m1] lambda_1        Article Fig. 1: the contact force F acts on the
      |   \---k2-- [m2] lambda_2               residual mass m0, whose displacement lambda_0 is
      k0    ...                                 that of the impact site; mass m_i hangs on m0 by
    ground  \--kN-- [mN] lambda_N               k_i = omega_i^2 m_i.

At p sites k0, m0 and m_i are matrices (p, p), and m_i = P_i P_i' has rank one: P_i (p,) is the
inertial coupling of constraint mode i (all sites fixed, unit mass) to unit accelerations of the
sites.

Models are saved in NumPy files (`.npz`) with a header in JSON. Such files are untrusted: they are
read without pickles, and no array is larger than its stored bytes.

With the displacements u (p,) of the sites and the amplitudes η (N,) of the constraint modes of unit
mass (Craig and Bampton, AIAA J. 6 (1968) 1313), the matrices of a reduced model are

    K = diag(k0, ω_i²),    M = [[m_st, P], [Pᵀ, 1]],    P_i Pᵀ_i = m_i,

so that eliminating η gives Z(ω). One site has P_i = √m_i.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, TypeGuard

import numpy as np

from antiosc.base import archives, checks, files
from antiosc.base._types import Array, ArrayLike, IntArray, Numbers
from antiosc.base.archives import Arrays
from antiosc.base.errors import AccuracyWarning, InputError, warn, without_warnings
from antiosc.base.texts import FieldsRepr, ReprMixin, engineering
from antiosc.engine.contact.curvature import CURVED
from antiosc.engine.contact.surfaces import Surface, matter_of
from antiosc.engine.damping import DampingMatrix, from_factors, in_coordinates
from antiosc.models import parameters, reduced_modes
from antiosc.models.body import ModelInfo, several_sites_message
from antiosc.models.modal import Damping, ModalBody, SiteModes
from antiosc.models.motion import Inertia
from antiosc.models.parameters import (
    Parameters,
    checked_parameters,
    converted_participation,
    sorted_damping,
)
from antiosc.models.stretch import Stretch

if TYPE_CHECKING:
    from matplotlib.figure import Figure


FORMAT_NAME = "antiosc-model"
#: the only version that is read
FORMAT_VERSION = 4

#: Most bytes of a file's arrays. Each of a million anti-oscillators takes 8 MB.
_LARGEST_FILE = 2**27
#: Deepest brackets of a header: half of what Python's parser takes.
_DEEPEST_HEADER = 400

#: what JSON has by name
NamedValues: TypeAlias = dict[str, Any]


def write_model_file(
    path: str | os.PathLike[str], header: Mapping[str, object], arrays: Arrays
) -> None:
    """Write a file of a JSON header and arrays atomically."""
    try:
        text = json.dumps(header)
    except (TypeError, ValueError, RecursionError) as error:
        raise InputError(f"model.info must hold JSON values only: {error}.") from None

    if checks.nests_deeper(text, _DEEPEST_HEADER):
        raise InputError(f"model.info must nest at most {_DEEPEST_HEADER - 1} levels; flatten it.")
    archives.write_arrays(path, {"header": np.array(text), **arrays}, "the model")


def read_model_file(
    path: str | os.PathLike[str],
    needed: set[str],
    expected: str = FORMAT_NAME,
    largest: int = _LARGEST_FILE,
) -> tuple[NamedValues, Arrays]:
    """(header, arrays) of a model file; InputError if it lacks an array in `needed`."""
    source = checks.path("path", path)
    files.check_readable(source, "a model")
    file_text = f"an {expected} file"
    arrays = archives.read_arrays(source, largest, file_text)

    try:
        text = str(arrays.pop("header"))
        if checks.nests_deeper(text, _DEEPEST_HEADER):
            raise InputError(f"{path} is not {file_text}, or it is damaged.")
        header = json.loads(text)
        found = header["format"], header["version"]
    except (KeyError, TypeError, ValueError, RecursionError):
        raise InputError(f"{path} is not {file_text}, or it is damaged.") from None

    if found != (expected, FORMAT_VERSION):
        raise InputError(
            f"{path} has the format {checks.shown(found[0])} of version {checks.shown(found[1])}; "
            f"{expected!r} of version {FORMAT_VERSION} is read: write it again."
        )

    missing_names = needed - arrays.keys()
    if missing_names:
        raise InputError(f"{path} lacks {', '.join(sorted(missing_names))}; write it again.")
    return header, arrays


#: Arrays of a model, those of its inertia and of its second-order forces.
_MODEL_ARRAYS = (
    *("m0", "k0", "m", "omega", "P", "participation", "direction", "dependence", "rigid"),
    *("strain_error", "strain_misfit"),
)
_ARRAYS_OF_PART = {
    "inertia": ("point", "matrix", "momentum"),
    "stretch": ("modes", "quadratic", "cubic"),
    "recurrence": ("k0", "mass", "start", "H", "scalars"),
}


def save_model(model: Parameters, path: str | os.PathLike[str]) -> None:
    """Write a model to a file atomically; see `AntiOscillators.save`."""
    arrays = {name: getattr(model, name) for name in _MODEL_ARRAYS}
    if model.sites:  # of which it follows
        del arrays["m"]
    for part, names in _ARRAYS_OF_PART.items():
        arrays |= {f"{part}.{name}": getattr(getattr(model, part), name, None) for name in names}
    local = np.asarray(model.local_compliance).tolist()
    header = {
        "format": FORMAT_NAME,
        "version": FORMAT_VERSION,
        "local_compliance": local,
        "radius": model.radius,
        "stretch": None if model.stretch is None else model.stretch.count,
        "damping": None if model.damping is None else model.damping.as_dict(),
        "info": model.info.as_dict(),
        "sites": list(model.sites),
        "columns": {name: list(columns) for name, columns in model.columns.items()},
    }
    known = {name: np.asarray(values) for name, values in arrays.items() if values is not None}
    write_model_file(path, header, known)


def saved_arguments(path: str | os.PathLike[str]) -> NamedValues:
    """The arguments of `AntiOscillators` in a model file; InputError for other files."""
    header, arrays = read_model_file(path, {"m0", "k0", "omega"})

    try:
        inertia, stretch, recurrence = (
            [arrays[key] for name in names if (key := f"{part}.{name}") in arrays]
            for part, names in _ARRAYS_OF_PART.items()
        )
        loaded = None
        if recurrence:
            from antiosc.models.recurrence import Recurrence  # loaded where it is used

            k0, mass, start, H, scalars = recurrence
            n, shift = checks.floats("scalars", scalars, (2,)).tolist()
            loaded = Recurrence(k0, mass, start, H, int(n), shift)

        return {
            **{name: arrays.get(name) for name in _MODEL_ARRAYS},
            "inertia": Inertia(*inertia) if inertia else None,
            "stretch": Stretch(*[*stretch, header["stretch"]]) if stretch else None,
            "recurrence": loaded,
            "damping": _loaded_damping(header["damping"]),
            "info": ModelInfo.of(header["info"]),
            "sites": tuple(header["sites"]),
            "columns": dict(header["columns"]),
            "local_compliance": header["local_compliance"],
            "radius": header["radius"],
        }
    except (InputError, KeyError, TypeError, ValueError) as error:
        raise damaged_file(path, error) from error


def damaged_file(path: str | os.PathLike[str], error: Exception) -> InputError:
    """InputError for a model file with inconsistent values."""
    return InputError(
        f"{path} contains no valid model; its numbers are damaged or edited: "
        f"{str(error).rstrip('.')}."
    )


def _loaded_damping(values: NamedValues | None) -> Damping | DampingMatrix | None:
    """The damping described in the header of a model file."""
    if values is None:
        return None

    if "factor" not in values:
        with without_warnings():  # a file has what was told before
            return Damping(**values)
    size = int(values["n"])

    def factor(rows: ArrayLike) -> Array:
        """The factor (n, `size`) of a damping matrix, from its stored `rows`."""
        return checks.floats("factor", np.reshape(rows, (-1, size)), (None, size))

    branches = [(factor(L), checks.positive("tau", tau, "s")) for L, tau in values["branches"]]
    return from_factors(factor(values["factor"]), branches)


@dataclass(frozen=True, eq=False, repr=False)
class ReducedMatrices(FieldsRepr):
    """K and M of a reduced model."""

    #: K, M: (n, n) N/m and kg, the dofs of the sites first, then one for each anti-oscillator
    K: Array
    M: Array
    #: (n, 2) numbers of the node and the dof of each row: dof 1 to 6 for x, y, z, rx, ry, rz, 0 for
    #: scalar points; anti-oscillators are scalar points, numbered after the last node of the sites
    labels: IntArray

    def save(self, path: str | os.PathLike[str]) -> list[Path]:
        """Write K and M as Matrix Market, `<name>_K.mtx` and `<name>_M.mtx`, beside `<name>.map`.

        `path`: `<name>.mtx`. `Structure.from_files(K, M, map=…)` reads them. Returns the files,
        each complete or absent; InputError for another ending, or a file that cannot be written.
        """
        target = checks.path("path", path)
        if target.suffix.lower() != ".mtx":
            raise InputError(f"matrices are written to .mtx; got {target.name!r}.")

        from scipy.io import mmwrite  # takes long to load
        from scipy.sparse import coo_matrix

        written = []
        for letter, matrix in (("K", self.K), ("M", self.M)):
            file = target.with_name(f"{target.stem}_{letter}.mtx")
            with files.atomic_file(file, "the matrices") as part, part.open("wb") as stream:
                mmwrite(stream, coo_matrix(matrix), precision=17, symmetry="symmetric")
            written.append(file)

        rows = "".join(f"{node} {component}\n" for node, component in self.labels)
        files.write_text(target.with_suffix(".map"), "# node dof\n" + rows, "the map")
        return [*written, target.with_suffix(".map")]


def reduced_matrices(
    stiffness: Array,
    static_mass: Array,
    P: Array,
    omega: Array,
    nodes: int | Sequence[int] | None = None,
    dofs: int | str | Sequence[int | str] = 0,
) -> ReducedMatrices:
    """K and M (p + N, p + N) from k0, m_st (p, p), P (p, N) and omega (N,) [rad/s]; `nodes` and
    `dofs` name the rows of the sites."""
    from scipy.linalg import block_diag  # takes long to load

    from antiosc.io.matrices import component_number

    K = block_diag(stiffness, np.diag(omega**2))
    M = np.block([[static_mass, P], [P.T, np.eye(len(omega))]])
    sites = len(stiffness)

    # the sites
    given = range(1, sites + 1) if nodes is None else nodes
    of_nodes, of_dofs = (np.ravel(np.array(one, dtype=object)) for one in (given, dofs))
    numbers = [checks.whole("nodes", node, least=1) for node in of_nodes]
    components = [component_number(dof) for dof in of_dofs]
    components = components * sites if len(components) == 1 else components
    if len(numbers) != sites or len(components) != sites:
        raise InputError(
            f"nodes and dofs must name {sites} site dofs; got {len(numbers)} and {len(components)}."
        )

    # scalar points after the last of them
    last = max(numbers)
    if last + len(omega) >= 2**31:
        raise InputError(f"numbers of nodes must be below 2^31; got {last}.")
    scalars = [(last + k, 0) for k in range(1, len(omega) + 1)]
    labels = np.array([*zip(numbers, components, strict=True), *scalars], dtype=np.int64)
    if len(np.unique(labels, axis=0)) < len(K):
        raise InputError("nodes and dofs name one dof twice.")
    return ReducedMatrices(K, M, labels)


@dataclass(frozen=True, eq=False, repr=False)
class AntiOscillators(ReprMixin, Parameters):
    """Anti-oscillator model of a structure at one impact site along one direction, or at several.

    Text after "Several:" applies to models of several sites. Their displacements u (p,) are the
    `columns` that can move independently of each other, usually all of them: one for each site, and
    two more for a site with tangential directions.

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
        Half-space compliance of the patch [m/N], contained in 1/k0. As Hertz's law contains it
        too, `simulate` subtracts it from the contact law. Several: one for each site.
    radius : float, optional
        Radius of the patch [m]; None for a point. Several: one for each site.
    participation : array_like, shape (N + 1,), optional
        Generalised masses [kg] for a unit uniform acceleration e along the impact direction:
        phi_0^T M e for the residual mode, then psi_i^T M e. Needed for gravity on a structure
        with a rigid-body mode. Several: (p + N, 3), for the shapes along the three axes.
    shapes : array_like, shape (n_dofs, N + 1), optional
        Columns psi_0 = phi_st and psi_i = c_i phi_i of Article eq. (9); not saved to files.
        Several: (n_dofs, p + N), p shapes of unit displacement and N of unit mass.
    direction : array_like, shape (3,), optional
        Unit vector of the direction of impact, in the axes of the mesh. Several: (C, 3), one for
        each column.
    inertia : Inertia, optional
        For a structure with rigid-body modes: the momentum (N + 1 + h, 6) of unit amplitudes of
        psi_0 ... psi_N and of the h hidden rigid-body motions (mass-normalised), which do not move
        the site. The contact force does not act on hidden motions; initial velocity and gravity do.
    hidden : array_like, shape (n_dofs, h), optional
        Shapes of the h hidden motions; not saved to files.
    damping : Damping or DampingMatrix, optional
        Damping of each free mode, or a matrix that couples the free modes.
    info : ModelInfo, or dict
        Record of the extraction (`antiosc.models.body`).
    P : array_like, shape (p, N), optional
        Several sites: inertial couplings [kg^1/2] of the constraint modes, instead of `m`.
    sites : sequence of str
        Names of several sites; () for one site without a name.
    columns : mapping, optional
        Name of a site -> numbers of its columns (of C in all), first the normal, then the
        tangential ones; default: one column for each site, in order.
    dependence : array_like, shape (C, p), optional
        Displacements of all columns for unit displacements u; default: identity.
    rigid : array_like, shape (p, q), optional
        Displacements u of several sites in the rigid-body modes of unit mass that move them;
        default: from the null vectors of k0.
    strain_error : array_like, shape (N + 1, N + 1), optional
        Strain energies [N/m] of the discretisation errors of psi_0 ... psi_N, estimated by
        `extract(..., error="estimate")`; see `corrected`. Several: (p + N, p + N), of the shapes.
    strain_misfit : array_like, of the same shape, optional
        For shells with `strain_error`: work [N/m], of either sign, of the section forces of one
        shape on the change that the elements' strain interpolation makes in another's strains.
    stretch : Stretch, optional
        Second-order forces of some free modes, by `extract(..., stretch=...)`.
    recurrence : Recurrence, optional
        Data that bound the motion that the model leaves out, from `extract(..., proof=...)`.

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
        checks.instance("sites", self.sites, (list, tuple), "names")
        as_passed = self.omega
        checks.store(self, **checked_parameters(self))
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
        """The model with the `n` lowest anti-oscillators; m0 takes the mass of the others."""
        n = checks.whole("n", n, least=0)
        if n > self.n:
            raise InputError(f"n must be <= {self.n}, the number of anti-oscillators; got {n}.")
        n_sites = self.n_sites
        left_out = np.arange(n_sites + n, n_sites + self.n)
        damping = self.damping
        if self.stretch is not None:
            raise InputError(
                "a model that stretches keeps all anti-oscillators: extract it without stretch,"
                " or with fewer."
            )

        if isinstance(damping, DampingMatrix):
            remaining = np.delete(np.arange(damping.n), left_out)
            damping = in_coordinates(damping, np.eye(damping.n)[:, remaining])
        inertia, weights = (
            self.inertia,
            converted_participation(self.participation, self.sites, 1.0),
        )
        if weights is not None:
            weights = converted_participation(
                np.delete(weights, left_out, axis=0), self.sites, -1.0
            )
        kept = slice(n_sites + n)
        errors: dict[str, Any] = {
            name: None if (E := getattr(self, name)) is None else E[kept, kept]
            for name in ("strain_error", "strain_misfit")
        }

        return replace(
            self,
            m0=self.m0 + self.m[n:].sum(axis=0),
            m=self.m[:n],
            P=None if self.P is None else self.P[:, :n],
            omega=self.omega[:n],
            damping=damping,
            participation=weights,
            shapes=None if self.shapes is None else self.shapes[:, kept],
            inertia=inertia and inertia.along(np.delete(inertia.momentum, left_out, axis=0)),
            **errors,
        )

    def corrected(self) -> AntiOscillators:
        """The model softened by its `strain_error`: closer to the exact structure.

        The excess stiffness of the mesh is removed for all shapes together
        (`antiosc.models.parameters`); the masses of the shapes do not change. A shell that is too
        soft because of its `strain_misfit` is stiffened. The remaining error is unknown.

        Raises
        ------
        InputError
            For a model that was extracted without `error="estimate"`.
        """
        softened = parameters.softened_model(self)
        if self.stretch is None:
            return softened
        return replace(softened, stretch=self._stretch_of_corrected(self.stretch))

    def _stretch_of_corrected(self, stretch: Stretch) -> Stretch:
        """Second-order forces of the same motions, in terms of the corrected model's free modes."""
        # the motions are expressed in the shapes of this model
        shapes = np.eye(self.n_sites + self.n)
        raw = replace(self, stretch=None, inertia=None, hidden=None, shapes=shapes)
        before = raw.free_modes
        after = parameters.softened_model(raw).free_modes
        assert before.shape is not None
        assert after.shape is not None
        motions = before.field((before.shape @ stretch.modes).T).T
        modes = np.linalg.lstsq(after.field(after.shape.T).T, motions, rcond=None)[0]
        left, _, right = np.linalg.svd(modes, full_matrices=False)
        return replace(stretch, modes=left @ right)

    def field(self, coordinates: ArrayLike) -> Array:
        """Nodal displacements (..., n_dofs) of Article eq. (8) for lambda (..., N + 1).

        Amplitudes of the h hidden motions may follow lambda, (..., N + 1 + h); default: 0. Several
        sites: coordinates u and amplitudes of the constraint modes of unit mass, (..., p + N).
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
        """This model with a material at its sites, by which `contact="auto"` chooses a law.

        For models whose surface is not known from a mesh: measured, from matrices, in closed form.

        Parameters
        ----------
        material : a name, or a `Solid`.
        radius : radius of the surface at the sites [m]; inf: a flat face.

        Raises
        ------
        InputError
            An unknown name, an anisotropic material, a radius that is not positive.
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

        With `path` (PNG, PDF, SVG, …) the picture is written and the path is returned.
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
        """A model of several sites in its free modes, for a scene.

        Its coordinates are u (p,), the amplitudes of the constraint modes (N,) and of the hidden
        motions.
        """
        if not self.sites:
            raise InputError("this model has one site: modal() is its form in free modes.")
        assert isinstance(self.free_modes, SiteModes)
        return self.free_modes

    @cached_property
    def free_modes(self) -> ModalBody | SiteModes:
        """The model in its free modes: `modal()` of one site, `site_modes()` of several."""
        return reduced_modes.free_modes(self)

    def to_matrices(
        self, nodes: int | Sequence[int] | None = None, dofs: int | str | Sequence[int | str] = 0
    ) -> ReducedMatrices:
        """K and M of the undamped model as a superelement, with the dofs of the sites first.

        Damping is left out, with a warning, and so are hidden rigid-body motions, which do not
        move the sites.

        Parameters
        ----------
        nodes : int or sequence of int, optional
            Numbers of the nodes of the sites in the other program; default 1, 2, ….
        dofs : int, str or sequence
            Their dofs: "x" … "rz", 1 to 6, or 0 for scalar points.

        Raises
        ------
        InputError
            Numbers that do not fit the sites; sites that do not move independently.
        """
        if self.damping is not None:
            warn("the damping of the model is left out of its matrices.", AccuracyWarning)

        if self.dependence is not None and len(self.dependence) != self.n_sites:
            raise InputError("some sites follow from others: extract a model without them.")

        m_st = np.atleast_2d(self.m_st)
        return reduced_matrices(self.k0_matrix, m_st, self.inertias, self.omega, nodes, dofs)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the model to one NumPy .npz file with a header in JSON.

        The file is written atomically. Shapes are not stored. InputError if writing fails.
        """
        save_model(self, path)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> AntiOscillators:
        """Read a model written by `save`; InputError for any other file."""
        arguments = saved_arguments(path)
        try:
            return cls(**arguments)
        except (InputError, KeyError, TypeError, ValueError) as error:
            raise damaged_file(path, error) from error


def is_reduced(model: object) -> TypeGuard[AntiOscillators]:
    """Whether a model is from the Krylov method and has unconverged anti-oscillators."""
    if not isinstance(model, AntiOscillators) or model.info.method != "krylov":
        return False
    return model.info.converged is not None and model.info.converged < model.n
