"""The result of a simulation: `History`, with its numbers, tables and texts."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from antiosc.base._types import Array, ArrayLike, Figure
from antiosc.base.errors import InputError
from antiosc.base.texts import STOPPED, engineering, percent, point_text, restitution_text
from antiosc.impact.histories.factors import (
    modes_with_shapes,
    no_field_message,
    stretch_of_motion,
    stretch_shapes,
)
from antiosc.impact.histories.motion import RunHistory
from antiosc.impact.histories.parts import ContactHistory
from antiosc.impact.histories.site_motion import SiteMotion, site_motion
from antiosc.impact.histories.tables import SavableResults
from antiosc.models.body import info_of, site_points
from antiosc.models.parameters import has_error_bars

if TYPE_CHECKING:
    from collections.abc import Callable

    from antiosc.impact.histories.bars import ErrorBudget


#: Width of the column of names in a summary.
LABEL_WIDTH = 13
#: Contacts of which a file lists the times.
MAX_LISTED_CONTACTS = 10_000


@dataclass(frozen=True, eq=False, repr=False)
class History(RunHistory, SavableResults):
    """History of a simulation; times in s, forces in N, displacements in m.

    `hit[a, b]` is a contact, `hit.bodies[name]` a body; bodies of `simulate` are "structure" and
    "impactor". If there is one contact, its force, numbers and motions are also attributes of
    the history. Results are computed at their first use.

    Attributes
    ----------
    error : estimated relative errors, the largest of all contacts: "force" (L2 norm and impulse)
        and "peak" (at least "force"), not if the user set the step or took SciPy's method; with
        n="auto" also "truncation peak_force", "... impulse", "... contact_time"; with an
        automatic number of second-order modes also "stretch peak_force", ...
    status : 0: completed; 1: completed, tol not met; 2: stopped before the end; 3: completed, but
        a contact is still closed at the end of the run: its contact time, impulse and peak force
        count up to there.
    message : explanation of the status, and changes made to contact laws.
    given : the step [s] set by the user, or None.
    structure : structure with the last mesh of `strike`, for `probe` and fields; not pickled.
    source : the scene or impact with its options, for `again`.
    budget : the `error_budget` of `strike`.
    enclosures : proved bounds on the force of each contact, with proof=True.
    stresses : the stress fields of `strike(…, stress_tol=…)`, quantity -> `PeakField`; else None.
    """

    source: Any = None
    budget: ErrorBudget | None = None
    stresses: Mapping[str, Any] | None = None

    @cached_property
    def error_budget(self) -> ErrorBudget:
        """Error bars of peak force, impulse and contact time: mesh, truncation, time, patch, total.

        Bars are relative errors, such as `hit.error_budget["peak_force"].total`; `print` shows them
        as a table. The first use simulates the impact up to eight more times; the result is kept.
        If the model was extracted without `error="estimate"`, or has no such estimate, the mesh
        error is missing and "mesh" is in `unknown`. InputError for a scene.
        """
        if self.budget is not None:
            return self.budget

        budget_of_hit = getattr(self.source, "error_budget", None)
        if budget_of_hit is None:
            raise InputError("only a History that simulate or strike returned has an error budget.")

        found: ErrorBudget = budget_of_hit(self)
        return found

    def again(
        self,
        *,
        model: object = None,
        law: object = None,
        velocity: object = None,
        duration: float | None = None,
        step: float | None = None,
    ) -> History:
        """The same run with other numbers, by `simulate` or `Scene.run`.

        `velocity` [m/s] is that of the impactor, or of a structure that moves toward an obstacle.
        For a scene, `model` and `velocity` are dicts by body name, `law` by pairs of site names.
        """
        if self.source is None:
            raise InputError(
                "only a History that simulate, strike or Scene.run returned has again."
            )

        changes = {"model": model, "law": law, "velocity": velocity}
        changes |= {"duration": duration, "step": step}
        again: History = self.source.again({k: v for k, v in changes.items() if v is not None})
        return again

    @property
    def rerun(self) -> Rerun | None:
        """Function that repeats the impact on another model to a tolerance; None for a scene."""
        return getattr(self.source, "rerun", None)

    @cached_property
    def site_motion(self) -> SiteMotion | None:
        """Largest displacement of the site along the impact within the run, `largest` [m], and its
        `time` [s]; None for a free part or a scene."""
        return None if self.named else site_motion(self)

    def field(self, t: ArrayLike, body: str = "structure") -> Array:
        """Nodal displacements (n_dofs,) [m] of a body at one time; (n, n_dofs) at several times.

        By Article eq. (8), without the static deflection of a supported body under its own weight.
        `body`: name of a body whose model has shapes.
        """
        displacements = modes_with_shapes(self, body).field(self.coordinates(t, body))
        forces = stretch_of_motion(self, body)
        if forces is None:
            return displacements

        shapes = stretch_shapes(self, body)
        if shapes is None:
            raise InputError(no_field_message(self.of(body)[0]))
        q = np.atleast_2d(self.at(np.atleast_1d(t))[self.name_of(body)].q)
        second_order = forces.pairs(q @ forces.modes) @ shapes.T
        return displacements + (second_order if np.ndim(t) else second_order[0])

    def plot(self, path: str | os.PathLike[str] | None = None) -> Figure | Path:
        """Force and motions as a matplotlib figure; see `antiosc.plotting.plot_history`.

        With `path` (PNG, PDF, SVG, …) the picture is written and the path is returned.
        """
        from antiosc.plot.charts import plot_history  # loaded where a picture is drawn

        values = (getattr(self, field.name) for field in fields(History))
        return plot_history(History(*values) if self.named else self, path)  # with nodes in flights

    def columns(self) -> dict[str, Array]:
        """The table of the history: name with unit -> values (n,) at `time`."""
        table: dict[str, Array] = {"time (s)": self.time}
        for contact in self.contact_histories:
            name = f"{_contact_label(contact)} " if self.named else ""
            table[f"{name}force (N)"] = contact.force
            table[f"{name}indentation (m)"] = contact.indentation
            for i, friction in enumerate(contact.friction.T):
                table[f"{name}friction {i + 1} (N)"] = friction

        if self.named:
            for name, body in self.bodies.items():
                table[f"{name} kinetic energy (J)"] = body.kinetic
                table[f"{name} strain energy (J)"] = body.strain
            return table

        for name in ("displacement", "impactor displacement"):
            table[f"{name} (m)"] = getattr(self, name.replace(" ", "_"))
            rate = name.replace("displacement", "velocity")
            table[f"{rate} (m/s)"] = getattr(self, rate.replace(" ", "_"))

        for name in ("kinetic", "strain", "contact", "dissipated"):
            table[f"{name} energy (J)"] = getattr(self.energy, name)
        return table

    def numbers(self) -> dict[str, object]:
        """Single results of the history as JSON values, by name."""
        contacts = {
            _contact_label(contact_history): _contact_numbers(contact_history)
            for contact_history in self.contact_histories
        }
        (only_contact,) = contacts.values() if len(contacts) == 1 else ({},)
        of_run = {"restitution": self.restitution, "step": float(self.step)} if only_contact else {}
        return {
            **({"contacts": contacts} if self.named else {**only_contact, **of_run}),
            "energy_drift": float(self.energy.drift),
            "error": {name: float(value) for name, value in self.error.items()},
            "error_covers": error_scope(self),
            "sites": {name: list(point) for name, point in history_sites(self).items()},
            "status": int(self.status),
            "message": self.explanation,
            "verdict": self.verdict,
            "details": self.details,
        }

    @property
    def explanation(self) -> str:
        """`message`, with any re-contact warning."""
        return f"{self.message} {self.unfinished}".rstrip()

    @property
    def unfinished(self) -> str:
        """Sentence if the bodies of the only contact approach each other at the end; else ""."""
        e = (
            self.restitution
            if self.status != STOPPED and len(self.contact_histories) == 1
            else None
        )
        if e is None or e >= 0:
            return ""

        return (
            f"After the last release the bodies still approach (restitution {e:.3g}"
            f" < 0) and will touch again: peak force, impulse and restitution are those up to"
            f" {self.run.time[-1]:g} s; lengthen the duration."
        )

    @property
    def verdict(self) -> str:
        """Sentences on contacts that yield and their permanent indentations."""
        from antiosc.impact.histories import verdict  # loaded where it is used

        contacts = self.contact_histories
        sentences = [
            (_contact_label(contact), verdict.yield_sentence(contact)) for contact in contacts
        ]
        if not self.named:
            return sentences[0][1]
        return " ".join(f"{label}: {text}" for label, text in sentences if text)

    def summary(self) -> str:
        """The numbers of the impact, or of every contact of a scene, as a short table."""
        from antiosc.impact.histories import verdict
        from antiosc.impact.histories.bars import contact_time_note

        places = {name: point_text(point) for name, point in history_sites(self).items()}

        if not self.named:
            e = self.restitution
            budget = budget_of(self)
            peak_force = engineering(self.peak_force, "N", 4)
            note = contact_time_note(self)
            rows = [
                *(("contact", text) for text in [self.verdict] if text),
                ("peak force", budget.shown("peak_force") if budget else peak_force),
                *[("proof", one.text) for one in self.enclosures],
                *([("", budget.footnote)] if budget and budget.footnote else []),
                *(("site", point) for point in places.values()),
                ("impulse", engineering(self.impulse, "N s", 4)),
                ("contacts", self.count_text),
                ("contact time", f"{engineering(self.contact_time, 's', 4)}{note and f' {note}'}"),
                ("restitution", "-" if e is None else restitution_text(e, 4)),
                ("energy drift", f"{self.energy.drift:.1e}"),
                ("step", engineering(self.step, "s")),
                ("force error", error_text(self)),
                ("law", verdict.law_text(self)),
                *(("stretch", text) for text in self.stretch_texts),
                ("status", self.explanation),
                *(("details", text) for text in self.details),
            ]
            width = max(len(name) for name, _ in [*rows, (" " * LABEL_WIDTH, "")])
            return "\n".join(f"{name:<{width}} {value}" for name, value in rows)

        lines = [f"{'contact':<24} {'peak force':>11} {'impulse':>11} {'touches':>7} {'time':>10}"]
        for h in self.contact_histories:
            lines.append(
                f"{_contact_label(h):<24} {engineering(h.peak_force, 'N', 4):>11}"
                f" {engineering(h.impulse, 'N s', 4):>11} {len(h.contacts):>7}"
                f" {engineering(h.contact_time, 's', 4):>10}"
            )
            lines += [f"{'':<24} {h.enclosure.text}"] if self.enclosures else []

        lines += [f"site {name:<19} {point}" for name, point in places.items()]
        lines.append(f"energy drift {self.energy.drift:.1e}; force error {error_text(self)}")
        lines_of_text = [*filter(None, [self.verdict]), *lines, *self.stretch_texts]
        return "\n".join([*lines_of_text, self.explanation, *self.details])

    @property
    def stretch_texts(self) -> list[str]:
        """Sentences on bodies with second-order forces and the number of their modes, and on a thin
        solid without such forces."""
        if left_out := self.assembly.omitted_stretch_ratio:
            energy = f"the energy of second-order strain is {percent(left_out)} of that of its"
            return [f"'structure' is taken as linear: {energy} motion at the largest force"]

        change = self.assembly.stretch_effect
        effect = f"{percent(abs(change))} {'larger' if change > 0 else 'smaller'}"
        if abs(change) <= self.error.get("peak", 0.0):
            effect = "different by less than its error by the time steps"

        return [
            f"{name!r} stretches: second-order forces of {forces.modes.shape[1]} motions make the"
            f" largest force {effect}"
            for name, forces in self.assembly.stretch_forces.items()
        ]

    def _facts(self) -> list[tuple[str, str]]:
        contacts = self.contact_histories
        largest = max(contacts, key=lambda contact: contact.peak_force)
        length = engineering(self.time[-1], "s")
        return [
            ("bodies", ", ".join(self.assembly.bodies)),
            ("contacts", f"{len(contacts)}, {sum(bool(c.contacts) for c in contacts)} closed"),
            (
                "peak force",
                f"{engineering(largest.peak_force, 'N', 4)} of {_contact_label(largest)}",
            ),
            ("run", f"{length}, {self.time.size} nodes, status {self.status}"),
        ]


#: Simulates an impact on another model to a tolerance, and by another law if one is given.
Rerun: TypeAlias = "Callable[..., History]"


class SceneHistory(History):
    """History of `Scene.run`: its tables name every contact and body of the scene."""

    named = True


def with_model(hit: History, model: object) -> History:
    """The same history, in which `model` replaces the model of the structure."""
    structure = hit._ends[0]
    bodies = {**hit.assembly.bodies, structure.name: replace(structure, body=model)}
    return replace(hit, assembly=replace(hit.assembly, bodies=bodies))


def _contact_label(contact: ContactHistory) -> str:
    """The name of a contact in tables."""
    return " - ".join(contact.ends)


def _contact_numbers(contact: ContactHistory) -> dict[str, object]:
    """Single results of one contact as JSON values, by name."""
    return {
        "peak_force": float(contact.peak_force),
        "impulse": float(contact.impulse),
        "contact_time": float(contact.contact_time),
        "contacts": [list(map(float, pair)) for pair in contact.contacts[:MAX_LISTED_CONTACTS]],
    }


def error_scope(history: History) -> str:
    """Text: the causes that `history.error` covers, and where to find the other errors."""
    bodies = [scene_body.body for scene_body in history.assembly.bodies.values()]
    facts = [info_of(body) for body in bodies]
    if _has_error_bars(history):
        if history.rerun is None:
            return "time integration; truncation and mesh are told for two bodies alone"
        return "time integration; law, truncation and mesh: see the error budget"
    if not any("structure" in info for info in facts):
        return "time integration"

    meshed = [info for info in facts if info.get("meshed")]
    remedy = ': the error "estimate" of extract does it' if meshed else ""
    if any(info.no_estimate for info in meshed):
        remedy = ": compare two element sizes"

    return f"time integration; truncation and mesh are not estimated{remedy}"


def budget_of(history: History) -> ErrorBudget | None:
    """The error budget of an impact of two bodies; None without error bars."""
    if history.rerun is not None and _has_error_bars(history):
        return history.error_budget
    return vars(history).get("error_budget")


def _has_error_bars(history: History) -> bool:
    """Whether a history has error bars, or a body with an estimated mesh error."""
    bodies = [scene_body.body for scene_body in history.assembly.bodies.values()]
    estimated = any(getattr(body, "strain_error", None) is not None for body in bodies)
    of_strike = any("strike" in info_of(body) for body in bodies)
    return estimated or of_strike or (history.rerun is not None and has_error_bars(history.model))


def error_text(history: History) -> str:
    """Text: the error of the peak force by cause; without a budget, due to law and time steps."""
    budget = budget_of(history)
    if budget is not None:
        return budget.causes_text("peak_force")

    from antiosc.impact.histories import verdict

    error_text = percent(history.error["force"]) if "force" in history.error else "not estimated"
    numerical = f"numerical {error_text} ({error_scope(history)})"
    strongest = max(history.contact_histories, key=lambda contact: contact.peak_force)
    return ", ".join(filter(None, [verdict.law_error_text(strongest), numerical]))


def history_sites(history: History) -> dict[str, tuple[float, ...]]:
    """Points [m] of the sites of all bodies, by "body:site" or "body"."""
    if not history.named:
        return site_points(history.model)

    return {
        f"{name}:{site}" if site else name: point
        for name, scene_body in history.assembly.bodies.items()
        for site, point in site_points(scene_body.body).items()
    }
