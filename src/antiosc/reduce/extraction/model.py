"""The model of a group of sites, from its anti-oscillators and shapes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, cast

import numpy as np

from antiosc.base._types import Array
from antiosc.fem.linalg.algebra import dot
from antiosc.fem.structure.structure import Structure
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.body import UNKNOWN, ModelInfo
from antiosc.models.motion import Inertia
from antiosc.reduce.extraction import SiteShapes
from antiosc.reduce.extraction.mode_checks import checked_modes
from antiosc.reduce.extraction.oscillators import ConstraintModes, OneSite, Selection
from antiosc.reduce.site import Functional, surfaces

if TYPE_CHECKING:
    from antiosc.fem.structure.meshed import MeshedStructure

#: Load vectors of each site of a model: the normal one first, then the tangential ones.
Columns = Mapping[str, Sequence[Functional]]
#: The name of the site of a model of one site without a name.
UNNAMED = ""


def info_of_model(
    structure: Structure, group: Columns, known: ConstraintModes, selected: Selection, method: str
) -> ModelInfo:
    """The record of an extraction."""
    measured, converged = checked_modes(structure, known, method)
    info = info_of_places(structure, {name: columns[0] for name, columns in group.items()})
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


def info_of_places(structure: Structure, sites: Mapping[str, Functional]) -> ModelInfo:
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


def _thickness_at(
    structure: Structure, sites: Mapping[str, Functional], least: float | None
) -> float | None:
    """The thickness of a sheet at its sites, whose deflection it judges; of others the `least`."""
    if least is None:
        return None
    from antiosc.reduce.site.surface import material_at  # given matrices do without meshes

    places = [(site.point, site.direction) for site in sites.values()]
    materials = [material_at(structure, x, along) for x, along in places if x is not None]
    found = [getattr(getattr(one, "section", None), "thickness", least) for one in materials]
    return min(found, default=least)


def _no_estimate(structure: Structure) -> str | None:
    """Why the mesh's error of a structure is not estimated; None if it is, or has no mesh."""
    if not (structure.matrices.meshed or structure.matrices.assembled):
        return None
    from antiosc.reduce.error.model_errors import refusal  # needs dolfinx

    return refusal(structure) or None


def model_of_one_site(
    structure: Structure, target: Functional, parameters: OneSite, elastic: int, info: ModelInfo
) -> AntiOscillators:
    """The model of a single unnamed site."""
    info = info.having(
        meshed=structure.matrices.meshed,
        converged=(info.converged or 0)
        + len(parameters.m)
        - elastic,  # the weak rigid-body mode is one
    )
    if target.point is not None and target.direction is not None:
        info = replace(info, point=target.point.tolist(), direction=target.direction.tolist())
    weight = uniform_inertia(structure, target)
    shapes = np.column_stack([parameters.residual + parameters.psi.sum(axis=1), parameters.psi])
    participation: Array | None = None
    if weight is not None:
        weights = (
            dot(structure.comm, part, weight) for part in (parameters.residual, parameters.psi)
        )
        participation = np.hstack(list(weights))
    model = AntiOscillators(
        m0=parameters.m0,
        k0=parameters.k0,
        m=parameters.m,
        omega=parameters.omega,
        local_compliance=target.local_compliance,
        radius=target.radius,
        participation=participation,
        shapes=shapes,
        direction=target.direction,
        inertia=inertia_of(structure, shapes, parameters.hidden),
        hidden=parameters.hidden if structure.rigid_inertia is not None else None,
        info=info,
    )
    return _with_second_order(structure, model)


def model_of_named_sites(
    structure: Structure, sites: Columns, static: SiteShapes, selected: Selection, info: ModelInfo
) -> AntiOscillators:
    """The model of several sites, or of one site with a name."""
    ends = np.cumsum([len(of_site) for of_site in sites.values()])
    columns = {
        name: tuple(range(end - len(of_site), end))
        for (name, of_site), end in zip(sites.items(), ends.tolist(), strict=True)
    }
    firsts = [of_site[0] for of_site in sites.values()]
    directions = [column.direction for of_site in sites.values() for column in of_site]
    has_directions = all(direction is not None for direction in directions)
    info = info.having(independent=static.kept.tolist())
    if has_directions:
        places = {name: of_site[0].point for name, of_site in sites.items()}
        points = {name: place.tolist() for name, place in places.items() if place is not None}
        info = replace(info, points=points)
    unit = static.phi @ static.W.T
    shapes = np.hstack([unit, selected.phi])
    model = AntiOscillators(
        m0=_in_site_basis(static.W, selected.m0),
        k0=_in_site_basis(static.W, static.k0),
        P=static.W @ selected.P.T,
        omega=selected.omega,
        sites=tuple(sites),
        columns=columns,
        dependence=static.dependence,
        rigid=static.rigid,
        slide=static.slide,
        local_compliance=np.array([first.local_compliance for first in firsts]),
        radius=tuple(first.radius for first in firsts),
        participation=weights_of(structure, shapes) if has_directions else None,
        shapes=shapes,
        direction=np.array(directions) if has_directions else None,
        inertia=inertia_of(structure, shapes, static.nodal),
        hidden=static.nodal,
        info=info,
    )
    return _with_second_order(structure, model)


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
    return replace(model, info=replace(model.info, second_order=by_site))


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


def uniform_inertia(structure: Structure, target: Functional) -> Array | None:
    """M e on the rows of this rank, e a unit uniform motion; None without coordinates."""
    if target.direction is None:
        return None
    return structure.uniform_inertia(target.direction)


def weights_of(structure: Structure, shapes: Array) -> Array | None:
    """Generalised masses (k, 3) of shapes (rows, k) for unit uniform accelerations along x, y, z.

    They are None for matrices. A plane structure does not move along z.
    """
    loads = [structure.uniform_inertia(axis) for axis in np.eye(3)]
    if any(load is None for load in loads):
        return None
    return np.asarray(dot(structure.comm, shapes, np.column_stack(loads)))  # type: ignore[arg-type]
