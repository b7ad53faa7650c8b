"""The files of a run, and the report: one self-contained HTML page that can repeat the impact.

Files: tables for a spreadsheet, numbers for a program, pictures, fields.
"""

from __future__ import annotations

import contextlib
import csv
import datetime
import importlib
import io
import json
import math
import os
import platform
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import antiosc
from antiosc import Fall, History, ImpactMap, SceneHistory
from antiosc.base import checks, files
from antiosc.base.errors import AntioscError, InputError, MissingDependencyError
from antiosc.base.process import loading
from antiosc.base.texts import capitalised
from antiosc_app import info, live, live_data
from antiosc_app.live import Data
from antiosc_app.results import (
    Presentation,
    advice_of,
    drawn,
    error_budget,
    format_number,
    presentations,
    with_prefixes,
)
from antiosc_app.scene_file.run import Results, on_first
from antiosc_app.scene_file.scene import by_strengths, worst_by_strengths
from antiosc_app.scene_file.schema import Output

if TYPE_CHECKING:
    from antiosc import PeakField, Structure


def folder(path: str | os.PathLike[str]) -> Path:
    """The folder of the results, made where it is missing."""
    target = checks.path("--out", path)
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"cannot make the folder {str(target)!r} for the results: {error.strerror}."
        ) from None
    return target


def write_table(path: Path, columns: Mapping[str, Sequence[object]]) -> Path:
    """A CSV file whose first line has names and units; complete or absent."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(map(files.table_text, columns))
    writer.writerows([_cell(entry) for entry in row] for row in zip(*columns.values(), strict=True))
    files.write_text(path, stream.getvalue(), "the table")
    return path


def _cell(value: object) -> object:
    """Floats with all their digits; nothing for NaN; texts that are no formulas."""
    if isinstance(value, float | np.floating):
        return "" if math.isnan(value) else repr(float(value))
    return files.table_text(value) if isinstance(value, str) else value


def write_numbers(path: Path, content: Mapping[str, object]) -> Path:
    """A JSON file; NaN and infinity become null."""
    head = {"antiosc": info.version(), "units": "SI"}
    text = json.dumps(live.plain({**head, **content}), indent=1, allow_nan=False)
    files.write_text(path, text + "\n", "the numbers")
    return path


def write_output(found: Results, parts: Sequence[Presentation], target: Path) -> list[Path]:
    """Write the files that the scene asks for, on the first rank; returns their paths."""
    asked = found.compiled.output
    wanted = Output() if asked is None else asked.made
    written: list[Path] = []
    if wanted.fields and found.history is not None and found.structure is not None:
        path = antiosc.write_series(found.structure, found.history, target / "series.pvd")
        written.append(Path(path))
    tables = {n: t for one in parts for n, t in one.tables.items()} if wanted.csv else {}
    content: dict[str, object] = {}
    if wanted.json:
        title = found.compiled.document.data.get("title", "")
        content = {"title": title, "warnings": found.warnings}
        content |= {name: value for one in parts for name, value in one.numbers.items()}

    def files_of_first() -> tuple[list[Path], list[str]]:
        warnings: list[str] = []
        paths = [write_table(target / name, table) for name, table in tables.items()]
        if content:
            paths.append(write_numbers(target / "result.json", content))
        if wanted.model and found.model is not None:
            found.model.save(target / "model.npz")
            paths.append(target / "model.npz")
        if wanted.fields:
            writers = ((n, field) for one in parts for n, field in one.fields.items())
            paths += [field(target / name) for name, field in writers]
        shown = ((n, each) for one in parts for n, each in one.plotted.items())
        for name, each in shown if wanted.plot is not None else ():
            path = target / f"{name}.{wanted.plot}"
            try:
                if hasattr(each, "plot"):
                    each.plot(path)
                    paths.append(path)
            except (InputError, MissingDependencyError) as error:
                warnings.append(f"{path.name} is not drawn: {error}")
        return paths, warnings

    paths, warnings = on_first(files_of_first)
    found.warnings.extend(warnings)
    return [*written, *paths]


#: Headings of the picture that stands for the live one, in print and where nothing runs.
STILLS = ("Deformed structure", "Map")


def checked(path: str) -> Path:
    """The path of a report, or InputError; before anything is computed."""
    target = checks.path("--report", path)
    if target.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"a report is a file named .html; got {checks.shown(path)}.")
    if not os.path.isdir(target.parent):
        raise InputError(f"there is no folder {str(target.parent)!r} for the report.")
    return target


def write_report(
    result: History | ImpactMap | Fall | str | os.PathLike[str],
    path: str | os.PathLike[str] | History | ImpactMap | Fall,
    structure: Structure | None = None,
    *,
    title: str | None = None,
) -> Path:
    """Write a report: one HTML file that opens anywhere, without network or server.

    The page repeats an impact of `simulate` or `strike`, and those of a map at each site, with
    sliders of mass, speed, stiffness, gap and damping; a fall is shown on its path.

    Parameters
    ----------
    result : History, ImpactMap or Fall
    path : str or Path
        The file, named .html. `result` and `path` may change places.
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
    what, file = checks.what_and_path(result, path)
    target = checked(os.fspath(checks.path("path", file)))
    checks.instance("result", what, (History, ImpactMap, Fall), "a History, ImpactMap or Fall")
    if structure is not None:
        from antiosc import Structure

        checks.instance("structure", structure, Structure, "a Structure")
    found = Results(title=target.stem if title is None else checks.text("title", title))
    if isinstance(what, ImpactMap):
        found.map, found.structure = what, structure
    elif isinstance(what, Fall):
        found.fall, found.structure = what, what.body.structure
        if found.structure is not None:
            found.worst = worst_by_strengths(what)
    else:
        found.history = what
        found.structure = what.structure if structure is None else structure
        found.model = None if isinstance(what, SceneHistory) else what.model
        found.impactor = None if isinstance(what, SceneHistory) else what.impactor
        if found.structure is not None:
            with contextlib.suppress(AntioscError):  # without shapes, or elements
                found.stresses = by_strengths(found.structure, what)
    return write_page(found, presentations(found), target)[0]


