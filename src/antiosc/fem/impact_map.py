"""`impact_map`: the anti-oscillators, and the impacts, of every point of a surface.

One eigenproblem serves all sites (`antiosc.free_modes`): each needs the free modes at its place
and two numbers of its static deflection y, the compliance b'y and the inertia y'My. Where there
are many sites, y is solved for at some of them and the rest is interpolated over the surface:
only the part r = b'y - sum b_j^2/w_j^2 of the modes left out, and its mean inertia, which vary
slowly. The error of each site's Z is bounded, that of its interpolated compliance estimated from
the sites solved for; where the bound is too large the site is extracted by itself.
"""

from __future__ import annotations

import logging
import os
import tempfile
import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import scipy.sparse
from scipy.interpolate import RBFInterpolator
from scipy.spatial import cKDTree

from antiosc import free_modes
from antiosc.batch import simulate_many
from antiosc.checks import array, nonnegative, positive, whole
from antiosc.contact import ContactLaw
from antiosc.deflection import peak_deflections
from antiosc.errors import AccuracyWarning, AntioscWarning, InputError
from antiosc.fem.algebra import Array, dot, multiply
from antiosc.fem.compat import IntArray
from antiosc.fem.krylov import by_krylov
from antiosc.fem.modes import Modes, ModeSolver
from antiosc.fem.parallel import agree
from antiosc.fem.site import SHEET_RADIUS, Functional, Site, functional
from antiosc.fem.static import static_modes
from antiosc.fem.structure import Structure
from antiosc.fem.surface import Surface, patch_loads, point_loads, sheet_loads, surface
from antiosc.free_modes import SiteModels
from antiosc.modal import LinearBody
from antiosc.model import AntiOscillators

#: Free modes where neither `modes` nor a band says how many.
MODES = 20
#: The last free mode lies this far above the band.
ABOVE = 1.5
#: The band where none is given, over the last free mode.
WITHIN = 0.5
#: Sites solved for at a time: blocks of right-hand sides cost a fraction of single ones.
BLOCK = 64
#: Up to so many sites every one is solved for; above, so many to begin with.
EXACT, FIRST = 300, 150
#: The interpolation's error is measured by leaving out one of so many parts of the solved sites
#: in turn; that at another site is the largest among so many nearest ones.
FOLDS, NEIGHBOURS = 5, 3
#: Largest number of sites extracted directly.
DIRECT = 16
#: Weight of the direction of the surface in the distance of two sites, over the size of the part.
TURN = 0.3
#: A site with less than this share of its load on dofs that can move is held by the supports.
HELD = 0.05

