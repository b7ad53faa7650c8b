"""Forecast of the time (seconds of one core) and memory (bytes) of the solvers of a large part.

The cost of a factor follows from the number of its entries, which a symbolic analysis gives; that
of two levels from the size of their matrices and the iterations of one trial solve. These depend on
Poisson's ratio, on thinness, slivers, directions of the material and springs, and a random load
takes within 20 % of the iterations of the loads of a model (measured).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from antiosc.base.texts import plain

#: Solves in turn that a model of twenty anti-oscillators needs.
SOLVES = 22
#: Bytes per entry of a factor, and of the matrices and work arrays beside it.
BYTES = 8 * 1.3
#: Bytes of two levels for each entry of the coarse factor, which may need double precision.
COARSE_BYTES = 10.0
#: Seconds of a factor for each of its entries, and for entries^1.5, by which operations grow.
ASSEMBLED, FACTORED = 2.2e-8, 3.5e-12
#: Seconds of a solve for each entry; k right-hand sides at once take k^0.4 times as long.
SUBSTITUTED, AT_ONCE = 1e-9, 0.4
#: Seconds of an iteration of two levels for each entry of the factor of the coarse level.
COARSE = 0.5e-9
#: Fewest iterations of a solve by two levels: compact blocks of hexahedra take 8, tetrahedra 10.
FEWEST = 8


@dataclass(frozen=True)
class Products:
    """Cost of a two-level solver per entry of A, stored or not, in bytes and seconds.

    row : entries in a row of A.
    bytes : memory of the levels and, for products by cells, of the data of the cells.
    aggregated : bytes where the coarse level is not factored, with its products while they are
        made.
    seconds : time of an iteration.
    """

    row: float
    bytes: float
    aggregated: float
    seconds: float


#: From the entries; their number is that of A.
ENTRIES = Products(math.nan, 6.0, 20.0, 8e-9)
#: From straight isotropic tetrahedra (by aggregation a trace at 2.25 million dofs).
TETRAHEDRA = Products(80.0, 4.5, 8.0, 1.1e-9)
#: Entries of a factor of quadratic elements over those of linear ones on the same cells: 12 to 19
#: from plates to compact blocks of tetrahedra, 43 000 to 340 000 dofs; 10 to 13 of hexahedra.
FINER = 15.0
#: Seconds of the set-up of two levels for each entry, beside the factor of the coarse level.
SET_UP = 4e-8


@dataclass(frozen=True)
class Cost:
    """Forecast of a solver: bytes, and seconds of one core if known."""

    bytes: float
    seconds: float | None = None

    def __str__(self) -> str:
        time = "" if self.seconds is None else f"{plain(self.seconds)} s, "
        return f"forecast {time}{self.bytes / 1e9:.2g} GB"


def of_factor(entries: float, columns: float) -> Cost:
    """Cost of a factor of `entries` entries and the solves of a model, `columns` at once."""
    return Cost(BYTES * entries, seconds_of_factor(entries, columns))


def seconds_of_factor(entries: float, columns: float) -> float:
    """Seconds for a factor of `entries` entries and the solves of a model, `columns` at once."""
    return _factored(entries) + SOLVES * SUBSTITUTED * entries * columns**AT_ONCE


def seconds_of_steps(entries: float, steps: int) -> float:
    """Seconds of a factor of `entries` entries and of `steps` solves, one after the other."""
    return _factored(entries) + steps * SUBSTITUTED * entries


def _factored(entries: float) -> float:
    return ASSEMBLED * entries + FACTORED * entries**1.5


#: (c, p): the factor of a structure of shells has some c dofs^p entries. A bottle of 12 000 to
#: 198 000 dofs has c = 52 to 54.
FILL = 53.0, 1.15
#: Bytes for each dof and anti-oscillator: the bottle took 6 GB with 792 000 dofs.
EACH_SHAPE = 16.0
#: Bytes for each dof of a structure of shells: K, M and their assembly. A printed carriage of
#: 142 000 dofs took 0.38 GB before, and 0.94 GB with 20 anti-oscillators (1.09 GB with 150).
OF_SHELLS = 2700.0


def of_sheet(dofs: float, n: int) -> float:
    """Bytes of a model of `n` anti-oscillators beside a structure of shells that is made."""
    coefficient, power = FILL
    return BYTES * coefficient * dofs**power + EACH_SHAPE * n * dofs


@dataclass(frozen=True)
class LevelSizes:
    """Numbers of entries from which the cost of a two-level solver follows.

    stored : entries of A; for products by cells those that A would have.
    factor : entries of the factor of A, from which those of the coarse factor follow; 0: the coarse
        level is not factored.
    """

    stored: float
    products: Products
    factor: float = 0.0

    @property
    def coarse(self) -> float:
        """Number of entries in the factor of the coarse level."""
        return self.factor / FINER

    @property
    def bytes(self) -> float:
        """Bytes of the levels and work arrays, without A."""
        if not self.factor:
            return self.products.aggregated * self.stored
        return self.products.bytes * self.stored + COARSE_BYTES * self.coarse

    @property
    def set_up(self) -> float:
        """Seconds of the set-up of the levels."""
        return SET_UP * self.stored + _factored(self.coarse)

    @property
    def iteration(self) -> float:
        """Seconds of one iteration."""
        return self.products.seconds * self.stored + COARSE * self.coarse

    def cost(self, iterations: float, columns: float) -> Cost:
        """Cost of a model whose solves take `iterations` iterations each."""
        solves = SOLVES * columns * iterations * self.iteration
        return Cost(self.bytes, self.set_up + solves)

    def iterations_within(self, seconds: float, columns: float) -> int:
        """Most iterations per solve for which the model's total time is at most `seconds`."""
        return max(0, int((seconds - self.set_up) / (SOLVES * columns * self.iteration)))
