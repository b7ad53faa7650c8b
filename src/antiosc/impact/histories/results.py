"""How a run ended, and histories as tables and files: CSV, JSON, pandas, files loaded again."""

from __future__ import annotations

import io
import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, NamedTuple, cast

import numpy as np

from antiosc import __version__
from antiosc.base import checks, errors, files
from antiosc.base._types import Array
from antiosc.base.checks import ROUNDING
from antiosc.base.errors import InputError
from antiosc.base.texts import ReprMixin, engineering, percent, point_text as placed
from antiosc.engine import library
from antiosc.engine.convergence import Converged, stopped
from antiosc.engine.march import Run
from antiosc.engine.system import System
from antiosc.impact.assembly import Assembly
from antiosc.impact.histories import verdict
from antiosc.impact.histories.energy import GAIN
from antiosc.impact.states import free_steps
from antiosc.models import model_file
from antiosc.models.body import info_of, site_points
from antiosc.models.stretch import stretch_of

if TYPE_CHECKING:
    from antiosc.impact.bodies import SceneBody
    from antiosc.impact.histories import History
    from antiosc.impact.histories.parts import ContactHistory


#: status of a run: complete; complete, but not to the tolerance; stopped before the end; complete,
#: but the bodies still touch at the end
COMPLETED, INEXACT, STOPPED, TOUCHING = 0, 1, 2, 3

#: Rotation [rad] of a body above which a warning is given.
SMALL_ROTATION = 0.1
#: Contacts and scenes of a batch that a message names.
_NAMED = 5


@dataclass(frozen=True)
class CheckResult:
    """Status and message of a run; `unusual`: warn even if the status is 0."""

    status: int
    message: str
    unusual: bool = False

    def with_shortage(self, shortage: str) -> CheckResult:
        """The result with the status of a model that has too few anti-oscillators."""
        worse = self.status if self.status in (INEXACT, STOPPED) else INEXACT
        return CheckResult(worse, f"{self.message} {shortage}", self.unusual)

    def warn(self) -> None:
        """Warn at the caller's line unless the run completed as requested."""
        if self.status:
            errors.warn(self.message, errors.AccuracyWarning)
        elif self.unusual:
            errors.warn(self.message)


class RunEnd(NamedTuple):
    """How a run ended, as input of its check.

    `time` [s] reached, `touches` their number, `open` the contacts still closed, and the errors.
    """

    answer: int
    time: float
    touches: int
    open: Sequence[int]
    force: float
    peak: float
    certain: float


def open_contacts(run: Run, system: System) -> list[int]:
    """Contacts that touched during the run and are closed at its end."""
    if len(system.laws) == 1 and (not len(run.events) or run.events[-1, 2] == library.APART):
        return []
    events = run.events.tolist()
    last = {which: piece for _, which, piece, _ in events}
    on = sorted(int(c) for c, piece in last.items() if piece != library.APART)
    parted = {which for _, which, piece, _ in events if piece == library.APART} if on else ()
    return [c for c in on if c in parted or not system.closed[c]]


def check_result(
    assembly: Assembly,
    ended: RunEnd,
    tol: float,
    limits: tuple[int, int],
    failure: str = "",
    gain: Callable[[], float] = lambda: 0.0,
) -> CheckResult:
    """Status and message of a run; `limits`: max_contacts, max_steps; `gain`: of energy."""
    failure = failure or stopped(ended.answer, ended.time, *limits)
    if failure:
        return CheckResult(STOPPED, failure[0].upper() + failure[1:] + ".")
    cut = cut_short_message(assembly, ended)
    if doubt := inexact_message(ended, tol, limits[1], gain):
        return CheckResult(INEXACT, f"{doubt} {cut}".rstrip())
    if untouched := no_contact_message(assembly, ended):
        return CheckResult(COMPLETED, f"Never touched: {untouched}.", unusual=True)
    return CheckResult(TOUCHING, cut) if cut else CheckResult(COMPLETED, "Completed.")


