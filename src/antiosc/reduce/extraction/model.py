"""The model of a group of sites, from its anti-oscillators and shapes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from antiosc.base._types import Array
from antiosc.fem.assembly import with_parts
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
    sites: Columns,
    static: SiteShapes,
    selected: Selection,
    one: OneSite | None,
    info: ModelInfo,
) -> AntiOscillators:
    """The model of p >= 1 sites; `one`: the parameters of a single site without a name."""
    firsts = {name: of_site[0] for name, of_site in sites.items()}
    directions = [column.direction for of_site in sites.values() for column in of_site]
    has_directions = all(direction is not None for direction in directions)
    if one is None:
        shapes = np.hstack([static.phi @ static.W.T, selected.phi])
        parameters = _named(sites, static, selected)
        hidden = static.nodal
        participation = weights_of(structure, shapes) if has_directions else None
        points = {name: x.point.tolist() for name, x in firsts.items() if x.point is not None}
        info = info.having(independent=static.kept.tolist())
        info = replace(info, points=points) if has_directions else info
    else:
        shapes = one.shapes
        parameters = {"m0": one.m0, "k0": one.k0, "m": one.m, "omega": one.omega}
        hidden = one.hidden
        (first,) = firsts.values()
        parameters |= {"local_compliance": first.local_compliance, "radius": first.radius}
        participation = _along(structure, first.direction, shapes)
        # the weak rigid-body mode has converged
        converged = (info.converged or 0) + len(one.m) - len(selected.omega)
        info = info.having(meshed=structure.matrices.meshed, converged=converged)
        if first.point is not None and first.direction is not None:
            info = replace(info, point=first.point.tolist(), direction=first.direction.tolist())

    along = np.array(directions) if has_directions else None
    is_known = one is None or structure.rigid_inertia is not None
    model = AntiOscillators(
        **parameters,
        participation=participation,
        shapes=shapes,
        direction=along if one is None or along is None else along[0],
        inertia=inertia_of(structure, shapes, hidden),
        hidden=hidden if is_known else None,
        info=info,
    )
    return _with_second_order(structure, model)


def _named(sites: Columns, static: SiteShapes, selected: Selection) -> dict[str, Any]:
    """The parameters of a model of named sites."""
    ends = np.cumsum([len(of_site) for of_site in sites.values()]).tolist()
    firsts = [of_site[0] for of_site in sites.values()]
    return {
        "m0": _in_site_basis(static.W, selected.m0),
        "k0": _in_site_basis(static.W, static.k0),
        "P": static.W @ selected.P.T,
        "omega": selected.omega,
        "sites": tuple(sites),
        "columns": {
            name: tuple(range(end - len(of_site), end))
            for (name, of_site), end in zip(sites.items(), ends, strict=True)
        },
        "dependence": static.dependence,
        "rigid": static.rigid,
        "slide": static.slide,
        "local_compliance": np.array([first.local_compliance for first in firsts]),
        "radius": tuple(first.radius for first in firsts),
    }


def _along(structure: Structure, direction: Array | None, shapes: Array) -> Array | None:
    """Participation of the shapes of one site in a uniform acceleration along the impact."""
    load = None if direction is None else structure.uniform_inertia(direction)
    if load is None:
        return None
    weights = np.asarray(dot(structure.comm, shapes, load))
    weights[0] -= weights[1:].sum()
    return weights


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


def weights_of(structure: Structure, shapes: Array) -> Array | None:
    """Generalised masses (k, 3) of shapes (rows, k) for unit uniform accelerations along x, y, z.

    They are None for matrices. A plane structure does not move along z.
    """
    loads = [structure.uniform_inertia(axis) for axis in np.eye(3)]
    if any(load is None for load in loads):
        return None
    return np.asarray(dot(structure.comm, shapes, np.column_stack(loads)))  # type: ignore[arg-type]
