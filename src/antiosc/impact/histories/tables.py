"""Histories as tables and files: CSV, JSON, and files that can be loaded."""

from __future__ import annotations

import io
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from antiosc import __version__
from antiosc.base import checks, files
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.base.texts import ReprMixin
from antiosc.models.anti_oscillators import FORMAT_VERSION, read_model_file, write_model_file

#: The format of a file of results.
FILE_FORMAT = "antiosc-history"
#: Suffixes of table formats, which `save` does not write.
TABLE_ENDINGS = {".csv", ".json", ".txt", ".xlsx", ".mat"}
#: Largest table that is loaded, bytes.
MAX_TABLE_BYTES = 2**30


class SavableResults(ReprMixin):
    """Base of histories that can be written: subclasses define `columns` and `numbers`."""

    def columns(self) -> dict[str, Array]:
        """The table of the history: name with unit -> values (n,) at `time`."""
        raise NotImplementedError

    def numbers(self) -> dict[str, object]:
        """Single results of the history as JSON values, by name."""
        raise NotImplementedError

    def to_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write the table as CSV: a line of names with units, then the values with all digits.

        InputError if the file cannot be written.
        """
        import csv  # loaded where it is used

        target = checks.path("path", path)
        table = self.columns()
        stream = io.StringIO()
        csv.writer(stream, lineterminator="\n").writerow(map(files.table_text, table))
        np.savetxt(stream, np.column_stack(list(table.values())), fmt="%.17g", delimiter=",")
        files.write_text(target, stream.getvalue(), "the table")

        return target

    def to_json(self, path: str | os.PathLike[str] | None = None) -> str:
        """The single results and the table as JSON text; with `path` it is also written there.

        InputError if the file cannot be written.
        """
        table = {name: values.tolist() for name, values in self.columns().items()}
        text = json.dumps({"antiosc": __version__, **self.numbers(), "series": table}, indent=1)
        if path is not None:
            files.write_text(checks.path("path", path), text + "\n", "the results")
        return text

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the table and the single results to one NumPy `.npz` file; see `load`.

        Models and fields are not stored: pickle the history for them. InputError if the file cannot
        be written, or has the suffix of a table format.
        """
        target = checks.path("path", path)
        table = self.columns()
        if target.suffix.lower() in TABLE_ENDINGS:
            raise InputError(
                f"save writes a NumPy archive (.npz), not {target.suffix}: use to_csv or to_json "
                f"for a table, or another ending than {target.name} has."
            )

        header = {
            "format": FILE_FORMAT,
            "version": FORMAT_VERSION,
            "names": list(table),
            "numbers": self.numbers(),
            "kind": type(self).__name__,
        }
        write_model_file(target, header, {"table": np.array(list(table.values()))})
        return target

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> SavedHistory:
        """Read a file written by `save`; InputError for other files."""
        header, arrays = read_model_file(path, {"table"}, FILE_FORMAT, MAX_TABLE_BYTES)

        try:
            names = list(map(str, header["names"]))
            numbers = dict(header["numbers"])
            table = dict(zip(names, checks.floats("table", arrays["table"], None), strict=True))
            return SavedHistory(str(header["kind"]), numbers, table)
        except (InputError, KeyError, TypeError, ValueError) as error:
            raise InputError(f"{os.fspath(path)} is damaged ({error}); write it again.") from None


@dataclass(frozen=True, eq=False, repr=False)
class SavedHistory(SavableResults):
    """A history from a file: its table and single results, without model and fields.

    Attributes
    ----------
    kind : "History" or "SceneHistory".
    results : name -> single result; `saved.peak_force` is `saved.results["peak_force"]`.
    table : name with unit -> (n,) values; `saved.force` is `saved.table["force (N)"]`.
    """

    kind: str
    results: Mapping[str, object]
    table: Mapping[str, Array]

    def columns(self) -> dict[str, Array]:
        """The table of the history: name with unit -> values (n,) at `time`."""
        return dict(self.table)

    def numbers(self) -> dict[str, object]:
        """Single results of the history as JSON values, by name."""
        return dict(self.results)

    def __getattr__(self, name: str) -> object:
        if name.startswith("_") or name in ("results", "table", "kind"):
            raise AttributeError(name)
        if name in self.results:
            return self.results[name]

        for column, values in self.table.items():
            if column.rpartition(" (")[0].replace(" ", "_") == name:
                return values

        raise AttributeError(f"the saved {self.kind} has no {name!r}")

    def _facts(self) -> list[tuple[str, str]]:
        names = [name.rpartition(" (")[0] for name in self.table]
        rows = [("of", self.kind), ("series", ", ".join(names))]
        return [*rows, *((k, f"{v}") for k, v in self.results.items() if k == "peak_force")]
