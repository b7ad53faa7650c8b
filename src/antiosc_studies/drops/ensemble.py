"""Ensembles of falls: `Tilts` of their starts, `Drops` with the distributions of results."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from antiosc.base import checks
from antiosc.base._types import Array, BoolArray
from antiosc.base.errors import AccuracyWarning, InputError, warn
from antiosc.base.progress import counting
from antiosc.base.texts import FieldsRepr, Result
from antiosc_studies.chance.monte_carlo import rows_of_runs, sample_of
from antiosc_studies.chance.sample import (
    QUANTILES,
    Quantile,
    Sample,
    finite_or_none,
    levels_text,
    quantile,
)
from antiosc_studies.drops.fall import fall_of
from antiosc_studies.drops.flight import rotation_matrices
from antiosc_studies.drops.floor import Setting
from antiosc_studies.drops.free_body import FreeBody, State
from antiosc_studies.drops.trajectory import initial_state

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Results of each impact that are kept.
QUANTITIES = ("peak_force", "impulse", "contact_time", "lost")


@dataclass(frozen=True)
class Tilts(FieldsRepr):
    """Random variation in an ensemble of falls.

    Parameters
    ----------
    sigma : float
        Standard deviation of the tilt about each of the two horizontal axes [degree]; inf: any
        orientation, all equally probable.
    height : float
        Standard deviation of the height over the height.
    friction : float
        Standard deviation of the coefficient of friction; draws below 0 become 0.
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
        if not checks.is_rigid(self.sigma):
            checks.store(self, sigma=checks.nonnegative("sigma", self.sigma, "degree"))
        if not any((self.sigma, self.height, self.friction, self.spin)):
            raise InputError("Tilts in which nothing varies: give sigma, height, friction or spin.")


@dataclass(frozen=True, eq=False, repr=False)
class Drops(Result):
    """The falls of an ensemble.

    Attributes
    ----------
    values : name -> (n, k) results of each fall's impacts, NaN after its last impact: "peak_force"
        [N], "impulse" [N s], "contact_time" [s], "lost" [J].
    orientations : (n, 3, 3) rotations of the part at the start.
    impacts : (n,) numbers of impacts.
    failed : number of each fall that failed -> its message.
    yields, missed : (n,) whether a contact yields, by Hertz's law and the yield strength of the
        part; whether contact forces miss `tol`.
    quantiles : as of `Sample`.
    """

    values: dict[str, Array]
    orientations: Array
    impacts: Array
    failed: dict[int, str]
    yields: BoolArray
    missed: BoolArray
    quantiles: tuple[float, ...] = QUANTILES

    def __len__(self) -> int:
        return len(self.impacts)

    @property
    def status(self) -> int:
        """1 if falls failed or do not reach `tol`, else 0."""
        return int(bool(self.failed) or bool(self.missed.any()))

    @property
    def message(self) -> str:
        """How many falls failed, and how many do not reach `tol`."""
        failed = len(self.failed)
        missed_count = int(self.missed.sum())
        return f"Of {len(self)} falls {failed} failed and {missed_count} do not reach tol."

    def numbers(self) -> dict[str, object]:
        """Quantiles of the largest values of the falls: name -> JSON value."""
        levels = {f"{100 * share:g} %": share for share in self.quantiles}
        return {
            "falls": len(self),
            **{
                name: {text: finite_or_none(self.quantile(name, q)) for text, q in levels.items()}
                for name in self.values
            },
            "status": self.status,
            "message": self.message,
        }

    def plot(self, path: str | os.PathLike[str] | None = None) -> Figure | Path:
        """The distribution of the falls' largest forces; with `path` the picture is written."""
        falls = {"fall": np.arange(float(len(self)))}
        return Sample(falls, {"largest force of a fall (N)": self.largest()}, {}).plot(path)

    def largest(self, quantity: str = "peak_force", impact: int | None = None) -> Array:
        """Largest value (n,) of each fall, or its value in the impact of this number, from 0."""
        checks.choice("quantity", quantity, tuple(self.values))
        table = self.values[quantity]
        if impact is not None:
            last_impact = table.shape[1] - 1
            return table[:, checks.whole("impact", impact, least=0, most=last_impact)]
        return np.nanmax(np.where(np.isnan(table), -np.inf, table), axis=1)

    def quantile(
        self,
        quantity: str,
        q: float,
        impact: int | None = None,
        confidence: float = 0.95,
    ) -> Quantile:
        """The quantile q of the falls' largest values, with its confidence interval.

        The interval is that between order statistics, for any distribution (binomial). A fall that
        failed counts as larger than all others.
        """
        values = self.largest(quantity, impact)
        values = values[np.isfinite(values)]
        if not len(values):
            raise InputError("no fall has such an impact.")
        values = np.append(values, np.full(len(self.failed), np.inf))
        return quantile(values, q, confidence)

    def _facts(self) -> list[tuple[str, str]]:
        q = [f"{self.quantile('peak_force', s).value:.4g}" for s in self.quantiles]
        remarks = [f"{len(self.failed)} of them failed"]
        remarks += [f"{self.yields.sum()} yield in contact"] if self.yields.any() else []
        remarks += [f"{self.missed.sum()} do not reach tol"] if self.missed.any() else []
        return [
            ("falls", ", ".join([f"{len(self)}", *remarks])),
            ("peak force", f"{', '.join(q)} N at {levels_text(self.quantiles)}"),
        ]


