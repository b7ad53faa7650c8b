"""`--report`: one page in HTML, complete in itself, with what was computed and how."""

from __future__ import annotations

import contextlib
import datetime
import platform
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from antiosc.app import info
from antiosc.app.scene_file import result_tables as tables
from antiosc.app.scene_file.pages import rendered
from antiosc.app.scene_file.report_pictures import Picture, pictures
from antiosc.app.scene_file.run import Results, on_first
from antiosc.base import checks, files
from antiosc.base.errors import AntioscError, InputError
from antiosc.simulation.error_bars import QUANTITIES
from antiosc.simulation.results import covers
from antiosc.studies.advice import advise

#: What stands below a heading: names and values, a table of columns, a sentence, or nothing.
Block = tables.Rows | dict[str, Any] | str


def checked(path: str) -> Path:
    """The path of a report, or InputError; before anything is computed."""
    target = checks.path("--report", path)
    if target.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"a report is a file named .html; got {checks.shown(path)}.")
    if not target.parent.is_dir():
        raise InputError(f"there is no folder {str(target.parent)!r} for the report.")
    return target


def write(found: Results, path: Path) -> list[Path]:
    """Write the report on the first rank, complete or absent; its path.

    The page is made on every rank: fields and the dimensions of a structure are shared.
    """
    text = page(found, list(pictures(found)))
    on_first(lambda: files.write_text(path, text, "the report"))
    return [path]


def page(found: Results, drawn: Sequence[Picture]) -> str:
    """The page as a text."""
    path, program = found.compiled.document.path, f"antiosc {info.version()}"
    now = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC")
    python = f"Python {platform.python_version()}, NumPy {np.__version__}"
    source = ""
    with contextlib.suppress(OSError):  # the file may have gone since it was read
        source = path.read_text(encoding="utf-8")
    return rendered(
        "report.html",
        title=found.compiled.title or path.stem,
        origin=f"{path.name}, {program}, {python}, {now}. All numbers are in SI units.",
        warnings=found.warnings,
        sections=_sections(found),
        pictures=drawn,
        program=program,
        source=source,
    )


def _sections(found: Results) -> list[tuple[str, list[Block]]]:
    """Headings, each with what stands below it."""
    hit, sections = found.history, []
    if hit is not None:
        sections.append(("Results", [*_results(hit), tables.probe_rows(found)]))
    if found.fall is not None:
        blocks: list[Block] = [tables.fall_columns(found.fall), tables.fall_rows(found)]
        sections.append(("Fall", [*blocks, getattr(found.fall, "status", "")]))
    if found.batch is not None:
        sections.append(("Sweep", [tables.sweep_columns(found)]))
    if found.map is not None:
        sections.append(("Map", [tables.map_rows(found.map)]))
    if hit is not None:
        sections.append(("Errors", _errors(hit)))
    if found.structure is not None or found.model is not None:
        sections.append(("Model", _model(found)))
    return sections


def _results(history: Any) -> list[Block]:
    contacts = tables.contacts_of(history)
    if contacts:
        hits = list(contacts.values())
        columns: dict[str, Any] = {
            "contact": [f"{a} – {b}" for a, b in contacts],
            "peak force (N)": [hit.peak_force for hit in hits],
            "impulse (N s)": [hit.impulse for hit in hits],
            "contact time (s)": [hit.contact_time for hit in hits],
            "contacts": [len(hit.contacts) for hit in hits],
        }
        return [columns, history.message]
    e = history.restitution
    rows = [
        ("peak force", f"{history.peak_force:.6g} N"),
        ("impulse", f"{history.impulse:.6g} N s"),
        ("contact time", f"{history.contact_time:.6g} s"),
        ("contacts", f"{len(history.contacts)}"),
        ("coefficient of restitution", "not defined" if e is None else f"{e:.4f}"),
    ]
    return [rows, history.message]


def _errors(history: Any) -> list[Block]:
    rows = [(f"time integration: {name}", f"{value:.2g}") for name, value in history.error.items()]
    rows.append(("these errors cover", covers(history)))
    rows.append(("energy drift over the run", f"{history.energy.drift:.2g} of the energy"))
    budget: Any = tables.error_budget(history)
    if not budget:
        return [rows]
    columns: dict[str, Any] = {"Error budget": [name.replace("_", " ") for name in budget]}
    columns["value"] = [f"{bar.value:.5g} {QUANTITIES[name]}" for name, bar in budget.items()]
    for cause in (*budget.causes, "total"):
        columns[cause] = [f"{100 * getattr(bar, cause):.2g} %" for bar in budget.values()]
    return [rows, columns, *budget.notes]


def _model(found: Results) -> list[Block]:
    model, blocks = found.model, list[Block]()
    if found.structure is not None:
        blocks.append([("structure", found.structure.describe()), *_advice(found)])
    if model is not None:
        blocks.append(tables.model_rows(model))
    if model is not None and np.ndim(model.k0) == 0:
        columns = {"anti-oscillator": range(1, model.n + 1)}
        columns |= {"frequency (Hz)": model.omega / (2 * np.pi), "mass (kg)": model.m}
        blocks.append(columns | {"stiffness (N/m)": model.k})
    return blocks


def _advice(found: Results) -> tables.Rows:
    """What `advise` says of the family, where it can."""
    if not hasattr(found.impactor, "hertz"):
        return []
    try:
        advice = advise(found.structure, found.impactor)
    except AntioscError as error:
        return [("element family", f"no advice: {error}")]
    return [
        ("sufficient element family", advice.family),
        ("largest element", f"{1e3 * advice.element_size:.3g} mm"),
        ("highest relevant frequency", f"{advice.frequency:.4g} Hz"),
        ("reasons", "; ".join(advice.reasons)),
    ]