LABELS = {
    "k0": "static stiffness / (N/m)",
    "m_st": "static mass / kg",
    "omega_1": "first antiresonance / (rad/s)",
    "error": "bound on the relative error of Z",
    "k0_error": "estimated relative error of the static stiffness",
    "peak_force": "peak force / N",
    "contact_time": "contact time / s",
    "restitution": "coefficient of restitution",
    "impulse": "impulse / (N s)",
    "peak_deflection": "peak deflection / m",
}

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class ImpactMap:
    """Anti-oscillators and impacts over a surface, on every rank alike.

    Attributes
    ----------
    points, directions : (P, 3) sites [m] and unit vectors along which they are struck.
    elements : (T, 3) triangles between the points (or (T, 2) segments); empty for given points.
    models : SiteModels
        Parameters k0, m0, m_st, omega, m of all sites; `model(i)` is one of them.
    local_compliance : (P,) half-space compliance of the patch [m/N], 0 for a point.
    radius : radius of the patch [m], or None.
    error : (P,) bound on |dZ|/|Z| up to `band` [rad/s], the static compliance taken as right.
    k0_error : (P,) estimated relative error of the static compliance, 0 where it was solved for.
    direct : (P,) bool, sites that were extracted by themselves.
    skipped : sites left out because the supports hold them or no surface carries their patch.
    peak_force [N], contact_time [s], restitution, impulse [N s], peak_deflection [m] : (P,) of the
        impacts, or None; restitution is NaN where the impactor had not left at the end, the
        deflection is the site's, the patch's own indentation included.
    info : facts, JSON-able: free modes, solves, seconds, error of the interpolation.
    """

    points: Array
    directions: Array
    elements: IntArray
    models: SiteModels
    local_compliance: Array
    radius: float | None
    band: float
    error: Array
    k0_error: Array
    direct: Array
    skipped: int
    peak_force: Array | None = None
    contact_time: Array | None = None
    restitution: Array | None = None
    impulse: Array | None = None
    peak_deflection: Array | None = None
    info: dict[str, Any] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.points)

    def model(self, i: int) -> AntiOscillators:
        """The model of site i, without shapes."""
        return replace(
            self.models.model(i),
            local_compliance=float(self.local_compliance[i]),
            radius=self.radius,
            info={"point": self.points[i].tolist(), "direction": self.directions[i].tolist()},
        )

    def quantities(self) -> dict[str, Array]:
        """Every scalar of the map by name, as written to files: (P,) each."""
        first = np.where(self.models.m[:, 0] > 0, self.models.omega[:, 0], 0.0)
        named = {
            "k0": self.models.k0,
            "m_st": self.models.m_st,
            "omega_1": first,
            "error": self.error,
            "k0_error": self.k0_error,
            "peak_force": self.peak_force,
            "contact_time": self.contact_time,
            "restitution": self.restitution,
            "impulse": self.impulse,
            "peak_deflection": self.peak_deflection,
        }
        return {name: value for name, value in named.items() if value is not None}

    def write(self, path: str | os.PathLike[str]) -> Path:
        """Write points, elements and all quantities to a VTU file (or whatever meshio writes)."""
        target = Path(path)
        kind = {3: "triangle", 2: "line"}.get(self.elements.shape[1], "vertex")
        cells = self.elements if len(self.elements) else np.arange(len(self))[:, None]
        kind = kind if len(self.elements) else "vertex"
        data = {**self.quantities(), "direction": self.directions}
        try:
            handle, name = tempfile.mkstemp(dir=target.parent, suffix=target.suffix)
            os.close(handle)
        except OSError as error:
            raise InputError(f"cannot write the map to {target}: {error.strerror}.") from None
        try:
            meshio.Mesh(self.points, [(kind, cells)], point_data=data).write(name)
            os.chmod(name, 0o644)
            os.replace(name, target)
        except BaseException:
            Path(name).unlink(missing_ok=True)
            raise
        return target

    def plot(self, path: str | os.PathLike[str], quantity: str = "peak_force") -> Path:
        """A picture of one quantity over the surface (PNG)."""
        known = self.quantities()
        if quantity not in known:
            raise InputError(f"quantity must be one of {', '.join(known)}; got {quantity!r}.")
        import matplotlib.pyplot as plt

        value = known[quantity]
        figure, axes = plt.subplots(subplot_kw={"projection": "3d"}, figsize=(7, 5))
        if self.elements.shape[1] == 3 and len(self.elements):
            from mpl_toolkits.mplot3d.art3d import (  # type: ignore[import-untyped]
                Poly3DCollection,
            )

            faces = Poly3DCollection(self.points[self.elements], linewidths=0)
            faces.set_array(value[self.elements].mean(axis=1))
            axes.add_collection3d(faces)
            axes.auto_scale_xyz(*self.points.T)
        else:
            faces = axes.scatter(*self.points.T, c=value, s=8)
        size = np.ptp(self.points, axis=0)
        axes.set_box_aspect(np.maximum(size, 0.05 * size.max()))
        axes.set(xlabel="x / m", ylabel="y / m", zlabel="z / m")
        figure.colorbar(faces, ax=axes, shrink=0.7, label=LABELS.get(quantity, quantity))
        target = Path(path)
        part = target.with_name(f".{target.name}.part{target.suffix}")
        try:
            figure.savefig(part, dpi=150)
            os.replace(part, target)
        finally:
            plt.close(figure)
            part.unlink(missing_ok=True)
        return target


