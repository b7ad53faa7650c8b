"""The one anti-oscillator model of several sites of a structure."""

from __future__ import annotations

import time
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from antiosc._types import Array
from antiosc.fem import mpi
from antiosc.fem.extraction.block_krylov import BlockLanczos
from antiosc.fem.extraction.body_inertia import inertia_of, weights_of
from antiosc.fem.extraction.eigenmodes import Modes, ModeSolver
from antiosc.fem.extraction.krylov import MORE, STEPS_PER_ONE
from antiosc.fem.extraction.ritz_basis import BASIS_STEP, Remainder
from antiosc.fem.extraction.self_check import checked_modes
from antiosc.fem.extraction.site_oscillators import (
    Found,
    Kept,
    error_bound,
    left_out,
    lumped,
    oscillators,
)
from antiosc.fem.extraction.site_shapes import SiteShapes, site_shapes
from antiosc.fem.extraction.wish import DEFAULT_COUNT, SEARCHED, STEP_AIM, Wish, tell
from antiosc.fem.linalg.algebra import dot, multiply
from antiosc.fem.site.site import Functional
from antiosc.fem.structure.structure import Structure
from antiosc.models.anti_oscillators import AntiOscillators


def of_several_sites(
    structure: Structure, targets: Mapping[str, list[Functional]], wish: Wish, shapes: bool
) -> AntiOscillators:
    """The model of the named sites, each with the functionals of its columns, the normal first."""
    started = time.perf_counter()
    functionals = [one for own in targets.values() for one in own]
    static = site_shapes(structure, np.column_stack([one.b for one in functionals]))
    find = _by_krylov if wish.method == "krylov" else _by_modes
    modes, remainder = find(structure, static, wish)
    known = lumped(structure, static, modes)
    kept = oscillators(known, wish.n, wish.tol)
    checks = _checked(structure, known, wish)
    seconds = {**structure.seconds, "modes": time.perf_counter() - started}
    model = _model(structure, targets, known, kept, checks, wish, seconds, shapes)
    if wish.band is not None and remainder is not None:
        error, lowest = error_bound(structure, known, remainder, kept, wish.band)
        model.info["band"] = {"bottom": lowest, "top": wish.band, "error_bound": error}
    mpi.on_root(structure.comm, partial(tell, model, wish, modes.complete))
    return model


def _by_krylov(
    structure: Structure, static: SiteShapes, wish: Wish
) -> tuple[Modes, Remainder | None]:
    """Ritz pairs, and with a band the bound on what they leave out.

    Without a band as many as are wanted with more than the share `tol` in Z, if there are so many;
    with a band the least number of blocks for which the error of Z is at most the accuracy wanted.
    """
    room = wish.n + len(static.kept) if wish.band is None else BASIS_STEP
    run = BlockLanczos(structure, static, room)
    while True:
        before = run.steps
        run.advance(structure.factorize().solve_block(run.load))
        kept = _finished(run, before, wish)
        if kept is not None:
            return run.modes(kept), None if wish.band is None else run.remainder(kept)


def _finished(run: BlockLanczos, before: int, wish: Wish) -> int | None:
    """How many vectors to keep, or None to continue."""
    if wish.band is not None:
        tried = min(run.applied, wish.n)
        enough = tried == wish.n or run.exhausted
        if not enough and tried:
            enough = run.error(tried, wish.band) <= STEP_AIM * wish.accuracy
        return tried if enough else None
    for count in range(max(before, wish.n), run.steps + 1):
        if run.observable(count, wish.tol) >= wish.n:
            return count
    most = STEPS_PER_ONE * wish.n + MORE
    return run.steps if run.exhausted or run.steps >= most else None


def _by_modes(
    structure: Structure, static: SiteShapes, wish: Wish
) -> tuple[Modes, Remainder | None]:
    """The lowest constraint modes until n of them are observable (or the error of Z meets the
    bound)."""
    solver = ModeSolver(structure, static)
    most = min(solver.limit, SEARCHED * (wish.n + DEFAULT_COUNT))
    asked = wish.n + 2 if wish.n and wish.band is None else min(wish.n, DEFAULT_COUNT)
    while True:
        modes = solver.lowest(asked)
        known = lumped(structure, static, modes)
        kept = oscillators(known, wish.n, wish.tol)
        remainder = None if wish.band is None else left_out(known)
        enough = modes.complete or asked >= most or len(kept.omega) >= wish.n
        if not enough and remainder is not None and wish.band is not None:
            error, _ = error_bound(structure, known, remainder, kept, wish.band)
            enough = error <= wish.accuracy
        if enough:
            return modes, remainder
        asked = min(most, len(modes.omega) + max(8, len(modes.omega) // 2))


def _checked(structure: Structure, known: Found, wish: Wish) -> dict[str, float]:
    """The check of the modes of several sites (`checked_modes`)."""
    static = known.static
    sites = np.sqrt((static.k0 + structure.shift * static.mass).diagonal())
    strain = dot(structure.comm, static.phi, multiply(structure.K, static.phi)) - static.k0
    return checked_modes(
        structure,
        known,
        wish.method,
        b=static.load,
        load=static.load,
        phi=static.phi,
        mass=static.mass,
        stiffness=float(np.abs(strain / np.outer(sites, sites)).max()),
    )


def _model(
    structure: Structure,
    targets: Mapping[str, list[Functional]],
    known: Found,
    kept: Kept,
    checks: dict[str, Any],
    wish: Wish,
    seconds: dict[str, float],
    with_shapes: bool,
) -> AntiOscillators:
    static, functionals = known.static, [one for own in targets.values() for one in own]
    firsts = [own[0] for own in targets.values()]
    columns, first = {}, 0
    for name, own in targets.items():
        columns[name] = tuple(range(first, first + len(own)))
        first += len(own)
    info: dict[str, Any] = {
        "structure": structure.describe(),
        "dofs": structure.dofs,
        **structure.matrices.plausibility,
        "method": wish.method,
        "modes_computed": len(known.modes.omega),
        "converged": checks.pop("converged"),
        "modes_unobservable": kept.unobservable,
        "modes_merged": kept.merged,
        "rigid_modes": int(structure.rigid_modes.shape[1]),
        "independent": static.kept.tolist(),
        "checks": checks,
        "seconds": seconds,
    }
    directions = [one.direction for one in functionals]
    placed = all(direction is not None for direction in directions)
    if placed:
        points = {name: own[0].point for name, own in targets.items()}
        info["points"] = {n: point.tolist() for n, point in points.items() if point is not None}
    phi = static.phi @ static.W.T
    shapes = np.hstack([phi, kept.phi])
    return AntiOscillators(
        m0=_turned(static.W, kept.m0),
        k0=_turned(static.W, static.k0),
        P=static.W @ kept.P.T,
        omega=kept.omega,
        sites=tuple(targets),
        columns=columns,
        dependence=static.dependence,
        rigid=static.rigid,
        slide=static.slide,
        local_compliance=np.array([one.local_compliance for one in firsts]),
        radius=tuple(one.radius for one in firsts),
        participation=weights_of(structure, shapes) if placed else None,
        shapes=shapes if with_shapes else None,
        direction=np.array(directions) if placed else None,
        inertia=inertia_of(structure, shapes, static.nodal),
        hidden=static.nodal if with_shapes else None,
        info=info,
    )


def _turned(W: Array, matrix: Array) -> Array:
    """W matrix Wᵀ, positive semidefinite as `matrix` is."""
    values, vectors = np.linalg.eigh(matrix)
    factor = W @ (vectors * np.sqrt(np.maximum(values, 0.0)))
    return np.asarray(factor @ factor.T)
