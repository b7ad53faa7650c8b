"""Histories as tables and files: CSV, JSON, pandas, and files that are loaded again."""

from __future__ import annotations

import dataclasses
import io
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from antiosc import __version__
from antiosc.base import checks, files
from antiosc.base._types import Array
from antiosc.base.brief import Brief
from antiosc.base.errors import InputError, MissingDependencyError
from antiosc.models import model_file
from antiosc.models.body import places_of
from antiosc.models.model_info import info_of

#: The format of a file of results.
FORMAT = "antiosc-history"
#: Largest table that is loaded, bytes.
LARGEST = 2**30
#: Contacts of which a file lists the times.
MOST_CONTACTS = 10_000


class Results(Brief):
    """What a history can be written as.

    `columns` and `numbers` say what it has.
    """

    def columns(self) -> dict[str, Array]:
        """The table of the history: name with unit -> values (n,) at `time`."""
        raise NotImplementedError

    def numbers(self) -> dict[str, Any]:
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

    def to_dataframe(self) -> Any:
        """The table as a pandas DataFrame, its index the time in s.

        Raises
        ------
        MissingDependencyError
            pandas is not installed.
        """
        try:
            import pandas as pd
        except ImportError:
            raise MissingDependencyError(
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
            The file cannot be written.
        """
        target, table = checks.path("path", path), self.columns()
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
    results: Mapping[str, Any]
    table: Mapping[str, Array]

    def columns(self) -> dict[str, Array]:
        """The table of the history: name with unit -> values (n,) at `time`."""
        return dict(self.table)

    def numbers(self) -> dict[str, Any]:
        """Its single results: name -> JSON value."""
        return dict(self.results)

    def __getattr__(self, name: str) -> Any:
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
    """Results of one impact (`History`)."""

    def columns(self) -> dict[str, Array]:
        """The table of the history: name with unit -> values (n,) at `time`."""
        own: Any = self
        energy = own.energy
        return {
            "time [s]": own.time,
            "force [N]": own.force,
            "indentation [m]": own.indentation,
            "displacement [m]": own.displacement,
            "velocity [m/s]": own.velocity,
            "impactor displacement [m]": own.impactor_displacement,
            "impactor velocity [m/s]": own.impactor_velocity,
            "kinetic energy [J]": energy.kinetic,
            "strain energy [J]": energy.strain,
            "contact energy [J]": energy.contact,
            "dissipated energy [J]": energy.dissipated,
        }

    def numbers(self) -> dict[str, Any]:
        """Its single results: name -> JSON value."""
        own: Any = self
        return {
            "peak_force": float(own.peak_force),
            "impulse": float(own.impulse),
            "contact_time": float(own.contact_time),
            "restitution": own.restitution,
            "contacts": [list(map(float, pair)) for pair in own.contacts[:MOST_CONTACTS]],
            "energy_drift": float(own.energy.drift),
            "step": float(own.step),
            "error": {name: float(value) for name, value in own.error.items()},
            "error_covers": covers(own),
            "sites": {name: list(point) for name, point in places_of(own.model).items()},
            "status": int(own.status),
            "message": str(own.message),
        }

    def _facts(self) -> list[tuple[str, str]]:
        own: Any = self
        e = own.restitution
        count = len(own.contacts)
        return [
            ("bodies", f"{type(own.model).__name__}, {type(own.impactor).__name__}"),
            ("peak force", f"{own.peak_force:.6g} N, impulse {own.impulse:.6g} N s"),
            ("contact", f"{own.contact_time:.4g} s in {count} contact(s), restitution "
             + ("not known" if e is None else f"{e:.4f}")),
            ("run", f"{own.time[-1]:.4g} s, {own.time.size} nodes, status {own.status}"),
        ]  # fmt: skip

    def __getstate__(self) -> dict[str, Any]:
        """The fields with all values computed, for pickle; a structure stays behind."""
        own: Any = self
        state = {f.name: getattr(self, f.name) for f in dataclasses.fields(own)}
        segments = [
            dataclasses.replace(
                one, indentation=Given(one.indentation()), states=Given(one.states())
            )
            for one in own.trajectory.segments
        ]
        state["trajectory"] = dataclasses.replace(own.trajectory, pieces=Given(segments))
        return state | ({"structure": None} if "structure" in state else {})


@dataclass(frozen=True, eq=False)
class Given:
    """A function without arguments that returns a value."""

    value: Any

    def __call__(self) -> Any:
        return self.value


class SceneResults(Results):
    """Results of a scene (`SceneHistory`)."""

    def columns(self) -> dict[str, Array]:
        """The table of the history: name with unit -> values (n,) at `time`."""
        own: Any = self
        table: dict[str, Array] = {"time [s]": own.time}
        for contact in own.assembly.scene.contacts:
            name, found = f"{contact.a} - {contact.b}", own[contact.a, contact.b]
            table[f"{name} force [N]"] = found.force
            table[f"{name} indentation [m]"] = found.indentation
            for i, friction in enumerate(found.friction.T):
                table[f"{name} friction {i + 1} [N]"] = friction
        for name, body in own.bodies.items():
            table[f"{name} kinetic energy [J]"] = body.kinetic
            table[f"{name} strain energy [J]"] = body.strain
        return table

    def numbers(self) -> dict[str, Any]:
        """Its single results: name -> JSON value."""
        own: Any = self
        contacts = {}
        for contact in own.assembly.scene.contacts:
            found = own[contact.a, contact.b]
            contacts[f"{contact.a} - {contact.b}"] = {
                "peak_force": float(found.peak_force),
                "impulse": float(found.impulse),
                "contact_time": float(found.contact_time),
                "contacts": [list(map(float, pair)) for pair in found.contacts[:MOST_CONTACTS]],
            }
        return {
            "contacts": contacts,
            "energy_drift": float(own.energy.drift),
            "error": {name: float(value) for name, value in own.error.items()},
            "error_covers": covers(own),
            "sites": {name: list(point) for name, point in scene_places(own).items()},
            "status": int(own.status),
            "message": str(own.message),
        }

    def _facts(self) -> list[tuple[str, str]]:
        own: Any = self
        pairs = [(c.a, c.b) for c in own.assembly.scene.contacts]
        peaks = [(own[pair].peak_force, pair) for pair in pairs]
        peak, (a, b) = max(peaks, key=lambda one: one[0])
        return [
            ("bodies", ", ".join(own.assembly.bodies)),
            ("contacts", f"{len(pairs)}, {sum(p > 0 for p, _ in peaks)} of them closed"),
            ("peak force", f"{peak:.6g} N of {a} - {b}"),
            ("run", f"{own.time[-1]:.4g} s, {own.time.size} nodes, status {own.status}"),
        ]


def covers(history: Any) -> str:
    """What the `error` of a history covers, and where the mesh's stands."""
    scene = getattr(history, "assembly", None)
    bodies = [getattr(history, "model", None)]
    if scene is not None:
        bodies = [placed.body for placed in scene.bodies.values()]
    facts = [info_of(one) for one in bodies]
    if not any(info.structure for info in facts):
        return "time integration"
    if any(getattr(one, "strain_error", None) is not None for one in bodies):
        return "time integration; mesh: in error_budget"
    remedy = ', error="estimate" of extract does' if any(i.meshed for i in facts) else ""
    return f"time integration; mesh: not estimated{remedy}"


def covered(history: Any) -> str:
    """The error of the force of a history, with what it covers."""
    known = f"{history.error['force']:.1e}" if "force" in history.error else "not estimated"
    return f"{known} ({covers(history)})"


def scene_places(history: Any) -> dict[str, tuple[float, ...]]:
    """Where the sites of the bodies of a scene lie [m]: "body:site", or "body" -> point."""
    return {
        f"{name}:{site}" if site else name: point
        for name, placed in history.assembly.bodies.items()
        for site, point in places_of(placed.body).items()
    }


def _quoted(name: str) -> str:
    """A name as CSV has it."""
    name = files.table_text(name)
    return '"' + name.replace('"', '""') + '"' if any(c in name for c in ',"\n\r') else name
