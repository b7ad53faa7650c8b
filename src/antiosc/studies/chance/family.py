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
from antiosc.fem.site.functionals import functional
from antiosc.fem.site.site import Site
from antiosc.fem.structure.structure import Structure, refuse_dampers
from antiosc.models.anti_oscillators import AntiOscillators

#: Squared length of a direction over that of the shapes, below which it adds nothing to the space.
DEPENDENT = 1e-10


@dataclass(eq=False)
class Family:
    """What `build` makes of the values of `names`.

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

    def structure(self, values: Array) -> Structure:
        """The structure at these values; InputError where it is none, or of another mesh."""
        made = self.build(**dict(zip(self.names, values.tolist(), strict=True)))
        found = checks.instance("what build returns", made, Structure, "a Structure")
        refuse_dampers(found, "nearby")
        size, modes = rows(found.K), found.rigid_modes.shape[1]
        if self.basis.size and (size, modes) != (len(self.basis), self.rigid):
            raise InputError(
                f"build must return structures of one mesh and one set of supports; got {size} rows"
                f" and {modes} rigid-body modes after {len(self.basis)} and {self.rigid}."
            )
        return found

    def extracted(self, values: Array) -> tuple[Structure, AntiOscillators]:
        """The structure at these values, and its own model with shapes."""
        structure = self.structure(values)
        site = checks.instance("site", self.site, Site, "a Site")
        return structure, extract(structure, site, self.n)

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

    def projected(self, structure: Structure) -> Array:
        """K, M and the load of the site on the space, 1/compliance of its patch."""
        V, comm = self.basis, structure.comm
        K, M = (dot(comm, V, multiply(matrix, V)) for matrix in (structure.K, structure.M))
        load = functional(structure, self.site)
        local = load.local_compliance
        own = 1 / local if local else 0.0
        return np.concatenate([K.ravel(), M.ravel(), dot(comm, V, load.b), [own]])