def inexact_message(
    ended: RunEnd | Converged, tol: float, max_steps: int, gain: Callable[[], float]
) -> str:
    """Why a complete run does not meet the tolerance; "" if it does."""
    worst = max(ended.force, ended.peak)
    if worst == np.inf:
        if ended.certain > 0:
            return (
                f"The error is not known: a finer run takes too many steps. Up to"
                f" {ended.certain:.4g} s the two agree; shorten the duration to that."
            )
        return (
            f"The error is not known: max_steps = {max_steps} leaves no finer run to compare with;"
            f" raise it or shorten the duration."
        )
    if not worst <= tol:
        return (
            f"The contact forces did not converge: finer runs within max_steps = {max_steps} differ"
            f" by {worst:.2g}, not tol = {tol:g} (if they rattle, small errors grow). Up to"
            f" {ended.certain:.4g} s they agree; raise max_steps, or shorten the duration to that."
        )
    share = gain()
    if share > GAIN:
        return (
            f"The scene gained energy, {share:.2g} of the highest that it had; use a smaller tol or"
            f" step."
        )
    return ""


def cut_short_message(assembly: Assembly, ended: RunEnd) -> str:
    """Warning of contacts that are still closed at the end; "" without, or if they always were."""
    contacts = [assembly.scene.contacts[c] for c in ended.open]
    if not contacts:
        return ""
    named = ", ".join(f"{c.a!r} - {c.b!r}" for c in contacts[:_NAMED])
    more = ", ..." if len(contacts) > _NAMED else ""
    return (
        f"The run ends during contact of {named}{more}: contact time, impulse and peak force are"
        f" those up to {ended.time:g} s; lengthen the duration."
    )


def no_contact_message(assembly: Assembly, ended: RunEnd) -> str:
    """Why nothing touched, perhaps by a wrong sign; "" if something did."""
    system = assembly.system
    if ended.touches or np.any(system.pressed):
        return ""
    p = len(assembly.laws)
    speed, push = (
        _without_rounding(system.beta[:p], system.v),
        _without_rounding(system.beta[:p], system.loads[0]),
    )
    for motion, unit in ((speed, "m/s"), (push, "m/s^2")):
        c = int(np.argmax(motion))
        contact, most = assembly.scene.contacts[c], float(motion[c])
        if most > 0:
            return (
                f"the gap of {system.offsets[0, c]:g} m of {contact.a!r}, {contact.b!r} closes at"
                f" {most:g} {unit} at first and was not closed within {ended.time:g} s; lengthen"
                f" the duration"
            )
        if np.any(motion < 0):
            return (
                f"the gap of {contact.a!r}, {contact.b!r} opens at {-most:g} {unit} at first; if it"
                f" should close, reverse the sign of the velocity or gravity or, in a scene, the"
                f" ends"
            )
    if system.breaks.size > 1:  # what acts changes in time
        return f"no contact closed within {ended.time:g} s; lengthen the duration"
    return "nothing moves the bodies toward each other; give one a velocity > 0, or gravity"


def _without_rounding(beta: Array, modal: Array) -> Array:
    """beta modal (p,), with 0 for values that are rounding."""
    felt = beta @ modal
    return np.where(abs(felt) > ROUNDING * (abs(beta) @ abs(modal)), felt, 0.0)


def warn_large_rotation(name: str, angle: float) -> None:
    """Warn of a body whose rotation is not small."""
    if angle > SMALL_ROTATION:
        errors.warn(
            f"{name!r} turned by {angle:.2g} rad; rotations are taken as small, below"
            f" {SMALL_ROTATION:g} rad.",
            errors.AccuracyWarning,
        )