def impact_map(
    structure: Structure,
    where: str | Sequence[Sequence[float]] | None = None,
    impactor: LinearBody | None = None,
    contact: ContactLaw | None = None,
    duration: float | None = None,
    *,
    direction: Sequence[float] | None = None,
    radius: float | None = None,
    n: int = 12,
    modes: int | None = None,
    band: float | None = None,
    accuracy: float = 0.05,
    k0_accuracy: float = 0.01,
) -> ImpactMap:
    """Anti-oscillators at many sites of a structure, and the impact of one impactor at each.

    Parameters
    ----------
    structure : Structure
        Of a mesh.
    where : str or array_like (P, 2 or 3), optional
        A group of faces (cells of shells and beams), whose vertices are the sites; or points.
        None: the whole surface. Points, and sites on shells of several materials, are found one
        by one, which takes longer than all else.
    impactor, contact, duration
        As for `simulate`; None: parameters only.
    direction : sequence of float, optional
        Along which all sites are struck; None: against the surface (solids, by group).
    radius : float, optional
        Radius of the patch, m, as for `Site`.
    n : int
        Anti-oscillators at each site, by the Krylov method on the free modes.
    modes : int, optional
        Free modes; 20 by default, or as many as reach 1.5 times the band.
    band : float, optional
        Highest circular frequency of interest, rad/s; default: half the last free frequency.
    accuracy : float
        Largest |dZ|/|Z| over the band, at one per cent of damping. Sites where the modes left out
        make more are extracted directly, the worst 16 at most; a warning says how many remain.
    k0_accuracy : float
        Relative error to which the static compliance of many sites may be interpolated; 0: it is
        solved for at each.

    Raises
    ------
    InputError
        An empty group, points off the structure, no site that can move, a missing direction.
    """
    started = time.perf_counter()
    positive("accuracy", accuracy)
    nonnegative("k0_accuracy", k0_accuracy)
    n = whole("n", n)
    if band is not None:
        band = positive("band", band, "rad/s")
    if (impactor is None) != (contact is None) or (impactor is None) != (duration is None):
        raise InputError("impacts need all of impactor, contact and duration; parameters none.")
    sites = _sites(structure, where, direction, radius)
    structure.factorization  # noqa: B018  (timed on its own)
    located = time.perf_counter()
    free = _free_modes(structure, modes, band)
    omega = np.concatenate([np.zeros(structure.rigid_modes.shape[1]), free.omega])
    phi = np.column_stack([structure.rigid_modes, free.phi])
    band = WITHIN * float(omega[-1]) if band is None else band
    if band >= omega[-1]:
        raise InputError(
            f"the band {band:g} rad/s must end below the last of {len(omega)} free modes,"
            f" {omega[-1]:g} rad/s: ask for more modes."
        )
    b = structure.comm.allreduce(sites.loads.T @ phi)
    solved = time.perf_counter()
    C, G, off, solves = _deflections(structure, sites, omega, b, k0_accuracy)
    models = free_modes.at_sites(omega, b, C, G, n, structure.shift, "krylov")
    left_out, reduction = free_modes.error_bound(models, omega, b, C, G, band, structure.shift)
    reduced = time.perf_counter()
    models, error, direct = _refined(
        structure, sites, models, (left_out, reduction), band, accuracy
    )
    extracted = time.perf_counter()
    seconds = {
        "sites": located - started,
        "free_modes": solved - located,
        "deflections and models": reduced - solved,
        "direct": extracted - reduced,
    }
    info = {
        "structure": structure.describe(),
        "free_modes": len(omega),
        "solves": solves,
        "seconds": {**structure.seconds, **seconds},
    }
    result = ImpactMap(
        points=sites.points,
        directions=sites.directions,
        elements=sites.elements,
        models=models,
        local_compliance=sites.local,
        radius=sites.radius,
        band=band,
        error=error,
        k0_error=np.where(direct, 0.0, off),
        direct=direct,
        skipped=sites.total - len(sites.points),
        info=info,
    )
    if structure.comm.rank == 0:
        _tell(result, accuracy)
    if impactor is None or contact is None or duration is None:
        return result
    return _struck(structure, result, impactor, contact, duration)


# --- Sites --------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Sites:
    points: Array
    normals: Array
    directions: Array
    elements: IntArray
    #: b of all sites as columns, the rows of this rank
    loads: scipy.sparse.csr_matrix
    local: Array
    #: of the patch, m; None for a point
    radius: float | None
    #: how many were asked for
    total: int

    def only(self, keep: Array) -> _Sites:
        """Some of the sites, with the elements that lie between them."""
        number = np.cumsum(keep) - 1
        elements = self.elements
        if len(elements):
            elements = number[elements[keep[elements].all(axis=1)]]
        return _Sites(
            self.points[keep],
            self.normals[keep],
            self.directions[keep],
            elements,
            self.loads[:, np.flatnonzero(keep)],
            self.local[keep],
            self.radius,
            self.total,
        )


