"""`nearby`: models of structures whose parameters change a little, from a few extractions.

The shapes of a few extractions span a space V onto which every structure of the family is
projected, K(p) → VᵀKV, M(p) → VᵀMV (a Galerkin model, whose frequencies have the square of the
error of the shapes: R. L. Fox, M. P. Kapoor, AIAA J. 6 (1968) 2426; C. Prud'homme et al., J. Fluids
Eng. 124 (2002) 70). The small matrices are polynomials of p between a few assembled structures, so
that a model of the family costs an eigenproblem of the size of V, and neither assembly nor
factorization.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

import numpy as np
import scipy.linalg

from antiosc import AntiOscillators, Site, Structure, extract, from_free_modes
from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import AccuracyError, InputError, check_signature
from antiosc.base.texts import ReprMixin
from antiosc.extension import info_of_places, refuse_dampers
from antiosc.fem.linalg.algebra import dot, multiply, rows
from antiosc.models.body import ModelInfo
from antiosc.reduce.site import functional
from antiosc_studies.chance.monte_carlo import is_name, quantiles

#: Shapes whose squared independent part is below this share of the largest do not extend the space.
DEPENDENT = 1e-10
#: Positions on an axis of the box [-1, 1]^d at which structures are assembled, in this order.
PLACES = (0.0, 1.0, -1.0, 0.6, -0.6)
#: Least degree of the polynomials.
LEAST_DEGREE = 2
#: Distances from the centre of the box at which pairs of trial structures are extracted.
TRIED = (0.9, 0.8, 0.7)
#: Number of successive trial structures that the space must describe before it counts as complete.
IN_A_ROW = 3
#: Probability that a draw of a distribution lies within the range of the models.
COVERED = 0.998
#: Least growth rate s at which models are compared, over the lowest frequency.
FROM = 0.1
#: Number of growth rates.
RATES = 40


@dataclass(eq=False)
class StructureFamily:
    """The family of structures and sites that `build` and `site` make from values of `names`.

    Attributes
    ----------
    rigid, shift : number of rigid-body modes of all structures; shift of K of the first one.
    basis : (rows of this rank, r) linearly independent shapes of the extracted structures.
    """

    build: Callable[..., Any]
    site: Any
    names: tuple[str, ...]
    rigid: int = 0
    shift: float = 0.0
    basis: Array = field(default_factory=lambda: np.zeros((0, 0)))

    def made(self, values: Array) -> tuple[Structure, Site]:
        """(structure, site) for values of the parameters.

        Raises InputError if `build` returns no structure, or one with another mesh.
        """
        arguments = dict(zip(self.names, values.tolist(), strict=True))
        built = self.build(**arguments)
        structure = checks.instance("what build returns", built, Structure, "a Structure")
        refuse_dampers(structure, "nearby")
        size = rows(structure.K)
        modes = structure.rigid_modes.shape[1]
        if self.basis.size and (size, modes) != (len(self.basis), self.rigid):
            raise InputError(
                f"build must return structures of one mesh and one set of supports; got {size} rows"
                f" and {modes} rigid-body modes after {len(self.basis)} and {self.rigid}."
            )
        fixed = isinstance(self.site, Site) or not callable(self.site)
        site = self.site if fixed else self.site(**arguments)
        expected = "a Site, or a function that returns one"
        return structure, checks.instance("site", site, Site, expected)

    def extend(self, structure: Structure, model: AntiOscillators) -> None:
        """Add the shapes of a structure's model to the space."""
        assert model.shapes is not None
        if not self.basis.size:
            self.rigid = structure.rigid_modes.shape[1]
            self.shift = structure.shift
            self.basis = np.zeros((rows(structure.K), 0))
        new = np.column_stack([structure.rigid_modes, model.shapes])
        comm = structure.comm
        M = structure.M
        shapes = np.column_stack([self.basis, new])
        gram = dot(comm, shapes, multiply(M, shapes))
        scale = 1 / np.sqrt(gram.diagonal())
        lengths, vectors = np.linalg.eigh(gram * scale * scale[:, None])
        independent = lengths > DEPENDENT * lengths[-1]
        self.basis = shapes @ (
            scale[:, None] * vectors[:, independent] / np.sqrt(lengths[independent])
        )

    def projected(self, structure: Structure, site: Site) -> Array:
        """K, M and the load of the site on the space, and 1/compliance of its patch, in one row."""
        V = self.basis
        comm = structure.comm
        load = functional(structure, site)
        K, M = (dot(comm, V, multiply(matrix, V)) for matrix in (structure.K, structure.M))
        local = load.local_compliance
        patch_stiffness = 1 / local if local else 0.0
        return np.concatenate([K.ravel(), M.ravel(), dot(comm, V, load.b), [patch_stiffness]])

    @staticmethod
    def facts(structure: Structure, site: Site) -> dict[str, Any]:
        """The radius of the patch, and the record of structure and site, with their surface."""
        load = functional(structure, site)
        info = info_of_places(structure, {"": load})
        return {"radius": load.radius, "info": info.as_dict()}