def warn_batch(results: Sequence[CheckResult]) -> None:
    """Warn once of each kind of failure in a batch, with the scenes in which it occurred."""
    kinds: dict[tuple[int, bool], list[int]] = {}
    for i, one in enumerate(results):
        if one.status or one.unusual:
            kinds.setdefault((one.status, one.unusual), []).append(i)
    for (status, _), scenes in kinds.items():
        named = ", ".join(map(str, scenes[:_NAMED])) + (", ..." if len(scenes) > _NAMED else "")
        errors.warn(
            f"{len(scenes)} of {len(results)} scenes ({named}), as scene {scenes[0]}:"
            f" {results[scenes[0]].message}",
            errors.AccuracyWarning if status else errors.AntioscWarning,
        )


#: Deflection over the thickness up to which a sheet that is held hardly stretches: at a clamped
#: circle's half thickness the stretching adds 11 % to the force (1 + 0.443 (w/h)²).
SMALL_DEFLECTION = 0.5
#: Looks at a run in a period of the lowest mode, as a flight is one step, and at most in all.
SAMPLES_PER_PERIOD, MOST_SAMPLES = 32, 4096


REMEDY = (
    'take stretch="auto" of extract or impact_map, which has these forces of a part of one mesh'
)


def beyond_linear(name: str, deflection: float, thickness: float) -> str:
    """Warning that the deflection [m] of a supported sheet exceeds linear theory; "" if not."""
    ratio = deflection / thickness
    if not ratio > SMALL_DEFLECTION:
        return ""
    return (
        f"{name!r} deflects by {1e3 * deflection:.3g} mm, {ratio:.3g} times the thickness"
        f" {1e3 * thickness:.3g} mm of its sheet, more than {SMALL_DEFLECTION:g}, up to which"
        f" linear theory holds: where its edges are held it stretches and is stiffer,"
        f" forces are larger and deflections smaller than these (a cantilever, or a sheet"
        f" on soft springs, hardly stretches); {REMEDY}, or make the sheet thicker."
    )


#: Deflection over the thickness up to which forces to third order hold (benchmarks/thin_sheets.py).
QUARTIC = 3.0
#: Share of that up to which the ends of steps tell enough: a body that stretches has no flights.
FAR = 0.8


def beyond_quartic(name: str, deflection: float, thickness: float) -> str:
    """Warning that the deflection [m] of a sheet exceeds second-order theory; "" if not."""
    ratio = deflection / thickness
    if not ratio > QUARTIC:
        return ""
    return (
        f"{name!r} deflects by {1e3 * deflection:.3g} mm, {ratio:.3g} times the thickness of its"
        f" sheet, more than {QUARTIC:g}, up to which second-order strain in a few modes holds:"
        " analyse it by an explicit finite element program."
    )


def large_deflection_message(history: History) -> str:
    """Warning of the worst deflection of a supported sheet beyond linear theory; "" if none."""
    worst, message = 0.0, ""
    for name, body, h in _sheets(history):
        if not body.omega.all():  # it is free
            continue
        stretches = stretch_of(body.body) is not None
        sentence = "" if stretches else _beyond_linear_of_curved(name, body, h, history)
        if sentence:
            return sentence
        ends = name in history.assembly.stretched and deflection(history, name, closely=False)
        if ends and ends < FAR * QUARTIC * h:
            continue
        w = deflection(history, name)
        if w > worst * h:
            worst, message = w / h, (beyond_quartic if stretches else beyond_linear)(name, w, h)
    return message


#: The least deflection over the thickness that may change a displacement by 0.3 % (`NEGLIGIBLE` of
#: `antiosc.impact.stretching`): the force is at most 1 + 1.85 (w/h)² that of linear theory, of
#: a disc with a hinged edge that does not move (S. Timoshenko, S. Woinowsky-Krieger, *Theory of
#: Plates and Shells*, table 82). The same as a change of the force of a curved sheet.
SLIGHT_DEFLECTION, SLIGHT_CHANGE = 0.04, 3e-3


def may_stretch(history: History) -> bool:
    """Whether second-order strain may change a linear run of sheets noticeably."""
    return any(
        deflection(history, name) > SLIGHT_DEFLECTION * h
        or abs(_worst_change(name, body, history)[0]) > SLIGHT_CHANGE
        for name, body, h in _sheets(history)
    )


