"""`drop`: the fall of a part from a height onto a floor, with all its impacts."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from math import hypot, inf, sqrt
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from antiosc.base import checks, plausible
from antiosc.base._types import Array, BoolArray
from antiosc.base.errors import AccuracyWarning, InputError, warn
from antiosc.base.plausible import FASTEST_WAVE, GRAVITY
from antiosc.base.process import one_thread
from antiosc.base.progress import counting
from antiosc.base.texts import FieldsRepr, Result
from antiosc.extension import check_executor
from antiosc.models.motion import unit_vector
from antiosc_studies.chance.monte_carlo import chunk_results, sample_of
from antiosc_studies.chance.sample import QUANTILES, Quantile, Sample, levels_text, quantile
from antiosc_studies.drops.body import MODES, MOST_MODES, free_body
from antiosc_studies.drops.fall import Fall, fall_of
from antiosc_studies.drops.flight import rotation_matrices
from antiosc_studies.drops.floor import Floor, Setting, as_floor
from antiosc_studies.drops.follow import followed
from antiosc_studies.drops.free_body import FreeBody, State
from antiosc_studies.drops.layer import with_layer_contact
from antiosc_studies.drops.lines import with_lines
from antiosc_studies.drops.trajectory import MOST_IMPACTS, initial_state

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Number of faces that an edge and a corner belong to.
FACES = {"face": 1, "edge": 2, "corner": 3}
DOWN = np.array([0.0, 0.0, -1.0])


def orientation(
    body: FreeBody,
    tilt: Sequence[float],
    face: str | None,
    edge: str | None,
    corner: str | None,
    toward: Sequence[float] | None,
) -> Array:
    """Rotation (3, 3) from the axes of the mesh to those of the floor; see `drop`."""
    options = {"face": face, "edge": edge, "corner": corner, "toward": toward}
    given_options = {name: value for name, value in options.items() if value is not None}
    if len(given_options) > 1:
        raise InputError(
            f"give one of face, edge, corner and toward; got {', '.join(given_options)}."
        )
    R = np.eye(3)
    for name, value in given_options.items():
        down = unit_vector(name, value) if name == "toward" else _downward(body, name, value)
        R = onto(down, DOWN)
    angles = checks.floats("tilt", tilt, None)
    if angles.shape != (3,):
        tilt_text = checks.shown(tilt)
        raise InputError(
            f"tilt must be three angles in degrees, about x, y and z; got {tilt_text}."
        )
    return tilted(angles) @ R


def tilted(angles: Array) -> Array:
    """Rotation (3, 3) by angles (3,) [degree] about fixed x, then y, then z."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_euler("xyz", angles, degrees=True).as_matrix())


def onto(direction: Array, other: Array) -> Array:
    """The smallest rotation (3, 3) that turns the unit vector `direction` into `other`."""
    middle = direction + other
    if middle @ middle < 1e-12:  # half a turn about an axis across
        axis = np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))])
        return np.asarray(2 * np.outer(axis, axis) / (axis @ axis) - np.eye(3))
    rotation = 2 * np.outer(other, direction) - np.outer(middle, middle) / (1 + direction @ other)
    return np.asarray(np.eye(3) + rotation)


def _downward(body: FreeBody, kind: str, argument: object) -> Array:
    """Unit vector (3,) in the body that points down when the named face, edge or corner is
    lowest.
    """
    name = checks.text(kind, argument)
    components = {axis: float(f"{sign}1") for sign, axis in re.findall(r"([+-])([xyz])", name)}
    if not len(name) / 2 == len(components) == FACES[kind]:
        if kind == "face" and body.structure is not None:
            return _group(body, name)
        example = {"face": "-z", "edge": "-x-z", "corner": "+x-y-z"}[kind]
        raise InputError(f"{kind} names its faces, as {example!r}; got {name!r}.")
    signs = np.array([components.get(axis, 0.0) for axis in "xyz"])
    if kind == "face":
        return signs
    # the part may have no corner near that of the box: take its farthest point in that direction
    extreme = body.points[np.argmax(body.points @ signs)]
    if kind == "edge":
        low = body.points.min(axis=0)
        high = body.points.max(axis=0)
        extreme = np.where(signs > 0, high, low) * (signs != 0)
    return np.asarray(extreme / np.linalg.norm(extreme))


def _group(body: FreeBody, name: str) -> Array:
    """The mean outward normal of a group of faces."""
    from antiosc.extension import on_mesh
    from antiosc.reduce.site.map_sites import surface

    assert body.structure is not None
    part = on_mesh(body.structure, 'an assembly has no groups of its own: name a face as "-z".')
    normal = surface(part, name).normals.sum(axis=0)
    size = float(np.linalg.norm(normal))
    if size < 1e-9:
        raise InputError(
            f"the normals of the faces {name!r} have no mean: give the direction toward the floor."
        )
    return np.asarray(normal / size)