#: The keys and indices that lead to a number of nested facts.
Place = tuple[str | int, ...]


@dataclass(frozen=True, eq=False)
class FactsBetween:
    """Facts of structures; the numbers that all of them have are polynomials of the parameters.

    Attributes
    ----------
    first : the facts of the first structure.
    coefficients : of the polynomials (terms,) of a number, by its place.
    """

    first: dict[str, Any]
    coefficients: dict[Place, Array]

    @classmethod
    def of(cls, facts: list[dict[str, Any]], powers: Array) -> FactsBetween:
        """The polynomials through facts of structures, at which the monomials are `powers`."""
        numbers = [dict(_numbers(one)) for one in facts]
        shared = [at for at in numbers[0] if all(at in others for others in numbers)]
        values = {at: np.array([of_one[at] for of_one in numbers]) for at in shared}
        return cls(facts[0], {at: np.linalg.solve(powers, values[at]) for at in shared})

    def at(self, powers: Array) -> Any:
        """The facts where the monomials are `powers`."""
        numbers = {at: float(powers @ of_one) for at, of_one in self.coefficients.items()}
        return _with_numbers(self.first, numbers)


def _entries(facts: object) -> list[tuple[str | int, Any]]:
    """(key or index, value) of a mapping or a sequence; none of a value."""
    if isinstance(facts, Mapping):
        return list(facts.items())
    return list(enumerate(facts)) if isinstance(facts, list | tuple) else []


def _numbers(facts: object, place: Place = ()) -> Iterator[tuple[Place, float]]:
    """Yield (place, value) of the finite numbers of nested facts."""
    if isinstance(facts, float) and np.isfinite(facts):
        yield place, facts
    for key, value in _entries(facts):
        yield from _numbers(value, (*place, key))


def _with_numbers(facts: object, numbers: Mapping[Place, float], place: Place = ()) -> Any:
    """Nested facts with other numbers at their places."""
    inner = {k: _with_numbers(value, numbers, (*place, k)) for k, value in _entries(facts)}
    if isinstance(facts, list | tuple):
        return list(inner.values())
    return inner if isinstance(facts, Mapping) else numbers.get(place, facts)


@dataclass(eq=False, repr=False)
class NearbyModels(ReprMixin):
    """Models of a family of structures; calling it with parameters returns a model.

    Attributes
    ----------
    ranges : name -> (low, high) of each parameter; outside them the model is extracted anew.
    error : largest relative error of the dynamic stiffness, measured against extractions.
    extractions, assemblies : number of structures that were reduced, and only assembled.
    """

    ranges: dict[str, tuple[float, float]]
    error: float = np.nan
    extractions: int = 0
    assemblies: int = 0
    _family: StructureFamily | None = None
    _made: tuple[int, float, int] = (0, 0.0, 20)
    _terms: list[tuple[int, ...]] = field(default_factory=list)
    _coefficients: Array = field(default_factory=lambda: np.zeros((0, 0)))
    _facts_between: FactsBetween | None = None

    def __call__(self, **values: float) -> AntiOscillators:
        """The model at these values of all parameters, without shapes.

        InputError for other names; AntioscErrors of `build` and `extract` outside of the ranges.
        """
        if set(values) != set(self.ranges):
            raise InputError(
                f"the models have the parameters {', '.join(self.ranges)}; got"
                f" {', '.join(values) or 'none'}."
            )
        parameters = np.array([checks.number(name, values[name]) for name in self.ranges])
        low, high = np.array(list(self.ranges.values())).T
        x = (2 * parameters - low - high) / (high - low)
        if np.any(np.abs(x) > 1 + 1e-9):
            self.extractions += 1
            assert self._family is not None
            structure, site = self._family.made(parameters)
            model = extract(structure, site, self._made[2])
            return replace(model, shapes=None, hidden=None)
        return self._at(x)

    def _at(self, x: Array) -> AntiOscillators:
        """The model at a point of the box [-1, 1]^d."""
        powers = _powers(x, self._terms)
        model = _model(powers @ self._coefficients, *self._made)
        assert self._facts_between is not None
        facts = self._facts_between.at(powers)
        return replace(model, radius=facts["radius"], info=ModelInfo.of(facts["info"]))

    def _facts(self) -> list[tuple[str, str]]:
        ranges = [f"{n} {low:.5g} to {high:.5g}" for n, (low, high) in self.ranges.items()]
        counts = f"{self.extractions} extractions, {self.assemblies} assemblies"
        return [("of", ", ".join(ranges)), ("from", counts), ("error", f"{self.error:.1e}")]