def _sheets(history: History) -> Iterator[tuple[str, SceneBody, float]]:
    """Name, body and thickness [m] of each part of sheets that is not a cantilever."""
    if not history.assembly.thin:
        return
    for name, body in history.assembly.bodies.items():
        h = info_of(body.body).thickness
        if h is not None:
            yield name, body, h


def deflection(history: History, name: str, closely: bool = True) -> float:
    """Largest displacement [m] of a body's sites along the contacts, by elastic modes alone.

    closely : at many times, or at the ends of steps alone.
    """
    a, omega = history.assembly, history.assembly.bodies[name].omega
    own, columns = a.spans[name], a.columns[name]
    sites = a.B[own, columns] @ a.G[: len(a.laws), columns].T
    q = sampled_motion(history, omega) if closely else free_steps(history.run, a.system)
    return float(np.abs(q[:, own] @ (sites * (omega > 0)[:, None])).max(initial=0.0))


#: Change of the force by second-order strain from which a curved sheet is told: of a peak force,
#: which grows as the root of the stiffness, about twice its own change.
CURVED_CHANGE = 0.1


def _beyond_linear_of_curved(name: str, body: SceneBody, thickness: float, history: History) -> str:
    """Warning of the deflection of a curved, supported sheet at its worst site; "" if none."""
    change, w = _worst_change(name, body, history)
    if abs(change) <= CURVED_CHANGE:
        return ""
    softer = "softer, forces are smaller and deflections larger than these, and it may snap through"
    stiffer = "stiffer, forces are larger and deflections smaller than these"
    return (
        f"{name!r}, a curved sheet, deflects by {1e3 * w:.3g} mm, {w / thickness:.3g} times its"
        f" thickness: second-order strain changes its force by about {change:+.0%}: it is"
        f" {softer if change < 0 else stiffer}; {REMEDY}."
    )


def _worst_change(name: str, body: SceneBody, history: History) -> tuple[float, float]:
    """Largest relative change of the force on a curved sheet, and the deflection [m]."""
    changes = info_of(body.body).second_order or {}
    if not changes:
        return 0.0, 0.0
    motion, found = sampled_motion(history, body.omega)[:, history.assembly.spans[name]], []
    for site, share in changes.items():
        u = motion @ body.B[:, body.columns_of(site)[0]]
        k = int(np.argmax(np.abs(u)))
        found.append((share * float(u[k]), abs(float(u[k]))))
    return max(found, key=lambda one: abs(one[0]))


def sampled_motion(history: History, omega: Array) -> Array:
    """Modal displacements (n, J) at the ends of steps and at evenly spaced times."""
    end = float(history.run.time[-1])
    periods = end * float(omega[omega > 0].min(initial=np.inf)) / (2 * np.pi)
    periods = periods if np.isfinite(periods) else 0.0
    t = np.linspace(0.0, end, int(min(MOST_SAMPLES, SAMPLES_PER_PERIOD * (1 + periods))))
    return np.vstack([free_steps(history.run, history.assembly.system), history.states(t)[0]])


#: The format of a file of results.
FORMAT = "antiosc-history"
#: Endings of tables, which `save` does not write.
TABLES = {".csv", ".json", ".txt", ".xlsx", ".mat"}
#: Largest table that is loaded, bytes.
LARGEST = 2**30
#: Contacts of which a file lists the times.
MOST_CONTACTS = 10_000


