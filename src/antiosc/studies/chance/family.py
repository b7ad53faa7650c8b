"""Structures of one mesh with different parameters, and the space of their shapes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.fem.extraction.extract import extract
from antiosc.fem.linalg.algebra import dot, multiply, rows
from antiosc.fem.site import Functional, Site, functional
from antiosc.fem.structure.structure import Structure, refuse_dampers
from antiosc.models.anti_oscillators import AntiOscillators

#: Squared length of a direction over that of the shapes, below which it adds nothing to the space.
DEPENDENT = 1e-10


@dataclass(eq=False)
class Family:
    """What `build` and `site` make of the values of `names`.

    Attributes
    ----------
    rigid, shift : number of rigid-body modes of all structures, and the first one's shift of K.
    basis : (rows of this rank, r) shapes of extracted structures, independent of each other.
    """

    build: Callable[..., Any]
    site: Any
    names: tuple[str, ...]
    n: int
    rigid: int = 0
    shift: float = 0.0
    basis: Array = field(default_factory=lambda: np.zeros((0, 0)))

    def made(self, values: Array) -> tuple[Structure, Functional]:
        """The structure at these values, and the load of its site.

        InputError where it is none, or of another mesh.
        """
        given = dict(zip(self.names, values.tolist(), strict=True))
        found = self.build(**given)
        structure = checks.instance("what build returns", found, Structure, "a Structure")
        refuse_dampers(structure, "nearby")
        size, modes = rows(structure.K), structure.rigid_modes.shape[1]
        if self.basis.size and (size, modes) != (len(self.basis), self.rigid):
            raise InputError(
                f"build must return structures of one mesh and one set of supports; got {size} rows"
                f" and {modes} rigid-body modes after {len(self.basis)} and {self.rigid}."
            )
        return structure, functional(structure, self._site(given))

    def extracted(self, values: Array) -> tuple[Structure, Functional, AntiOscillators]:
        """The same, and its own model with shapes."""
        structure, load = self.made(values)
        site = self._site(dict(zip(self.names, values.tolist(), strict=True)))
        return structure, load, extract(structure, site, self.n)

    def _site(self, given: dict[str, float]) -> Site:
        site = self.site if isinstance(self.site, Site) or not callable(self.site) else None
        found = self.site(**given) if site is None else site
        return checks.instance("site", found, Site, "a Site, or a function that returns one")

    def extend(self, structure: Structure, model: AntiOscillators) -> None:
        """Add the shapes of a structure to the space."""
        assert model.shapes is not None
        if not self.basis.size:
            self.rigid, self.shift = structure.rigid_modes.shape[1], structure.shift
            self.basis = np.zeros((rows(structure.K), 0))
        new = np.column_stack([structure.rigid_modes, model.shapes])
        comm, M = structure.comm, structure.M
        every = np.column_stack([self.basis, new])
        gram = dot(comm, every, multiply(M, every))
        scale = 1 / np.sqrt(gram.diagonal())
        lengths, turn = np.linalg.eigh(gram * scale * scale[:, None])
        kept = lengths > DEPENDENT * lengths[-1]
        self.basis = every @ (scale[:, None] * turn[:, kept] / np.sqrt(lengths[kept]))

    def projected(self, structure: Structure, load: Functional) -> Array:
        """K, M and the load of the site on the space, 1/compliance of its patch."""
        V, comm = self.basis, structure.comm
        K, M = (dot(comm, V, multiply(matrix, V)) for matrix in (structure.K, structure.M))
        local = load.local_compliance
        own = 1 / local if local else 0.0
        return np.concatenate([K.ravel(), M.ravel(), dot(comm, V, load.b), [own]])

    def release(self) -> None:
        """Forget the space, which is as large as many models."""
        self.basis = np.zeros((0, 0))
