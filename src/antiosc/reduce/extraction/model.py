"""The model of a group of sites, from its anti-oscillators and shapes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import AccuracyError, AccuracyWarning
from antiosc.fem.assembly import with_parts
from antiosc.fem.linalg.algebra import dot, multiply
from antiosc.fem.platform import warn
from antiosc.fem.structure.structure import Structure
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.body import UNKNOWN, ModelInfo
from antiosc.models.motion import Inertia
from antiosc.reduce.extraction import SiteShapes
from antiosc.reduce.extraction.eigenmodes import Modes, allowed, residuals
from antiosc.reduce.extraction.oscillators import ConstraintModes, Selection
from antiosc.reduce.site import Functional, surfaces

if TYPE_CHECKING:
    from mpi4py import MPI

    from antiosc.fem.structure.meshed import MeshedStructure


#: Sites of a model.
Sites = Mapping[str, Functional]
#: The name of the site of a model of one site without a name.
UNNAMED = ""


def info_of_model(
    structure: Structure, sites: Sites, known: ConstraintModes, selected: Selection, method: str
) -> ModelInfo:
    """The record of an extraction."""
    measured, converged = checked_modes(structure, known, method)
    info = info_of_places(structure, sites)
    return info.having(
        method=method,
        modes_computed=len(known.modes.omega),
        converged=converged,
        modes_unobservable=selected.unobservable,
        modes_merged=selected.merged,
        rigid_share=known.static.share,
        checks=measured,
        solver=known.static.solver.description,
        no_estimate=_no_estimate(structure),
    )


def info_of_places(structure: Structure, sites: Sites) -> ModelInfo:
    """What is known of a structure and its sites without modes."""
    cells = {name: site.cell for name, site in sites.items() if site.cell is not None}
    info = UNKNOWN.having(
        structure=structure.describe(),
        dofs=structure.dofs,
        rigid_modes=int(structure.rigid_modes.shape[1]),
        cells=cells or None,
        surfaces=surfaces(structure, sites),
        **structure.matrices.plausibility,
    )
    return replace(info, thickness=_thickness_at(structure, sites, info.thickness))


def _thickness_at(structure: Structure, sites: Sites, least: float | None) -> float | None:
    """The thickness of a sheet at its sites, whose deflection it judges; of others the `least`."""
    if least is None:
        return None
    from antiosc.reduce.site.surface import material_of  # given matrices do without meshes

    places = [site.place for site in sites.values()]
    materials = [material_of(place) for place in places if place is not None]
    found = [getattr(getattr(one, "section", None), "thickness", least) for one in materials]
    return min(found, default=least)


def _no_estimate(structure: Structure) -> str | None:
    """Why the mesh's error of a structure is not estimated; None if it is, or has no mesh."""
    if not (structure.matrices.meshed or structure.matrices.assembled):
        return None
    from antiosc.reduce.error.model_errors import refusal  # needs dolfinx

    return refusal(with_parts(structure)) or None


def model_of(
    structure: Structure,
    sites: Sites,
    static: SiteShapes,
    selected: Selection,
    info: ModelInfo,
) -> AntiOscillators:
    """The model of p >= 1 sites; the shapes of `selected` are changed in place."""
    directions = [site.directions for site in sites.values() if site.directions is not None]
    has_directions = len(directions) == len(sites)
    points = {name: x.point.tolist() for name, x in sites.items() if x.point is not None}

    P = static.W @ selected.P.T
    if UNNAMED in sites:  # m_i moves with its site: lambda_i = lambda_0 + an amplitude
        phi = selected.phi
        phi *= P[0]  # in place: as large as the shapes
    shapes = np.hstack([static.phi @ static.W.T, selected.phi])
    weights = weights_of(structure, shapes) if has_directions else None
    parameters: dict[str, Any] = {
        "m0": _in_site_basis(static.W, selected.m0),
        "k0": _in_site_basis(static.W, static.k0),
        "omega": selected.omega,
        "participation": weights,
        "direction": np.vstack(directions) if has_directions else None,
    }

    if UNNAMED in sites:
        (first,) = sites.values()
        parameters |= {name: float(parameters[name][0, 0]) for name in ("m0", "k0")}
        parameters |= {"m": P[0] ** 2, "local_compliance": first.local_compliance}
        parameters |= {"radius": first.radius, "direction": first.direction}
        if weights is not None:
            assert first.direction is not None
            along = weights @ first.direction
            along[0] -= along[1:].sum()
            parameters["participation"] = along
        info = info.having(meshed=structure.matrices.meshed)
        if points and first.direction is not None:
            info = replace(info, point=points[UNNAMED], direction=first.direction.tolist())
    else:
        parameters |= _of_sites(sites, static) | {"P": P}
        info = info.having(independent=static.kept.tolist())
        info = replace(info, points=points) if has_directions else info

    model = AntiOscillators(
        **parameters,
        shapes=shapes,
        inertia=inertia_of(structure, shapes, static.nodal),
        hidden=None if structure.rigid_inertia is None else static.nodal,
        info=info,
    )
    return _with_second_order(structure, model)


