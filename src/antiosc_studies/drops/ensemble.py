"""Ensembles of falls with random starts: `Tilts`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from antiosc import Many
from antiosc.base import checks
from antiosc.base.errors import AccuracyWarning, InputError, warn
from antiosc.base.progress import counting
from antiosc.base.texts import FieldsRepr
from antiosc_studies.chance.monte_carlo import rows_of_runs, sample_of_runs
from antiosc_studies.drops.fall import fall_of, initial_state
from antiosc_studies.drops.flight import rotation_matrices
from antiosc_studies.drops.floor import Setting
from antiosc_studies.drops.free_body import FreeBody, State

#: Results of each impact that are kept.
KEPT_QUANTITIES = ("peak_force", "impulse", "contact_time", "lost")


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


def simulate_falls(
    body: FreeBody, start: State, setting: Setting, ensemble: Tilts, n: int, seed: int
) -> Many:
    """Simulate n falls with random starts; the start of a fall depends on its number and `seed`."""
    seeds = np.random.SeedSequence(checks.whole("seed", seed, least=0)).spawn(n)
    body.patches(np.arange(len(body.points)))  # a fall must not depend on where earlier ones landed
    draw = partial(_random_fall, body, start, setting, ensemble)
    rows: list[dict[str, float] | str] = []

    with counting("falls", n) as report:
        for fall_seed in seeds:
            rows += rows_of_runs(partial(_fall_results, draw), [{"seed": fall_seed}])
            report(len(rows))

    sample = sample_of_runs("falls", {}, rows)
    values = {
        name: np.reshape([v for key, v in sample.values.items() if key.startswith(name)], (-1, n)).T
        for name in KEPT_QUANTITIES
    }
    yields, missed = (sample.values[name] > 0 for name in ("yields", "missed"))
    not_reached = f"have contact forces that do not reach tol = {setting.tol:g}"

    for flags, text in (
        (yields, "yield in contact, where Hertz's force is too high: see the notes of one fall"),
        (missed, not_reached),
    ):
        if flags.any():
            warn(f"{flags.sum()} of {n} falls {text}.", AccuracyWarning)

    facts = {
        "impacts": np.sum(~np.isnan(values["peak_force"]), axis=1),
        "yields": yields,
        "missed": missed,
    }
    messages = dict.fromkeys(np.flatnonzero(missed).tolist(), f"Some falls {not_reached}.")

    return replace(
        sample,
        values=values,
        inputs={"orientation": np.array([draw(one)[1].R for one in seeds])},
        facts=facts,
        messages={**messages, **sample.failures},
    )


def _random_fall(
    body: FreeBody, start: State, setting: Setting, ensemble: Tilts, seed: np.random.SeedSequence
) -> tuple[FreeBody, State, Setting]:
    """The body, initial state and setting of one random fall."""
    rng = np.random.default_rng(seed)
    if np.isinf(ensemble.sigma):
        R = np.asarray(Rotation.from_quat(rng.standard_normal(4)).as_matrix())
    else:
        turn = np.radians(ensemble.sigma) * np.append(rng.standard_normal(2), 0.0)
        R = rotation_matrices(turn) @ start.R
    height = setting.height * max(1 + ensemble.height * rng.standard_normal(), 0.01)
    friction = max(setting.floor.friction + ensemble.friction * rng.standard_normal(), 0.0)
    spin = start.spin(body) + ensemble.spin * rng.standard_normal(3)
    floor = replace(setting.floor, friction=friction) if ensemble.friction else setting.floor
    varied_setting = replace(setting, height=height, floor=floor)
    return body, initial_state(body, varied_setting, R, spin, start.velocity), varied_setting


def _fall_results(
    draw: Callable[[Any], tuple[FreeBody, State, Setting]], seed: np.random.SeedSequence
) -> dict[str, float]:
    """Results of one fall: "name k" -> the quantity of impact k, and 0 or 1 for its flags."""
    fall = fall_of(*draw(seed))
    flags = {"yields": fall.contact_yields, "missed": fall.missed}
    return {name: float(value) for name, value in flags.items()} | {
        f"{name} {k}": float(getattr(impact, name))
        for name in KEPT_QUANTITIES
        for k, impact in enumerate(fall.impacts)
    }