class Results(ReprMixin):
    """Base of histories that can be written as tables, numbers and files.

    `columns` and `numbers` say what it has.
    """

    def columns(self) -> dict[str, Array]:
        """The table of the history: name with unit -> values (n,) at `time`."""
        raise NotImplementedError

    def numbers(self) -> dict[str, object]:
        """Its single results: name -> JSON value."""
        raise NotImplementedError

    def to_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write the table as CSV: a line of names with units, then the values with all digits.

        Raises
        ------
        InputError
            The file cannot be written.
        """
        target, table = checks.path("path", path), self.columns()
        stream = io.StringIO()
        stream.write(",".join(_quoted(name) for name in table) + "\n")
        np.savetxt(stream, np.column_stack(list(table.values())), fmt="%.17g", delimiter=",")
        files.write_text(target, stream.getvalue(), "the table")
        return target

    def to_json(self, path: str | os.PathLike[str] | None = None) -> str:
        """The single results and the table as JSON text; with `path` it is also written there.

        Raises
        ------
        InputError
            The file cannot be written.
        """
        table = {name: values.tolist() for name, values in self.columns().items()}
        text = json.dumps({"antiosc": __version__, **self.numbers(), "series": table}, indent=1)
        if path is not None:
            files.write_text(checks.path("path", path), text + "\n", "the results")
        return text

    def to_dataframe(self) -> object:
        """The table as a pandas DataFrame, its index the time in s.

        Raises
        ------
        MissingDependencyError
            pandas is not installed.
        """
        try:
            import pandas as pd
        except ImportError:
            raise errors.MissingDependencyError(
                "to_dataframe needs pandas: install python3-pandas (or pip install pandas), or use "
                "columns(), to_csv or to_json."
            ) from None
        frame = pd.DataFrame(self.columns())
        return frame.set_index(frame.columns[0])

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the table and the single results to one NumPy `.npz` file; see `load`.

        Models and fields are not stored: pickle the history for those.

        Raises
        ------
        InputError
            The file cannot be written, or has the ending of a table.
        """
        target, table = checks.path("path", path), self.columns()
        if target.suffix.lower() in TABLES:
            raise InputError(
                f"save writes a NumPy archive (.npz), not {target.suffix}: use to_csv or to_json "
                f"for a table, or another ending than {target.name} has."
            )
        header = {
            "format": FORMAT,
            "version": model_file.VERSION,
            "names": list(table),
            "numbers": self.numbers(),
            "kind": type(self).__name__,
        }
        model_file.write(target, header, {"table": np.array(list(table.values()))})
        return target

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> SavedHistory:
        """Read a file that `save` wrote.

        Raises
        ------
        InputError
            The file is not one.
        """
        header, arrays = model_file.read(path, {"table"}, FORMAT, LARGEST)
        try:
            names, numbers = list(map(str, header["names"])), dict(header["numbers"])
            table = dict(zip(names, checks.array("table", arrays["table"], None), strict=True))
            return SavedHistory(str(header["kind"]), numbers, table)
        except (InputError, KeyError, TypeError, ValueError) as error:
            raise InputError(f"{os.fspath(path)} is damaged ({error}); write it again.") from None


@dataclass(frozen=True, eq=False, repr=False)
class SavedHistory(Results):
    """A history from a file: its table and its single results, without model and fields.

    Attributes
    ----------
    kind : "History" or "SceneHistory".
    results : name -> single result; `saved.peak_force` is `saved.results["peak_force"]`.
    table : name with unit -> (n,) values; `saved.force` is `saved.table["force [N]"]`.
    """

    kind: str
    results: Mapping[str, object]
    table: Mapping[str, Array]

    def columns(self) -> dict[str, Array]:
        """The table of the history: name with unit -> values (n,) at `time`."""
        return dict(self.table)

    def numbers(self) -> dict[str, object]:
        """Its single results: name -> JSON value."""
        return dict(self.results)

    def __getattr__(self, name: str) -> object:
        if name.startswith("_") or name in ("results", "table", "kind"):
            raise AttributeError(name)
        if name in self.results:
            return self.results[name]
        for column, values in self.table.items():
            if column.rpartition(" [")[0].replace(" ", "_") == name:
                return values
        raise AttributeError(f"the saved {self.kind} has no {name!r}")

    def _facts(self) -> list[tuple[str, str]]:
        names = [name.rpartition(" [")[0] for name in self.table]
        rows = [("of", self.kind), ("series", ", ".join(names))]
        return [*rows, *((k, f"{v}") for k, v in self.results.items() if k == "peak_force")]