def _sites(
    structure: Structure, where: Any, direction: Sequence[float] | None, radius: float | None
) -> _Sites:
    if structure.mesh is None:
        raise InputError("a map needs a mesh: matrices have no points.")
    along = None
    if direction is not None:
        along = np.zeros(3)
        along[: len(direction)] = array("direction", direction, (len(direction),))
        if not np.linalg.norm(along):
            raise InputError("direction must not be the zero vector.")
        along /= np.linalg.norm(along)
    if where is None or isinstance(where, str):
        found = _on_surface(structure, surface(structure, where), along, radius)
    else:
        found = _at_points(structure, where, along, radius)
    weight = structure.comm.allreduce(np.asarray(abs(found.loads).sum(axis=0)).ravel())
    # a unit force along d is spread over |d_x| + |d_y| + |d_z| of load, negative parts apart
    moving = weight > HELD * np.abs(found.directions).sum(axis=1)
    if not moving.any():
        raise InputError(
            "no site of the map can move: the supports hold the whole surface, or no face carries "
            "the patch; name another group."
        )
    return found if moving.all() else found.only(moving)


def _on_surface(
    structure: Structure, ground: Surface, along: Array | None, radius: float | None
) -> _Sites:
    assert structure.form is not None
    if along is None and structure.form.patch != "facets":
        raise InputError(
            "shells and beams have no outside: give the direction of impact, direction=(0, 0, -1)."
        )
    points, normals = ground.points, ground.normals
    directions = -normals if along is None else np.tile(along, (len(points), 1))
    kind, patch = structure.parts[0][0], structure.form.patch
    if radius is not None:
        positive("radius", radius, "m")
    if patch == "cells" and len(structure.parts) == 1:
        radius = radius or kind.thickness * SHEET_RADIUS
        loads, share = sheet_loads(structure, points, normals, directions, radius)
    elif patch == "cells" or (patch is None and radius is not None):
        return _at_points(structure, points, along, radius, ground)
    elif radius is None:
        loads, share = point_loads(structure, points, directions), np.ones(len(points))
        if patch and structure.comm.rank == 0:
            warnings.warn(
                "the compliance under a point load on a solid grows without limit as the mesh is "
                "refined: give the map a radius.",
                AntioscWarning,
                stacklevel=5,
            )
    else:
        loads, share = patch_loads(structure, points, normals, directions, radius)
    local = np.zeros(len(points))
    if radius is not None and len(structure.parts) == 1:
        cosine = np.einsum("ij,ij->i", directions, normals)
        local = np.array([kind.half_space_compliance(float(c)) for c in cosine]) / radius
    cut = int(np.sum(share < 0.9))
    if cut and structure.comm.rank == 0:
        warnings.warn(
            f"an edge cuts the patch at {cut} of {len(share)} sites (less than 90 % of its "
            "load lies on the surface): its half-space compliance does not hold there.",
            AccuracyWarning,
            stacklevel=5,
        )
    return _Sites(points, normals, directions, ground.elements, loads, local, radius, len(points))


def _at_points(
    structure: Structure,
    points: Any,
    along: Array | None,
    radius: float | None,
    ground: Surface | None = None,
) -> _Sites:
    """Sites one by one, with all the checks of `Site`."""
    if along is None:
        raise InputError("points need the direction of impact, as direction=(0, 0, -1).")
    if not len(points):
        raise InputError("a map needs at least one point.")
    at = array("points", points, (None, None))
    at = np.pad(at, ((0, 0), (0, 3 - at.shape[1])))
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        places = [functional(structure, Site(tuple(x), tuple(along), radius)) for x in at]
    if said and structure.comm.rank == 0:
        warnings.warn(
            f"{said[0].message} (the first of {len(said)} such warnings)",
            said[0].category,
            stacklevel=5,
        )
    x = np.array([place.point for place in places])
    return _Sites(
        x,
        np.zeros_like(x) if ground is None else ground.normals,
        np.tile(along, (len(x), 1)),
        np.zeros((0, 3), dtype=int) if ground is None else ground.elements,
        scipy.sparse.csr_matrix(np.column_stack([place.b for place in places])),
        np.array([place.local_compliance for place in places]),
        places[0].radius,
        len(x),
    )


# --- Free modes and static deflections ----------------------------------------------------------