def nearby(
    build: Callable[..., Any],
    site: Any,
    ranges: Mapping[str, Any],
    n: int = 20,
    *,
    tol: float = 1e-3,
) -> NearbyModels:
    """Models of structures whose parameters vary within ranges, in about a millisecond each.

    A few structures are extracted and some more assembled; all others are projected onto the
    shapes of these. The models are checked against extractions.

    Parameters
    ----------
    build : callable
        A function of the parameters' names that returns a `Structure`; all its structures have the
        same mesh, up to the places of the nodes.
    site : Site, or callable
        Where they are struck; a function of the same names if the site moves with the nodes.
    ranges : dict
        Name -> (low, high), or a distribution: between its quantiles of 0.1 and 99.9 %.
    n : int
        Number of anti-oscillators.
    tol : float
        Largest relative error of the dynamic stiffness Z(is), measured at extracted structures
        within the ranges, at growth rates s up to the last anti-oscillator that has converged
        (`info.converged`); a larger n includes more of them.

    Returns
    -------
    NearbyModels
        Called outside the ranges, it extracts the model.

    Raises
    ------
    InputError
        For ranges that are none, structures of different meshes, and damped structures.
    AccuracyError
        If the error is larger than `tol`.
    """
    checks.function("build", build, "a function of the parameters")
    limits = {name: _range(name, range_of) for name, range_of in _checked_ranges(ranges).items()}
    check_signature("build", build, limits)
    tol = checks.tolerance(tol)
    n = checks.whole("n", n)
    family = StructureFamily(build, site, tuple(limits))
    low, high = np.array(list(limits.values())).T

    def at(x: Array) -> Array:
        return np.asarray((low + high) / 2 + (high - low) / 2 * x)

    trial_points = [np.zeros(low.size), *_trials(low.size)]
    extracted: list[tuple[Array, AntiOscillators]] = []
    described = 0
    error = np.inf
    for x in trial_points:
        structure, struck = family.made(at(x))
        model = extract(structure, struck, n)
        if extracted:
            row = family.projected(structure, struck)
            error = _misfit(_model(row, family.rigid, family.shift, n), model)
        extracted.append((x, replace(model, shapes=None, hidden=None)))
        described = described + 1 if error < tol / 2 else 0
        if described == IN_A_ROW:
            break
        family.extend(structure, model)
    models = NearbyModels(limits, extractions=len(extracted), _family=family)
    models._made = family.rigid, family.shift, n
    rows: list[Array] = []
    facts: list[dict[str, Any]] = []
    for degree in range(LEAST_DEGREE, len(PLACES)):
        terms = _terms(low.size, degree)
        for term in terms[len(rows) :]:
            made = family.made(at(np.array([PLACES[k] for k in term])))
            rows.append(family.projected(*made))
            facts.append(family.facts(*made))
        nodes = np.array([[PLACES[k] for k in term] for term in terms])
        powers = _powers(nodes, terms)
        models._coefficients = np.linalg.solve(powers, np.array(rows))
        models._facts_between = FactsBetween.of(facts, powers)
        models._terms = terms
        models.assemblies = len(rows)
        with suppress(np.linalg.LinAlgError):  # a mass that is not positive
            models.error = max(_misfit(models._at(x), model) for x, model in extracted)
            if models.error <= tol:
                family.basis = np.zeros((0, 0))  # as large as many models
                return models
    raise AccuracyError(
        f"models between {models.extractions} extractions and {models.assemblies} assemblies differ"
        f" from extracted ones by {models.error:.1e} > tol = {tol:g}: give narrower ranges, or a"
        " larger tol."
    )