class HistoryResults(Results):
    """Tables, numbers and summary of a `History`.

    Where every contact and body is `named`, their names stand before their values; otherwise there
    is one contact, of a structure and an impactor.
    """

    named: ClassVar[bool] = False

    def columns(self) -> dict[str, Array]:
        """The table of the history: name with unit -> values (n,) at `time`."""
        own = cast("History", self)
        table: dict[str, Array] = {"time [s]": own.time}
        for contact in own.contact_histories:
            name = f"{_contact_label(contact)} " if self.named else ""
            table[f"{name}force [N]"] = contact.force
            table[f"{name}indentation [m]"] = contact.indentation
            for i, friction in enumerate(contact.friction.T):
                table[f"{name}friction {i + 1} [N]"] = friction
        if self.named:
            for name, body in own.bodies.items():
                table[f"{name} kinetic energy [J]"] = body.kinetic
                table[f"{name} strain energy [J]"] = body.strain
            return table
        for name in ("displacement", "impactor displacement"):
            table[f"{name} [m]"] = getattr(own, name.replace(" ", "_"))
            rate = name.replace("displacement", "velocity")
            table[f"{rate} [m/s]"] = getattr(own, rate.replace(" ", "_"))
        for name in ("kinetic", "strain", "contact", "dissipated"):
            table[f"{name} energy [J]"] = getattr(own.energy, name)
        return table

    def numbers(self) -> dict[str, object]:
        """Its single results: name -> JSON value."""
        own = cast("History", self)
        contacts = {
            _contact_label(contact_history): _numbers(contact_history)
            for contact_history in own.contact_histories
        }
        (alone,) = contacts.values() if len(contacts) == 1 else ({},)
        found = {"restitution": own.restitution, "step": float(own.step)} if alone else {}
        return {
            **({"contacts": contacts} if self.named else {**alone, **found}),
            "energy_drift": float(own.energy.drift),
            "error": {name: float(value) for name, value in own.error.items()},
            "error_covers": error_scope(own),
            "sites": {name: list(point) for name, point in history_sites(own).items()},
            "status": int(own.status),
            "message": self.explanation,
            "verdict": self.verdict,
            "details": own.details,
        }

    @property
    def explanation(self) -> str:
        """The message, with a note if the bodies of the only contact still approach at the end."""
        own = cast("History", self)
        e = own.restitution if own.status != STOPPED and len(own.contact_histories) == 1 else None
        if e is None or e >= 0:
            return own.message
        return (
            f"{own.message} After the last release the bodies still approach (restitution {e:.3g} <"
            f" 0) and will touch again: peak force, impulse and restitution are those up to"
            f" {own.run.time[-1]:g} s; lengthen the duration."
        )

    @property
    def verdict(self) -> str:
        """Whether contacts yield, and the permanent indentations, in words."""
        contacts = cast("History", self).contact_histories
        told = [(_contact_label(contact), verdict.sentence(contact)) for contact in contacts]
        if not self.named:
            return told[0][1]
        return " ".join(f"{label}: {text}" for label, text in told if text)

    def summary(self) -> str:
        """The numbers of the impact, or of every contact of a scene, as a short table."""
        own = cast("History", self)
        places = {name: placed(point) for name, point in history_sites(own).items()}
        if not self.named:
            e = own.restitution
            rows = [
                *(("contact", text) for text in [self.verdict] if text),
                ("peak force", self.force_text),
                *(("site", point) for point in places.values()),
                ("impulse", engineering(own.impulse, "N s", 4)),
                ("contacts", f"{len(own.contacts)}"),
                ("contact time", engineering(own.contact_time, "s", 4)),
                ("restitution", "-" if e is None else f"{e:.4f}"),
                ("energy drift", f"{own.energy.drift:.1e}"),
                ("step", engineering(own.step, "s")),
                ("force error", error_text(own)),
                ("law", verdict.law_text(own)),
                *(("stretch", text) for text in own.stretch_texts),
                ("status", self.explanation),
                *(("details", text) for text in own.details),
            ]
            return "\n".join(f"{name:<13} {value}" for name, value in rows)
        lines = [f"{'contact':<24} {'peak force':>11} {'impulse':>11} {'touches':>7} {'time':>10}"]
        for h in own.contact_histories:
            lines.append(
                f"{_contact_label(h):<24} {engineering(h.peak_force, 'N', 4):>11}"
                f" {engineering(h.impulse, 'N s', 4):>11} {len(h.contacts):>7}"
                f" {engineering(h.contact_time, 's', 4):>10}"
            )
        lines += [f"site {name:<19} {point}" for name, point in places.items()]
        lines.append(f"energy drift {own.energy.drift:.1e}; force error {error_text(own)}")
        told = [*filter(None, [self.verdict]), *lines, *own.stretch_texts]
        return "\n".join([*told, self.explanation, *own.details])

    @property
    def stretch_texts(self) -> list[str]:
        """Sentences on bodies that stretch, with the number of their modes."""
        forces = cast("History", self).assembly.stretched
        return [
            f"{name!r} stretches: second-order forces of {one.modes.shape[1]} motions"
            for name, one in forces.items()
        ]

    @property
    def force_text(self) -> str:
        """Peak force of a contact as text, with its error once the error budget is known."""
        own = cast("History", self)
        budget = vars(own).get("error_budget")
        return budget.shown("peak_force") if budget else engineering(own.peak_force, "N", 4)

    def _facts(self) -> list[tuple[str, str]]:
        own = cast("History", self)
        contacts = own.contact_histories
        largest = max(contacts, key=lambda one: one.peak_force)
        length = engineering(own.time[-1], "s")
        return [
            ("bodies", ", ".join(own.assembly.bodies)),
            ("contacts", f"{len(contacts)}, {sum(bool(c.contacts) for c in contacts)} closed"),
            (
                "peak force",
                f"{engineering(largest.peak_force, 'N', 4)} of {_contact_label(largest)}",
            ),
            ("run", f"{length}, {own.time.size} nodes, status {own.status}"),
        ]