def _free_modes(structure: Structure, count: int | None, band: float | None) -> Modes:
    """The lowest elastic modes: `count`, or as many as reach above the band."""
    solver = ModeSolver(structure)
    wanted = MODES if count is None else whole("modes", count)
    found = solver.lowest(wanted)
    while count is None and band is not None and found.omega[wanted - 1 :][:1] < ABOVE * band:
        if len(found.omega) < wanted:  # there are no more
            break
        wanted = int(1.5 * wanted)
        found = solver.lowest(wanted)
        log.info("%d free modes up to %.4g rad/s", len(found.omega), found.omega[-1])
    return Modes(found.omega[:wanted], found.phi[:, :wanted], len(found.omega) <= wanted)


def _deflections(
    structure: Structure, sites: _Sites, omega: Array, b: Array, accuracy: float
) -> tuple[Array, Array, Array, int]:
    """Compliance, inertia, relative error of the compliance (P,), and the number of solves."""
    count = len(sites.points)
    x = omega**2 + structure.shift
    held, heavy = b**2 @ (1 / x), b**2 @ (1 / x**2)
    C, G, off = np.zeros(count), np.zeros(count), np.zeros(count)
    if count <= EXACT or accuracy == 0:
        C, G = _solved(structure, sites, np.arange(count))
        return C, G, off, count
    # sites are neighbours when they are near and their surface looks the same way
    features = np.hstack([sites.points, TURN * np.ptp(sites.points, axis=0).max() * sites.normals])
    known = np.zeros(0, dtype=int)
    new = _spread(features, FIRST)
    rng = np.random.default_rng(0)
    while len(new):
        C[new], G[new] = _solved(structure, sites, new)
        known = np.concatenate([known, new])
        rest = np.setdiff1d(np.arange(count), known)
        r = np.maximum(C - held, free_modes.ROUNDING * C)
        theta = np.clip(G - heavy, 0.0, r / x[-1]) / np.where(r > 0, r, 1.0)
        miss = np.abs(_left_out_in_turn(features, known, r, theta) - r[known]) / C[known]
        near = cKDTree(features[known]).query(features[rest], k=NEIGHBOURS)[1]
        off[known], off[rest] = 0.0, miss[near].max(axis=1, initial=0.0)
        bad = rest[off[rest] > accuracy]
        log.info("%d of %d sites solved for, %d still off", len(known), count, len(bad))
        new = rng.permutation(bad)[: max(len(known), BLOCK)]
    if len(rest):
        found = _interpolated(features, known, rest, r, theta)
        C[rest] = held[rest] + found[0]
        G[rest] = heavy[rest] + found[0] * np.minimum(found[1], 1 / x[-1])
    return C, G, off, len(known)


def _left_out_in_turn(features: Array, known: IntArray, r: Array, theta: Array) -> Array:
    """r at every known site, interpolated from the known ones of other folds."""
    found = np.zeros(len(known))
    for fold in range(FOLDS):
        out = np.zeros(len(known), dtype=bool)
        out[fold::FOLDS] = True
        found[out] = _interpolated(features, known[~out], known[out], r, theta)[0]
    return found


def _solved(structure: Structure, sites: _Sites, which: IntArray) -> tuple[Array, Array]:
    """b'y and y'My of y = A^-1 b at some sites, by blocks of right-hand sides."""
    C, G = np.zeros(len(which)), np.zeros(len(which))
    for first in range(0, len(which), BLOCK):
        part = slice(first, first + BLOCK)
        B = sites.loads[:, which[part]].toarray()
        Y = structure.factorization.solve_block(B)
        C[part] = structure.comm.allreduce(np.einsum("ij,ij->j", B, Y))
        G[part] = structure.comm.allreduce(np.einsum("ij,ij->j", Y, multiply(structure.M, Y)))
    return C, G


def _interpolated(
    features: Array, known: IntArray, wanted: IntArray, r: Array, theta: Array
) -> tuple[Array, Array]:
    """r and theta at `wanted` sites from the `known` ones, by radial basis functions."""
    values = np.column_stack([np.log(r[known]), theta[known]])
    spline = RBFInterpolator(features[known], values, neighbors=40, kernel="linear")
    found = spline(features[wanted])
    low, high = np.log(r[known].min()), np.log(r[known].max())
    return np.exp(np.clip(found[:, 0], low, high)), np.maximum(found[:, 1], 0.0)