def _checked_ranges(ranges: object) -> dict[str, Any]:
    """The ranges by name; InputError if it is not a dict of names."""
    by_name = dict(checks.instance("ranges", ranges, Mapping, 'a dict, as {"E": (60e9, 80e9)}'))
    if not by_name or not all(map(is_name, by_name)):
        raise InputError(
            f"ranges must have names of arguments; got {', '.join(map(str, by_name))}."
        )
    return by_name


def _range(name: str, value: object) -> tuple[float, float]:
    """(low, high) of a parameter."""
    if hasattr(value, "ppf"):
        value = quantiles(name, value, np.array([(1 - COVERED) / 2, (1 + COVERED) / 2]))
    low, high = checks.floats(f"the range of {name}", value, (2,)).tolist()
    if not low < high:
        raise InputError(f"the range of {name} must have low < high; got {low:g} and {high:g}.")
    return low, high


def _trials(d: int) -> list[Array]:
    """Trial points in [-1, 1]^d: pairs in which parameters change together or oppositely, then the
    axes.
    """
    signs = [np.where(np.arange(d) // period % 2, -1.0, 1.0) for period in (1, d, 2)]
    pairs = [share * sign for share, sign in zip(TRIED, signs, strict=True)]
    return [*(sign * place for place in pairs for sign in (1, -1)), *np.eye(d), *-np.eye(d)]


def _terms(d: int, degree: int) -> list[tuple[int, ...]]:
    """The exponents of all monomials up to a degree, sorted by degree."""
    exponents = product(range(degree + 1), repeat=d)
    return sorted((term for term in exponents if sum(term) <= degree), key=lambda term: sum(term))


def _powers(x: Array, terms: list[tuple[int, ...]]) -> Array:
    """Values (…, terms) of the monomials at x (…, d)."""
    return np.asarray(np.prod(np.asarray(x)[..., None, :] ** np.array(terms), axis=-1))


def _model(row: Array, rigid: int, shift: float, n: int) -> AntiOscillators:
    """The model of a row of `StructureFamily.projected`; the first `rigid` modes are rigid."""
    size = int(np.sqrt(row.size / 2))  # 2 size² + size + 1 entries
    K, M = (block.reshape(size, size) for block in row[: 2 * size**2].reshape(2, -1))
    b = row[2 * size**2 : -1]
    stiffness = row[-1]
    x, shapes = scipy.linalg.eigh((K + K.T) / 2, (M + M.T) / 2)
    x[:rigid], x[rigid:] = 0.0, np.maximum(x[rigid:], np.finfo(float).eps * x[-1])
    weights = shapes.T @ b
    C, G = (float(weights**2 @ (x + shift) ** -k) for k in (1.0, 2.0))
    model = from_free_modes(np.sqrt(x), weights, C, G, min(n, size), shift, "krylov")
    return replace(model, local_compliance=1 / stiffness if stiffness else 0.0)


def _misfit(model: AntiOscillators, known: AntiOscillators) -> float:
    """Largest relative difference of Z(ω = i s), for s up to the last converged frequency.

    At imaginary frequencies (growing motions) Z has no poles, and each anti-oscillator counts by
    its mass. Those that have not converged represent all higher modes and differ between two
    reductions.
    """
    if not known.n:
        return abs(model.m_st / known.m_st - 1)
    last = min(max(known.info.converged or 1, 1), known.n)
    s = 1j * np.geomspace(FROM * known.omega[0], known.omega[last - 1], RATES)
    Z = model.dynamic_stiffness(s)
    Z_known = known.dynamic_stiffness(s)
    local = abs(model.local_compliance - known.local_compliance) * float(abs(Z_known[0]))
    return float(np.max(np.abs(Z / Z_known - 1))) + local