def _contact_label(contact: ContactHistory) -> str:
    """The name of a contact in tables."""
    return " - ".join(contact.ends)


def _numbers(contact: ContactHistory) -> dict[str, object]:
    """The single results of one contact."""
    return {
        "peak_force": float(contact.peak_force),
        "impulse": float(contact.impulse),
        "contact_time": float(contact.contact_time),
        "contacts": [list(map(float, pair)) for pair in contact.contacts[:MOST_CONTACTS]],
    }


def error_scope(history: History) -> str:
    """What the `error` of a history covers, and where the error of the mesh is found."""
    bodies = [placed.body for placed in history.assembly.bodies.values()]
    facts = [info_of(body) for body in bodies]
    if not any(info.structure for info in facts):
        return "time integration"
    bounded = any(getattr(body, "strain_error", None) is not None for body in bodies)
    if bounded or any(info.strike for info in facts):
        return "time integration; truncation and mesh: see error_budget"
    remedy = ': error="estimate" of extract does it' if any(i.meshed for i in facts) else ""
    return f"time integration; truncation and mesh are not estimated{remedy}"


def error_text(history: History) -> str:
    """The error of the force of a history as text, with what it covers."""
    known = percent(history.error["force"]) if "force" in history.error else "not estimated"
    return f"{known} ({error_scope(history)})"


def history_sites(history: History) -> dict[str, tuple[float, ...]]:
    """Points [m] of the sites of all bodies, by "body:site" or "body".

    For histories of `simulate`: those of the structure, by site.
    """
    if not history.named:
        return site_points(history.model)
    return {
        f"{name}:{site}" if site else name: point
        for name, placed in history.assembly.bodies.items()
        for site, point in site_points(placed.body).items()
    }


def _quoted(name: str) -> str:
    """A column name, quoted for CSV if necessary."""
    name = files.table_text(name)
    return '"' + name.replace('"', '""') + '"' if any(c in name for c in ',"\n\r') else name