def _of_sites(sites: Sites, static: SiteShapes) -> dict[str, Any]:
    """Parameters that only a model of named sites has."""
    counts = [site.B.shape[1] for site in sites.values()]
    ends = np.cumsum(counts).tolist()
    return {
        "sites": tuple(sites),
        "columns": {
            name: tuple(range(end - count, end))
            for name, count, end in zip(sites, counts, ends, strict=True)
        },
        "dependence": static.dependence,
        "rigid": static.rigid,
        "local_compliance": np.array([site.local_compliance for site in sites.values()]),
        "radius": tuple(site.radius for site in sites.values()),
    }


def _with_second_order(structure: Structure, model: AntiOscillators) -> AntiOscillators:
    """The model with the relative change of its force per metre, for supported curved sheets."""
    single_mesh = structure.matrices.meshed and not structure.matrices.assembled
    supported = structure.rigid_modes.shape[1] == 0
    sites = model.sites or (UNNAMED,)
    k0 = np.atleast_2d(model.k0)
    if model.info.thickness is None or not (single_mesh and supported) or len(sites) != len(k0):
        return model
    part = cast("MeshedStructure", structure.matrices)
    if not part.kind.sheet:
        return model
    from antiosc.fem.elements.second_order import quadratic_share  # needs dolfinx

    assert model.shapes is not None
    C = np.linalg.inv(k0)
    deflections = model.shapes[:, : len(C)] @ C / C.diagonal()
    by_site = {
        site: quadratic_share(part, deflections[:, i], 1 / C[i, i]) for i, site in enumerate(sites)
    }
    if not any(by_site.values()):
        return model
    return replace(model, info=model.info.having(second_order=by_site))


def _in_site_basis(W: Array, matrix: Array) -> Array:
    """W matrix Wᵀ, without negative eigenvalues that are due to rounding."""
    values, vectors = np.linalg.eigh(matrix)
    factor = W @ (vectors * np.sqrt(np.maximum(values, 0.0)))
    return np.asarray(factor @ factor.T)


def inertia_of(structure: Structure, *shapes: Array) -> Inertia | None:
    """Inertia of a body that can move rigidly, with the momenta of the model's shapes; otherwise
    None.
    """
    if structure.rigid_inertia is None:
        return None
    inertia, loads = structure.rigid_inertia
    return inertia.along(np.vstack([dot(structure.comm, block, loads) for block in shapes]))


def weights_of(structure: Structure, shapes: Array) -> Array | None:
    """Generalised masses (k, 3) of shapes (rows, k) for unit uniform accelerations along x, y, z.

    They are None for matrices. A plane structure does not move along z.
    """
    loads = [structure.uniform_inertia(axis) for axis in np.eye(3)]
    if any(load is None for load in loads):
        return None
    return np.asarray(dot(structure.comm, shapes, np.column_stack(loads)))  # type: ignore[arg-type]


#: Limits of the self-check, relative: residual, M-orthogonality, constraint, mass balance.
CHECK = 1e-6
#: Up to this many times a limit a result is usable, with a warning; beyond, it is refused.
USABLE = 100
#: Limit of the residual: rounding in K alone is 1e-6 of Kφ for a mode on soft springs, with little
#: strain; the error of ω² is the square of it.
FORCES = 1e-5
#: ω² over the shift below which a mode is a mechanism: the shift has the size of the first elastic.
MECHANISM = 1e-9
#: A Ritz pair with a smaller residual (of forces, relative) is an antiresonance: its frequency is
#: then right to about the square of this.
CONVERGED = 1e-3