def write_page(found: Results, parts: Sequence[Presentation], path: Path) -> list[Path]:
    """Write the report on the first rank, complete or absent; its path.

    The page is made on every rank: fields and the dimensions of a structure are shared.
    """
    text = page(found, parts)
    on_first(lambda: files.write_text(path, text, "the report"))
    return [path]


def page(found: Results, parts: Sequence[Presentation]) -> str:
    """The page as a text."""
    data, headline = _live(found)
    one_view = data is not None and data.get("part") is not None
    program = f"antiosc {info.version()}"
    now = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC")
    python = f"Python {platform.python_version()}, NumPy {np.__version__}"
    names = [program, python, now]
    source = ""
    if found.compiled is not None:
        path = found.compiled.document.path
        names.insert(0, path.name)
        with contextlib.suppress(OSError):  # the file may have gone since it was read
            source = _uncommented(path.read_text(encoding="utf-8"))
    script = "" if data is None else live.script()
    model, *parts = parts
    views = (each for one in (*parts, model) for each in one.pictures)
    pictures = list(drawn(each for each in views if not (one_view and each.same_view)))
    stills = [each for each in pictures if each.heading.startswith(STILLS) and each.data]
    return rendered(
        Path(__file__).with_name("page") / "report.html",
        title=found.title,
        origin=f"{', '.join(names)}. All numbers are in SI units.",
        warnings=map(capitalised, found.warnings),
        headline=headline,
        sections=_untold((each for one in parts for each in one.sections.items()), headline),
        details=[(n, [advice_of(found), *blocks]) for n, blocks in model.sections.items()],
        still=stills[0] if stills else None,
        pictures=[each for each in pictures if each not in stills[:1]],
        program=program,
        source=source,
        style=live.style(),
        script=script,
        policy=live.policy(script),
        live="" if data is None else live.embedded(data),
        drawn="" if data is None else live.caption(data),
    )


def _untold(
    sections: Iterable[tuple[str, list[Any]]], headline: live.Headline | None
) -> list[tuple[str, list[Any]]]:
    """The sections without the sentences that stand in the headline."""
    told = {_plain(one) for one in (headline.sentences if headline else ())}
    found = []
    for heading, blocks in sections:
        kept: list[Any] = []
        for block in blocks:
            if isinstance(block, list):
                kept.append(_rows_untold(block, told))
            elif _plain(str(block)) not in told:
                kept.append(block)
        found.append((heading, kept))
    return found


def _rows_untold(rows: list[tuple[str, object]], told: set[str]) -> list[tuple[str, object]]:
    """Rows whose values stand nowhere else on the page; a nameless row has the name above."""
    kept, name = [], ""
    for own, value in rows:
        name = own or name
        if _plain(str(value)) not in told:
            kept.append((name, value))
            name = ""
    return kept


def _plain(sentence: str) -> str:
    return sentence.rstrip(".").lower()


def _uncommented(scene: str) -> str:
    """A scene without lines that are comments, and without the gaps that they leave."""
    lines = [line for line in scene.splitlines() if not line.lstrip().startswith("#")]
    return re.sub(r"\n{3,}", "\n\n", "\n".join(lines)).strip() + "\n"


def _live(found: Results) -> tuple[Data | None, live.Headline | None]:
    """What the page turns or strikes anew, and its first screen; None for scenes and sweeps."""
    fall = found.fall
    if fall is not None and hasattr(fall, "episodes"):
        from antiosc_app import falls  # it may need the finite-element packages

        return falls.data_of_fall(fall, found.worst), falls.headline_of_fall(fall, found.worst)
    if found.map is not None:
        return live_data.data_of_map(found.map, found.structure), live.headline_of_map(found.map)
    hit = found.history
    if hit is None or isinstance(hit, SceneHistory):
        return None, None
    budget = error_budget(hit)
    data = live_data.data_of_history(hit, found.structure, budget)
    worst = ((data or {}).get("part") or {}).get("worst")
    stresses = found.stresses or {}
    if data is not None:
        data |= _largest_stress(stresses, worst)
    return data, live.headline_of_history(hit, found.structure, budget, stresses, worst)


def _largest_stress(fields: Mapping[str, PeakField], worst: Data | None) -> Data:
    """The von Mises stress [Pa] nearest to yield, and its strength; else that of the picture."""
    margins = [one.margin() for one in fields.values() if one.exposure is not None]
    for one in margins:
        if one.criterion == "yield":
            return {"stress": one.value, "strength": one.strength}
    return {} if worst is None else {"stress": worst["value"]}


def rendered(template: Path, **content: object) -> str:
    """The text of a template; in HTML all content is escaped: it is no markup."""
    try:
        with loading():
            jinja2 = importlib.import_module("jinja2")
    except ImportError:
        raise MissingDependencyError(
            "reports and new scenes need jinja2: apt install python3-jinja2, or pip install jinja2."
        ) from None
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(template.parent),
        autoescape=lambda name: name is None or name.endswith(".html"),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {"shown": format_number, "prefixed": with_prefixes, "zipped": _zipped}
    environment.tests["numeric"] = lambda cell: (
        format_number(cell).strip("-–+.0123456789eE% ") == ""
    )
    return str(environment.get_template(template.name).render(content))


def _zipped(columns: Iterable[Iterable[object]]) -> Iterator[tuple[object, ...]]:
    return zip(*columns, strict=True)
