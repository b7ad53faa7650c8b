"""Many falls with starts that vary: the distribution of what they give, with bars."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.brief import Brief, Given
from antiosc.base.errors import InputError
from antiosc.base.progress import counting
from antiosc.studies.chance.monte_carlo import made, sample_of
from antiosc.studies.chance.sample import Quantile, quantile
from antiosc.studies.drops.body import FreeBody
from antiosc.studies.drops.course import hung
from antiosc.studies.drops.fall import fall_of
from antiosc.studies.drops.flight import State
from antiosc.studies.drops.floor import Setting
from antiosc.studies.drops.rotation import turned

#: Falls that one call of an executor computes.
AT_ONCE = 20
#: What is kept of each impact.
QUANTITIES = ("peak_force", "impulse", "contact_time", "lost")


@dataclass(frozen=True)
class Tilts(Given):
    """What varies in an ensemble of falls.

    Parameters
    ----------
    sigma : float
        Standard deviation of the tilt about each of the two horizontal axes [degree]; inf: any
        orientation, all equally probable.
    height : float
        Standard deviation of the height over the height.
    friction : float
        Standard deviation of the coefficient of friction; draws below 0 are 0.
    spin : float
        Standard deviation of the spin about each axis [rad/s].
    """

    sigma: float = 0.0
    height: float = 0.0
    friction: float = 0.0
    spin: float = 0.0

    def __post_init__(self) -> None:
        for name in ("height", "friction", "spin"):
            checks.store(self, **{name: checks.nonnegative(name, getattr(self, name))})
        if not checks.rigid(self.sigma):
            checks.store(self, sigma=checks.nonnegative("sigma", self.sigma, "degree"))
        if not any((self.sigma, self.height, self.friction, self.spin)):
            raise InputError("Tilts in which nothing varies: give sigma, height, friction or spin.")


@dataclass(frozen=True, eq=False, repr=False)
class Drops(Brief):
    """The falls of an ensemble.

    Attributes
    ----------
    values : name -> (n, k) of each fall and its impacts, NaN beyond its last: "peak_force" [N],
        "impulse" [N s], "contact_time" [s], "lost" [J].
    orientations : (n, 3, 3) at the start.
    impacts : (n,) numbers of impacts.
    failed : message of each fall that failed, by its number.
    """

    values: dict[str, Array]
    orientations: Array
    impacts: Array
    failed: dict[int, str]

    def __len__(self) -> int:
        return len(self.impacts)

    def largest(self, quantity: str = "peak_force", impact: int | None = None) -> Array:
        """(n,) largest value of each fall, or its value in one impact (from 0)."""
        checks.choice("quantity", quantity, tuple(self.values))
        table = self.values[quantity]
        if impact is not None:
            most = table.shape[1] - 1
            return table[:, checks.whole("impact", impact, least=0, most=most)]
        return np.nanmax(np.where(np.isnan(table), -np.inf, table), axis=1)

    def quantile(
        self,
        quantity: str,
        q: float,
        impact: int | None = None,
        confidence: float = 0.95,
    ) -> Quantile:
        """The quantile q of the falls' largest values, with the bar of its sampling.

        The bar is that between order statistics, for any distribution (binomial).
        """
        found = self.largest(quantity, impact)
        found = found[np.isfinite(found)]
        if not len(found):
            raise InputError("no fall has such an impact.")
        return quantile(found, q, confidence)

    def _facts(self) -> list[tuple[str, str]]:
        q = [self.quantile("peak_force", s).value for s in (0.05, 0.5, 0.95)]
        return [
            ("falls", f"{len(self)}, {len(self.failed)} of them failed"),
            ("peak force", "{:.4g}, {:.4g}, {:.4g} N at 5, 50 and 95 %".format(*q)),
        ]


def tumbles(
    body: FreeBody,
    start: State,
    setting: Setting,
    ensemble: Tilts,
    n: int,
    seed: int,
    executor: Executor | None,
) -> Drops:
    """The falls of an ensemble; each has its own seed, so that they do not depend on each other."""
    seeds = np.random.SeedSequence(checks.whole("seed", seed, least=0)).spawn(n)
    drawn = partial(_drawn, body.alone(), start, setting, ensemble)
    parts = [[{"seed": s} for s in seeds[k : k + AT_ONCE]] for k in range(0, n, AT_ONCE)]
    found: dict[int, list[Any]] = {}
    with counting("falls", n) as ready:
        for k, rows in made(partial(_tumble, drawn), parts, executor):
            found[k] = rows
            ready(sum(map(len, found.values())))
    sample = sample_of("falls", {}, [row for k in sorted(found) for row in found[k]])
    table = {
        name: np.reshape([v for key, v in sample.values.items() if key.startswith(name)], (-1, n)).T
        for name in QUANTITIES
    }
    count = np.sum(~np.isnan(table[QUANTITIES[0]]), axis=1)
    return Drops(table, np.array([drawn(s)[1].R for s in seeds]), count, sample.failed)


def _drawn(
    body: FreeBody, start: State, setting: Setting, tilts: Tilts, seed: Any
) -> tuple[FreeBody, State, Setting]:
    """The body, the start and the setting of one fall."""
    rng = np.random.default_rng(seed)
    if np.isinf(tilts.sigma):
        R = np.asarray(Rotation.from_quat(rng.standard_normal(4)).as_matrix())
    else:
        R = turned(np.radians(tilts.sigma) * np.append(rng.standard_normal(2), 0.0)) @ start.R
    height = setting.height * max(1 + tilts.height * rng.standard_normal(), 0.01)
    friction = max(setting.floor.friction + tilts.friction * rng.standard_normal(), 0.0)
    spin = start.spin(body) + tilts.spin * rng.standard_normal(3)
    floor = replace(setting.floor, friction=friction) if tilts.friction else setting.floor
    own = replace(setting, height=height, floor=floor)
    return body, hung(body, own, R, spin, start.velocity), own


def _tumble(drawn: Callable[[Any], tuple[FreeBody, State, Setting]], seed: Any) -> dict[str, float]:
    """The values of the impacts of one fall, by name and number."""
    impacts = fall_of(*drawn(seed)).impacts
    return {
        f"{name} {k}": float(getattr(one, name))
        for name in QUANTITIES
        for k, one in enumerate(impacts)
    }