def tumbles(
    body: FreeBody,
    start: State,
    setting: Setting,
    ensemble: Tilts,
    n: int,
    seed: int,
) -> Drops:
    """The falls of an ensemble, each drawn from a seed that depends on its number alone."""
    seeds = np.random.SeedSequence(checks.whole("seed", seed, least=0)).spawn(n)
    draw = partial(_random_fall, body.alone(), start, setting, ensemble)
    rows: list[dict[str, float] | str] = []

    with counting("falls", n) as report:
        for fall_seed in seeds:
            rows += rows_of_runs(partial(_tumble, draw), [{"seed": fall_seed}])
            report(len(rows))

    sample = sample_of("falls", {}, rows)
    table = {
        name: np.reshape([v for key, v in sample.values.items() if key.startswith(name)], (-1, n)).T
        for name in QUANTITIES
    }
    count = np.sum(~np.isnan(table[QUANTITIES[0]]), axis=1)
    yields, missed = (sample.values[n] > 0 for n in ("yields", "missed"))
    for flags, text in (
        (yields, "yield in contact, where Hertz's force is too high: see the notes of one fall"),
        (missed, f"have contact forces that do not reach tol = {setting.tol:g}"),
    ):
        if flags.any():
            warn(f"{flags.sum()} of {n} falls {text}.", AccuracyWarning)
    starts = np.array([draw(s)[1].R for s in seeds])
    return Drops(table, starts, count, sample.failed, yields, missed)


def _random_fall(
    body: FreeBody, start: State, setting: Setting, tilts: Tilts, seed: np.random.SeedSequence
) -> tuple[FreeBody, State, Setting]:
    """The body, initial state and setting of one random fall."""
    rng = np.random.default_rng(seed)
    if np.isinf(tilts.sigma):
        R = np.asarray(Rotation.from_quat(rng.standard_normal(4)).as_matrix())
    else:
        R = (
            rotation_matrices(np.radians(tilts.sigma) * np.append(rng.standard_normal(2), 0.0))
            @ start.R
        )
    height = setting.height * max(1 + tilts.height * rng.standard_normal(), 0.01)
    friction = max(setting.floor.friction + tilts.friction * rng.standard_normal(), 0.0)
    spin = start.spin(body) + tilts.spin * rng.standard_normal(3)
    floor = replace(setting.floor, friction=friction) if tilts.friction else setting.floor
    varied_setting = replace(setting, height=height, floor=floor)
    return body, initial_state(body, varied_setting, R, spin, start.velocity), varied_setting


def _tumble(
    draw: Callable[[Any], tuple[FreeBody, State, Setting]], seed: np.random.SeedSequence
) -> dict[str, float]:
    """The results of one fall's impacts, by name and number, and the flags of the fall."""
    fall = fall_of(*draw(seed))
    flags = {"yields": fall.contact_yields, "missed": fall.missed}
    return {name: float(value) for name, value in flags.items()} | {
        f"{name} {k}": float(getattr(impact, name))
        for name in QUANTITIES
        for k, impact in enumerate(fall.impacts)
    }