def check_limit(name: str, value: float, limit: float, comm: MPI.Comm) -> None:
    """Warn of a measured error above `limit`; AccuracyError for one above USABLE times `limit`."""
    if value <= limit:
        return
    reason = (
        "the matrices are ill-conditioned by very slender or thin parts, penalties, very uneven "
        "elements or materials: take fewer elements, more even ones, smaller penalties."
    )
    if not value <= USABLE * limit:
        raise AccuracyError(
            f"the constraint modes fail their own check: {name} {value:.1e}, limit "
            f"{USABLE * limit:.0e}; {reason}"
        )
    warn(
        comm,
        f"the constraint modes satisfy their check only to {value:.1e} ({name}, usually below "
        f"{limit:.0e}): {reason}",
        AccuracyWarning,
    )


def checked_modes(
    structure: Structure, known: ConstraintModes, method: str
) -> tuple[dict[str, float], int]:
    """Check constraint modes in their equations; AccuracyError for errors far above CHECK.

    Ritz pairs may have large residuals, but must be orthogonal in K and in M.

    Returns
    -------
    The measured errors by name, and the number of modes that have converged.
    """
    modes = known.modes
    static = known.static
    comm = structure.comm
    if len(modes.omega) and modes.omega[0] ** 2 < MECHANISM * structure.shift:
        raise AccuracyError(
            f"the structure moves without strain (ω = {modes.omega[0]:.1e} rad/s) but not as a "
            "rigid body: some part is attached by a hinge, a single common point or line; join it "
            "along a face."
        )
    residual_forces = known.off
    scale = np.sqrt(modes.omega**2 + structure.shift)
    projection = (known.stiffnesses - np.diag(modes.omega**2)) / np.outer(scale, scale)
    strain = dot(comm, static.phi, multiply(structure.K, static.phi)) - static.k0
    sites = np.sqrt((static.k0 + structure.shift * static.mass).diagonal())
    equation = {"residual": residual_forces} if method == "modes" else {"projection": projection}
    measured = {
        **{name: float(np.abs(value).max(initial=0.0)) for name, value in equation.items()},
        "orthogonality": float(
            np.abs(known.masses - np.eye(len(residual_forces))).max(initial=0.0)
        ),
        "constraint": _displacement(comm, static.load, modes.phi),
        "mass": _excess(static.mass, known.P),
        "stiffness": float(np.abs(strain / np.outer(sites, sites)).max()),
    }
    for name, value in measured.items():
        check_limit(name, value, FORCES if name == "residual" else CHECK, comm)
    return measured, int(np.sum(residual_forces < CONVERGED))


def _displacement(comm: MPI.Comm, load: Array, phi: Array) -> float:
    """Largest displacement of a site in the modes, relative to the norms of load and mode."""
    squares = [comm.allreduce(np.einsum("ij,ij->j", x, x)) for x in (load, phi)]
    sizes = np.sqrt(np.outer(*squares))
    return float((np.abs(dot(comm, load, phi)) / sizes).max(initial=0.0))


def _excess(mass: Array, P: Array) -> float:
    """Largest relative excess of the modes' masses over the mass of the static shapes."""
    scale = 1 / np.sqrt(np.maximum(mass.diagonal(), np.finfo(float).tiny))
    remaining_mass = (mass - P.T @ P) * scale[:, None] * scale
    return max(0.0, -float(np.linalg.eigvalsh(remaining_mass)[0]))


def check_modes(structure: Structure, modes: Modes) -> None:
    """Measure the modes' M-orthogonality and residual; AccuracyError beyond CHECK, or beyond what
    rounding of K leaves of the residual.
    """
    gram = dot(structure.comm, modes.phi, multiply(structure.M, modes.phi))
    worst = {
        "orthogonality": np.abs(gram - np.eye(len(gram))).max(initial=0.0),
        "residual": CHECK
        * (residuals(structure, modes) / allowed(structure, modes)).max(initial=0.0),
    }
    for name, value in worst.items():
        if not value <= CHECK:
            raise AccuracyError(
                f"the natural modes fail their own check: {name} {value:.1e}, limit {CHECK:.0e};"
                " the matrices may be ill-conditioned (very uneven elements or materials)."
            )