def _spread(x: Array, count: int) -> IntArray:
    """`count` of the points, each the farthest from those before it."""
    chosen = np.zeros(count, dtype=int)
    chosen[0] = int(np.argmin(np.linalg.norm(x - x.mean(axis=0), axis=1)))
    distance = np.linalg.norm(x - x[chosen[0]], axis=1)
    for k in range(1, count):
        chosen[k] = int(distance.argmax())
        distance = np.minimum(distance, np.linalg.norm(x - x[chosen[k]], axis=1))
    return chosen


# --- What is not good enough --------------------------------------------------------------------


def _refined(
    structure: Structure,
    sites: _Sites,
    models: SiteModels,
    errors: tuple[Array, Array],
    band: float,
    accuracy: float,
) -> tuple[SiteModels, Array, Array]:
    """The sites for which the free modes are too few, extracted by themselves; errors of all."""
    left_out, error = errors[0], errors[0] + errors[1]
    direct = np.zeros(len(error), dtype=bool)
    worst = np.argsort(-left_out, kind="stable")[:DIRECT]
    worst = worst[left_out[worst] > accuracy]
    if not len(worst):
        return models, error, direct
    omega, m = models.omega.copy(), models.m.copy()
    k0, m0, m_st, error = models.k0.copy(), models.m0.copy(), models.m_st.copy(), error.copy()
    n = m.shape[1]
    for first in range(0, len(worst), BLOCK):
        which = worst[first : first + BLOCK]
        places = [Functional(b) for b in sites.loads[:, which].toarray().T]
        statics = static_modes(structure, places)
        found = by_krylov(structure, places, statics, n, free_modes.UNSEEN, band, 0.0)
        for i, static, (modes, bound) in zip(which, statics, found, strict=True):
            if bound is None or bound >= error[i]:
                continue
            mass = dot(structure.comm, modes.phi, static.m_phi) ** 2
            seen = (mass > free_modes.UNSEEN * static.mass) & (modes.omega > 0)
            size = int(seen.sum())
            omega[i], m[i] = np.inf, 0.0
            omega[i, :size], m[i, :size] = modes.omega[seen], mass[seen]
            k0[i], m_st[i], m0[i] = static.k0, static.mass, max(static.mass - m[i].sum(), 0.0)
            error[i], direct[i] = bound, True
    return SiteModels(k0, m0, m_st, omega, m), error, direct


def _tell(result: ImpactMap, accuracy: float) -> None:
    if result.skipped:
        warnings.warn(
            f"{result.skipped} of {result.skipped + len(result)} sites are left out: the supports "
            "hold them along the impact, or no face carries their patch.",
            AccuracyWarning,
            stacklevel=3,
        )
    left = int(np.sum(result.error > accuracy))
    if left:
        warnings.warn(
            f"Z may be off by more than {accuracy:g} at {left} of {len(result)} sites up to "
            f"{result.band:g} rad/s (at worst {result.error.max():.1e}): raise n or modes, lower "
            "the band, or extract those sites (see .error).",
            AccuracyWarning,
            stacklevel=3,
        )


def _struck(
    structure: Structure,
    result: ImpactMap,
    impactor: LinearBody,
    contact: ContactLaw,
    duration: float,
) -> ImpactMap:
    """The map with one impact at each site, the sites shared among the ranks."""
    started = time.perf_counter()
    comm = structure.comm
    mine = np.array_split(np.arange(len(result)), comm.size)[comm.rank]
    part, error = None, None
    try:
        if len(mine):
            models = [result.model(i) for i in mine]
            batch = simulate_many(models, impactor, contact, duration)
            part = batch, peak_deflections(models, batch.force, duration)
    except Exception as caught:
        error = caught
    agree(comm, error)
    parts = [p for p in comm.allgather(part) if p is not None]

    def gathered(name: str) -> Array:
        return np.concatenate([getattr(batch, name) for batch, _ in parts])

    result.info["seconds"]["impacts"] = time.perf_counter() - started
    return replace(
        result,
        peak_force=gathered("peak_force"),
        contact_time=gathered("contact_time"),
        restitution=gathered("restitution"),
        impulse=gathered("impulse"),
        peak_deflection=np.concatenate([deflection for _, deflection in parts]),
    )