#: Number of falls in one call of an executor.
AT_ONCE = 20
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
                name: {text: self.quantile(name, q).value for text, q in levels.items()}
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

        The interval is that between order statistics, for any distribution (binomial).
        """
        values = self.largest(quantity, impact)
        values = values[np.isfinite(values)]
        if not len(values):
            raise InputError("no fall has such an impact.")
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
    executor: Executor | None,
) -> Drops:
    """The falls of an ensemble, each drawn from a seed that depends on its number alone."""
    seeds = np.random.SeedSequence(checks.whole("seed", seed, least=0)).spawn(n)
    draw = partial(_random_fall, body.alone(), start, setting, ensemble)
    chunks = [[{"seed": s} for s in seeds[k : k + AT_ONCE]] for k in range(0, n, AT_ONCE)]
    counts: dict[int, list[dict[str, float] | str]] = {}
    with counting("falls", n) as report:
        for k, rows in chunk_results(partial(_tumble, draw), chunks, executor):
            counts[k] = rows
            report(sum(map(len, counts.values())))
    sample = sample_of("falls", {}, [row for k in sorted(counts) for row in counts[k]])
    table = {
        name: np.reshape([v for key, v in sample.values.items() if key.startswith(name)], (-1, n)).T
        for name in QUANTITIES
    }
    count = np.sum(~np.isnan(table[QUANTITIES[0]]), axis=1)
    yields, missed, unsure = (sample.values[n] > 0 for n in ("yields", "missed", "unsure"))
    for flags, text in (
        (yields, "yield in contact, where Hertz's force is too high: see the notes of one fall"),
        (unsure, "land along lines whose forces are not sure: see the notes of one fall"),
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
    flags = {"yields": fall.contact_yields, "missed": fall.missed, "unsure": fall.unsure}
    return {name: float(value) for name, value in flags.items()} | {
        f"{name} {k}": float(getattr(impact, name))
        for name in QUANTITIES
        for k, impact in enumerate(fall.impacts)
    }


#: Longest first flight [s].
LONGEST = 1e4
#: Least height [m], below which there is no flight.
LEAST_HEIGHT = 1e-9
#: Number of standard deviations within which an ensemble's falls must be plausible.
DRAWN = 3.0
#: Least mass of a floor's model at its site over that of the part. An impact of a block of 0.5 kg
#: on a soil cone with 1e-3, 1e-5, 1e-6 kg is computed in 0.2, 2.2, 7.2 s, and with 1e-9 kg in
#: minutes.
LIGHTEST = 1e-8


@checks.within_range
@one_thread()
def drop(
    part: Any,
    height: float,
    tilt: Sequence[float] = (0.0, 0.0, 0.0),
    floor: Floor | None = None,
    until: str | int | float = "rest",
    *,
    face: str | None = None,
    edge: str | None = None,
    corner: str | None = None,
    toward: Sequence[float] | None = None,
    spin: Sequence[float] = (0.0, 0.0, 0.0),
    velocity: Sequence[float] = (0.0, 0.0, 0.0),
    gravity: float = GRAVITY,
    damping: Any = None,
    modes: int = MODES,
    corner_radius: float | None = None,
    tol: float = 1e-3,
    ensemble: Tilts | None = None,
    n: int = 100,
    seed: int = 0,
    executor: Executor | None = None,
) -> Fall | Drops:
    """Drop a part from a height and follow its flights and impacts until it rests.

    Parameters
    ----------
    part : Structure, RigidBody, Sphere or FreeBody
        The part, free in space, without supports; z of its mesh points up. A Structure is one of a
        mesh, an assembly, or matrices with coordinates; a RigidBody touches with its sites. The
        `body` of another fall is accepted too; it has its modes, damping and corner_radius.
    height : float
        Height of the lowest point over the floor [m].
    tilt : (a, b, c)
        Rotations [degree] about the x, then the y, then the z axis before the fall, applied after
        the orientation by face, edge, corner or toward.
    floor : Floor, optional
        Default: rigid, without friction.
    until : "rest", int or float
        When the fall ends: at rest, after a number of impacts, or at a time [s]. The part is at
        rest on points around its centre of mass when the energy that the floor could still take
        from its rigid motion is at most that of a lift by 0.1 % of the height: a ball that rolls,
        and a part that slides without friction, are at rest. "rest" also ends after 200
        impacts or 600 contacts.
    face, edge, corner : str, optional
        Lowest face, edge or corner, with the centre of mass above it: "-z", "-x-z", "+x-y-z" name
        extremes of the part in the axes of its mesh; a face may also be the name of a group.
    toward : (x, y, z), optional
        Direction in the axes of the mesh that points down.
    spin, velocity : (x, y, z)
        Initial spin [rad/s] and velocity of the centre [m/s], in the axes of the floor.
    gravity : float
        [m/s^2].
    damping : float, sequence or Damping, optional
        Damping of the free modes; default: a ratio of 1 %.
    modes : int
        Number of free modes.
    corner_radius : float, optional
        Radius [m] of sharp corners and edges; default 1 mm, at most a quarter of the part's least
        dimension.
    tol : float
        Relative error of the contact forces in an impact, all contacts together.
    ensemble : Tilts, optional
        Random variation: n falls are computed, and `Drops` are returned.
    n, seed, executor
        For an ensemble: number of falls, seed of the draws, executor that computes them.

    Returns
    -------
    Fall, or Drops with `ensemble`.

    Raises
    ------
    InputError
        For a part with supports, one without points or materials, and values out of range.

    Warns
    -----
    AccuracyWarning
        A spin above 2 % of the lowest natural frequency, which stiffens the part; a fall that
        does not come to rest; contact forces that miss `tol` after 50 000 steps; a layer that is
        pressed in deeper than its thickness or than 0.3 of the radius of a round point; a contact
        along a line that is inclined or has no law of its own; falls of an ensemble that failed,
        or for which one of these is true.
    """
    setting = Setting(
        as_floor(floor),
        checks.positive("gravity", gravity, "m/s^2"),
        checks.positive("height", height, "m"),
        *end_of(until),
        checks.tolerance(tol),
    )
    motion = {
        name: checks.floats(name, vector, (3,))
        for name, vector in (("spin", spin), ("velocity", velocity))
    }
    count = checks.whole("modes", modes, most=MOST_MODES)
    body = free_body(part, count, damping, corner_radius)
    body = with_lines(body, setting.floor)
    body = (
        replace(body, layer_contact=None)
        if setting.floor.layer is None
        else with_layer_contact(body)
    )
    if ensemble is not None:
        checks.instance("ensemble", ensemble, Tilts, "Tilts(sigma=...)")
    _check_ground(body, setting.floor)
    _check_flight(body, setting, ensemble, **motion)
    arrival = float(np.sqrt(2 * setting.gravity * setting.height))
    plausible.warn_each([plausible.impact_doubt(None, (), arrival, motion["velocity"])])
    R = orientation(body, tilt, face, edge, corner, toward)
    start = initial_state(body, setting, R, **motion)
    if ensemble is None:
        if executor is not None:
            raise InputError("an executor computes an ensemble: give Tilts as the ensemble.")
        with followed(setting) as report:
            fall = fall_of(body, start, setting, report)
        fall.warn()
        return fall
    check_executor(executor)
    return tumbles(body, start, setting, ensemble, checks.whole("n", n), seed, executor)


def end_of(until: str | int | float) -> tuple[int, float]:
    """(largest number of impacts, longest time [s]) of a fall; InputError for invalid `until`."""
    if isinstance(until, str):
        if until != "rest":
            raise InputError(f'until is "rest", a number of impacts or a time in s; got {until!r}.')
        return MOST_IMPACTS, inf
    if isinstance(until, int) and not isinstance(until, bool):
        return checks.whole("until", until), inf
    return MOST_IMPACTS, checks.positive("until", until, "s")


def _check_ground(body: FreeBody, floor: Floor) -> None:
    """InputError for a floor model that is too light, for which each impact would take minutes."""
    inverse_mass = 0.0 if floor.model is None else float(np.sum(floor.model.modal().b ** 2))
    limit = LIGHTEST * body.mass
    if inverse_mass * limit > 1:
        raise InputError(
            f"the floor's model has {1 / inverse_mass:.3g} kg at its site, and must have at least "
            f"{LIGHTEST:g} of the part's mass, {limit:.3g} kg: it follows each force at once, in "
            f"steps too small to compute. Give it more, as soil_cone does."
        )


def _check_flight(
    body: FreeBody, setting: Setting, ensemble: Tilts | None, spin: Array, velocity: Array
) -> None:
    """InputError for a first flight that is implausibly fast or long."""
    fastest_spin = float(np.linalg.norm(spin))
    height = setting.height
    prefix = ""
    if ensemble is not None:
        fastest_spin += DRAWN * ensemble.spin
        height *= 1 + DRAWN * ensemble.height
        prefix = f"{DRAWN:g} standard deviations of the ensemble off, "
    speed = float(np.linalg.norm(velocity)) + body.extent * fastest_spin
    touch_speed = hypot(speed, sqrt(2 * setting.gravity * height))
    flight_time = sqrt(2 * height / setting.gravity)
    if touch_speed > FASTEST_WAVE:
        raise InputError(
            f"{prefix}the part would touch at {touch_speed:.3g} m/s, at most {FASTEST_WAVE:g} "
            "are meant: "
            f"height is in m ({height:g}), gravity in m/s^2 ({setting.gravity:g}), spin in rad/s "
            f"({fastest_spin:g})."
        )
    if setting.height < LEAST_HEIGHT:
        raise InputError(f"height must be at least {LEAST_HEIGHT:g} m; got {setting.height:g}.")
    if flight_time > LONGEST:
        raise InputError(
            f"{prefix}the part would fall for {flight_time:.3g} s, at most {LONGEST:g} are "
            "meant: height is "
            f"in m ({height:g}), gravity in m/s^2 ({setting.gravity:g})."
        )
