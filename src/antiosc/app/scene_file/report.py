"""`--report` and `write_report`: one page in HTML, complete in itself, which strikes anew."""

from __future__ import annotations

import contextlib
import datetime
import os
import platform
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from antiosc.app import info
from antiosc.app.page import assets, live as of_page, verdict
from antiosc.app.scene_file import result_tables as tables
from antiosc.app.scene_file.largest import by_strengths
from antiosc.app.scene_file.pages import rendered
from antiosc.app.scene_file.report_pictures import Picture, pictures
from antiosc.app.scene_file.run import Results, on_first
from antiosc.base import checks, files
from antiosc.base.engineering import engineering, percent
from antiosc.base.errors import AntioscError, InputError
from antiosc.simulation.error_bars import QUANTITIES
from antiosc.simulation.history import History, SceneHistory
from antiosc.simulation.results import covers
from antiosc.studies.advice import advise
from antiosc.studies.map_results import ImpactMap

if TYPE_CHECKING:
    from antiosc.fem.structure.structure import Structure

#: Headings of the picture that stands for the live one, in print and where nothing runs.
STILLS = ("Deformed structure", "Map")
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


def write_report(
    path: str | os.PathLike[str],
    result: History | ImpactMap,
    structure: Structure | None = None,
    *,
    title: str | None = None,
) -> Path:
    """Write a report: one HTML file that opens anywhere, without network or server.

    The page repeats an impact of `simulate` or `strike`, and those of a map at each site, with
    sliders of mass, speed, stiffness, gap and damping.

    Parameters
    ----------
    path : str or Path
        The file, named .html.
    result : History or ImpactMap
    structure : Structure, optional
        The structure from which the model was extracted; of `strike` its own. With it the page
        shows the part in 3-D, its motion and its stress; of a map the part behind its points.
    title : str
        Default: the name of the file.

    Raises
    ------
    InputError
        For another kind of result, or a file that cannot be written.
    """
    target = checked(os.fspath(checks.path("path", path)))
    checks.instance("result", result, (History, ImpactMap), "a History or an ImpactMap")
    if structure is not None:
        from antiosc.fem.structure.structure import Structure

        checks.instance("structure", structure, Structure, "a Structure")
    found = Results(None, title=target.stem if title is None else checks.text("title", title))
    if isinstance(result, ImpactMap):
        found.map, found.structure = result, structure
    else:
        found.history = result
        found.structure = result.structure if structure is None else structure
        found.model = None if isinstance(result, SceneHistory) else result.model
        found.impactor = None if isinstance(result, SceneHistory) else result.impactor
        if found.structure is not None:
            with contextlib.suppress(AntioscError):  # without shapes, or elements
                found.stresses = by_strengths(found.structure, result)
    return write(found, target)[0]


def write(found: Results, path: Path) -> list[Path]:
    """Write the report on the first rank, complete or absent; its path.

    The page is made on every rank: fields and the dimensions of a structure are shared.
    """
    live, headline = _live(found)
    turned = live is not None and live.get("part") is not None
    text = page(found, list(pictures(found, one_view=turned)), live, headline)
    on_first(lambda: files.write_text(path, text, "the report"))
    return [path]


def page(
    found: Results,
    drawn: Sequence[Picture],
    live: dict[str, Any] | None = None,
    headline: verdict.Headline | None = None,
) -> str:
    """The page as a text."""
    program = f"antiosc {info.version()}"
    now = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC")
    python = f"Python {platform.python_version()}, NumPy {np.__version__}"
    names = [program, python, now]
    source = ""
    if found.compiled is not None:
        path = found.compiled.document.path
        names.insert(0, path.name)
        with contextlib.suppress(OSError):  # the file may have gone since it was read
            source = path.read_text(encoding="utf-8")
    script = "" if live is None else assets.script()
    stills = [each for each in drawn if each.heading.startswith(STILLS) and each.data]
    return rendered(
        "report.html",
        title=found.title,
        origin=f"{', '.join(names)}. All numbers are in SI units.",
        warnings=found.warnings,
        headline=headline,
        sections=_sections(found),
        details=_details(found),
        still=stills[0] if stills else None,
        pictures=[each for each in drawn if each not in stills[:1]],
        program=program,
        source=source,
        style=assets.style(),
        script=script,
        policy=assets.policy(script),
        live="" if live is None else assets.embedded(live),
        drawn="" if live is None else of_page.drawn(live),
    )


def _live(found: Results) -> tuple[dict[str, Any] | None, verdict.Headline | None]:
    """What the page strikes anew, and its first screen; None for scenes, sweeps and falls."""
    if found.map is not None:
        return of_page.of_map(found.map, found.structure), verdict.of_map(found.map)
    hit = found.history
    if hit is None or isinstance(hit, SceneHistory):
        return None, None
    budget = tables.error_budget(hit)
    live = of_page.of_history(hit, found.structure, budget)
    worst = ((live or {}).get("part") or {}).get("worst")
    stresses = found.stresses or {}
    return live, verdict.of_history(hit, found.structure, budget, stresses, worst)


def _sections(found: Results) -> list[tuple[str, list[Block]]]:
    """Headings of results, each with what stands below it."""
    hit, sections = found.history, []
    if hit is not None:
        sections.append(
            ("Results", [*_results(hit), tables.probe_rows(found), tables.stress_rows(found)])
        )
    if found.fall is not None:
        blocks: list[Block] = [tables.fall_columns(found.fall), tables.fall_rows(found)]
        sections.append(("Fall", [*blocks, getattr(found.fall, "status", "")]))
    if found.found is not None:
        sections.append(("Blow", [found.found.rows(), found.found.message]))
    if found.batch is not None:
        sections.append(("Sweep", [tables.sweep_columns(found)]))
    if found.sample is not None:
        sections.append(("Random values", [tables.sample_columns(found.sample)]))
    if found.map is not None:
        sections.append(("Map", [tables.map_rows(found.map)]))
    if hit is not None:
        sections.append(("Errors", _errors(hit)))
    return sections


def _details(found: Results) -> list[tuple[str, list[Block]]]:
    """What follows the pictures."""
    known = found.structure is not None or found.model is not None
    return [("Model", _model(found))] if known else []


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
        *(
            (name.replace("_", " "), engineering(getattr(history, name), unit, 4))
            for name, unit in QUANTITIES.items()
        ),
        ("contacts", f"{len(history.contacts)}"),
        ("coefficient of restitution", "not defined" if e is None else f"{e:.4f}"),
    ]
    return [rows, history.message]


def _errors(history: Any) -> list[Block]:
    rows = [(f"time integration: {name}", percent(value)) for name, value in history.error.items()]
    rows.append(("these errors cover", covers(history)))
    rows.append(("energy drift over the run, of the energy", percent(history.energy.drift)))
    budget: Any = tables.error_budget(history)
    if not budget:
        return [rows]
    columns: dict[str, Any] = {"Error budget": [name.replace("_", " ") for name in budget]}
    columns["value"] = [engineering(bar.value, QUANTITIES[name], 4) for name, bar in budget.items()]
    for cause in (*budget.causes, "total"):
        columns[cause] = [percent(getattr(bar, cause)) for bar in budget.values()]
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
        ("highest relevant frequency", engineering(advice.frequency, "Hz")),
        ("reasons", "; ".join(advice.reasons)),
    ]
