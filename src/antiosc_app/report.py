"""The result files of a run, and the report: one self-contained HTML page that can repeat the
impact.

The files are tables for a spreadsheet, numbers for a program, pictures and fields.
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
from antiosc.base.errors import (
    NOTE_WEIGHT,
    AntioscError,
    InputError,
    MissingDependencyError,
    message_weight,
    sorted_by_weight,
)
from antiosc.base.packages import loading
from antiosc.base.texts import capitalised
from antiosc_app import info, live, live_data
from antiosc_app.cards import (
    DEFLECTION_QUESTION,
    FORCE_QUESTION,
    MAX_CAUTIONS,
    STRESS_QUESTION,
    listed_cautions,
)
from antiosc_app.headline import judged_stress_data
from antiosc_app.live import Data
from antiosc_app.presentation import (
    Card,
    Presentation,
    drawn_pictures,
    format_number,
    with_unit_prefixes,
)
from antiosc_app.quantities import quantities
from antiosc_app.results import presentations
from antiosc_app.scene_file.run import SceneResults, error_budget, on_first_rank
from antiosc_app.scene_file.scene import stress_fields, worst_stress_field
from antiosc_app.scene_file.schema import Output

if TYPE_CHECKING:
    from antiosc import Structure
    from antiosc.strikes.tradeoff import Tradeoff
    from antiosc_app.scene_file.scene import CompiledScene


def created_folder(path: str | os.PathLike[str]) -> Path:
    """Create the folder of the results if it is missing; returns its path."""
    target = checks.path("--out", path)
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"cannot make the folder {str(target)!r} for the results: {error.strerror}."
        ) from None
    return target


def write_table(path: Path, columns: Mapping[str, Sequence[object]]) -> Path:
    """Write columns (heading with unit -> values) as a CSV file; after an error there is none."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(map(files.table_text, columns))
    writer.writerows(
        [_csv_cell(entry) for entry in row] for row in zip(*columns.values(), strict=True)
    )
    files.write_text(path, stream.getvalue(), "the table")
    return path


def _csv_cell(value: object) -> object:
    """A cell of a CSV file: floats with all digits, nothing for NaN, no spreadsheet formulas."""
    if isinstance(value, float | np.floating):
        if math.isnan(value):
            return ""
        return repr(float(value))
    if isinstance(value, str):
        return files.table_text(value)
    return value


def write_numbers(path: Path, content: Mapping[str, object]) -> Path:
    """Write numbers as a JSON file, NaN and infinity as null; returns its path."""
    header = {"antiosc": info.antiosc_version(), "units": "SI"}
    text = json.dumps(live.plain_json({**header, **content}), indent=1, allow_nan=False)
    files.write_text(path, text + "\n", "the numbers")
    return path


def write_output(
    results: SceneResults, parts: Sequence[Presentation], folder_path: Path
) -> list[Path]:
    """Write the files that [output] requests to the folder `folder_path`; returns their paths.

    All ranks must call it; the first one writes.
    """
    output_call = results.compiled.output
    output = Output() if output_call is None else output_call.result
    written: list[Path] = []
    if output.fields and results.history is not None and results.structure is not None:
        path = antiosc.write_series(results.structure, results.history, folder_path / "series.pvd")
        written.append(Path(path))
    tables = (
        {n: t for part_shown in parts for n, t in part_shown.tables.items()} if output.csv else {}
    )
    content: dict[str, object] = {}
    if output.json:
        title = results.compiled.document.data.get("title", "")
        content = {"title": title, "warnings": results.warnings}
        content |= {
            name: value for part_shown in parts for name, value in part_shown.numbers.items()
        }
        content["quantities"] = quantities(results)

    def write_on_first() -> tuple[list[Path], list[str]]:
        warnings: list[str] = []
        paths = [write_table(folder_path / name, table) for name, table in tables.items()]
        if content:
            paths.append(write_numbers(folder_path / "result.json", content))
        if output.model and results.model is not None:
            results.model.save(folder_path / "model.npz")
            paths.append(folder_path / "model.npz")
        if output.fields:
            writers = ((n, field) for part_shown in parts for n, field in part_shown.fields.items())
            paths += [field(folder_path / name) for name, field in writers]
        shown = ((n, plotted) for part_shown in parts for n, plotted in part_shown.plotted.items())
        for name, plotted in shown if output.plot is not None else ():
            path = folder_path / f"{name}.{output.plot}"
            try:
                if hasattr(plotted, "plot"):
                    plotted.plot(path)
                    paths.append(path)
            except (InputError, MissingDependencyError) as error:
                warnings.append(f"{path.name} is not drawn: {error}")
        return paths, warnings

    paths, warnings = on_first_rank(write_on_first)
    results.warnings.extend(warnings)
    return [*written, *paths]


#: Answer -> name of its number on the live page.
LIVE_NUMBERS = {
    FORCE_QUESTION: "peak_force",
    DEFLECTION_QUESTION: "site_deflection",
    STRESS_QUESTION: "stress",
}
#: Headings of the pictures that replace the live view in print and without scripts.
STILL_HEADINGS = ("Deformed structure", "Map")


def writable_report_path(path: str) -> Path:
    """The path of a report; InputError if it is not named .html or its folder is missing."""
    target = checks.path("--report", path)
    if target.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"a report is a file named .html; got {checks.shown(path)}.")
    if not os.path.isdir(target.parent):
        raise InputError(f"there is no folder {str(target.parent)!r} for the report.")
    return target


def write_report(
    result: History | ImpactMap | Fall | Tradeoff | str | os.PathLike[str],
    path: str | os.PathLike[str] | History | ImpactMap | Fall | Tradeoff,
    structure: Structure | None = None,
    *,
    title: str | None = None,
) -> Path:
    """Write a report: one HTML file that opens anywhere, without network or server.

    The page repeats an impact of `simulate` or `strike`, or the impacts of a map at each site, with
    sliders for mass, speed, stiffness, gap and damping; a fall is shown as a moving part.

    Parameters
    ----------
    result : History, ImpactMap, Fall or Tradeoff
        The result; for a trade-off its last history is shown, with the compared methods.
    path : str or Path
        The file, named .html. `result` and `path` may change places.
    structure : Structure, optional
        The structure from which the model was extracted; a `strike` has its own. With it the page
        shows the part in 3-D, its motion and its stress; for a map the part behind the sites.
    title : str
        Default: the name of the file.

    Raises
    ------
    InputError
        For another kind of result, or a file that cannot be written.
    """
    reported, file = checks.what_and_path(result, path)
    target = writable_report_path(os.fspath(checks.path("path", file)))
    title = target.stem if title is None else checks.text("title", title)
    page_results = _results_of(reported, structure, title)
    return write_page(page_results, presentations(page_results), target)[0]


def results_of(scene: CompiledScene, compared: Tradeoff) -> SceneResults:
    """The results of a trade-off of a scene."""
    title = str(scene.document.data.get("title") or scene.document.path.stem)
    page_results = _results_of(compared, None, title)
    page_results.compiled = scene
    page_results.warnings = list(scene.warnings)
    return page_results


def _results_of(reported: Any, structure: Structure | None, title: str) -> SceneResults:
    """The results that the report of a history, map, fall or trade-off shows, with stresses."""
    compared: Any = reported if hasattr(reported, "front") else None
    reported = reported if compared is None else compared.hit
    checks.instance(
        "result", reported, (History, ImpactMap, Fall), "a History, ImpactMap, Fall or Tradeoff"
    )
    if structure is not None:
        from antiosc import Structure

        checks.instance("structure", structure, Structure, "a Structure")
    page_results = SceneResults(title=title)
    page_results.tradeoff = compared
    if isinstance(reported, ImpactMap):
        page_results.map = reported
        page_results.structure = structure
    elif isinstance(reported, Fall):
        page_results.fall = reported
        page_results.structure = reported.body.structure
        if page_results.structure is not None:
            page_results.worst = worst_stress_field(reported)
    else:
        page_results.history = reported
        page_results.structure = reported.structure if structure is None else structure
        page_results.model = None if isinstance(reported, SceneHistory) else reported.model
        page_results.impactor = None if isinstance(reported, SceneHistory) else reported.impactor
        if page_results.structure is not None:
            with contextlib.suppress(AntioscError):  # without shapes, or elements
                page_results.stresses = stress_fields(page_results.structure, reported)
    return page_results


def write_page(results: SceneResults, parts: Sequence[Presentation], path: Path) -> list[Path]:
    """Write the report on the first rank; returns [its path]. After an error there is no file.

    Every rank must call it, since fields and dimensions of a structure are distributed.
    """
    text = report_html(results, parts)
    on_first_rank(lambda: files.write_text(path, text, "the report"))
    return [path]


def report_html(results: SceneResults, parts: Sequence[Presentation]) -> str:
    """The HTML text of a report; `parts`: the presentations of `results`, the model first."""
    data = _live_data(results)
    model, *parts = parts
    told = listed_cautions(
        " ".join(part.caution for part in parts if part.caution), results.warnings
    )
    notes = [
        one for one in sorted_by_weight(results.warnings) if message_weight(one) == NOTE_WEIGHT
    ]
    program = f"antiosc {info.antiosc_version()}"
    date = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC")
    names = [program, f"Python {platform.python_version()}, NumPy {np.__version__}", date]
    source = ""
    if results.compiled is not None:
        document = results.compiled.document
        names.insert(0, document.path.name)
        source = _without_comments(document.mistakes.text)

    script = "" if data is None else live.page_script()
    views = (picture for part in (*parts, model) for picture in part.pictures)
    pictures = list(drawn_pictures(views))
    stills = [one for one in pictures if one.heading.startswith(STILL_HEADINGS) and one.data]
    return rendered_template(
        Path(__file__).with_name("page") / "report.html",
        title=results.title,
        origin=f"{', '.join(names)}. All numbers are in SI units.",
        cards=[card for part in parts for card in (*part.cards, *(Card(*x) for x in part.asked))],
        keys=LIVE_NUMBERS,
        cautions=told[:MAX_CAUTIONS],
        more=[*told[MAX_CAUTIONS:], *map(capitalised, notes)],
        sentences=[sentence for part in parts for sentence in part.sentences],
        sections=[section for part in parts for section in part.of_report],
        details=list(model.sections.items()),
        still=stills[0] if stills else None,
        pictures=[picture for picture in pictures if picture not in stills[:1]],
        program=program,
        source=source,
        style=live.page_style(),
        script=script,
        policy=live.content_policy(script),
        live="" if data is None else live.embedded_json(data),
        drawn="" if data is None else live.set_up_caption(data),
    )


def _without_comments(scene: str) -> str:
    """The text of a scene without its comment lines and the blank lines around them."""
    lines = [line for line in scene.splitlines() if not line.lstrip().startswith("#")]
    return re.sub(r"\n{3,}", "\n\n", "\n".join(lines)).strip() + "\n"


def _live_data(results: SceneResults) -> Data | None:
    """The data from which the page repeats an impact, a map or a fall; None for other results."""
    fall, hit = results.fall, results.history
    if fall is not None:
        from antiosc_app import falls  # it may need the finite-element packages

        return falls.data_of_fall(fall, results.worst) if hasattr(fall, "episodes") else None
    if results.map is not None:
        return live_data.data_of_map(results.map, results.structure)
    if hit is None or isinstance(hit, SceneHistory):
        return None
    data = live_data.data_of_history(hit, results.structure, error_budget(hit))
    return None if data is None else data | judged_stress_data(results.stresses or {})


def rendered_template(template: Path, **content: object) -> str:
    """The text of the jinja2 template with `content` inserted, escaped if it is HTML."""
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
    environment.filters |= {"shown": format_number, "prefixed": with_unit_prefixes}
    environment.filters["zipped"] = _table_rows
    environment.tests["numeric"] = lambda cell: (
        format_number(cell).strip("-–+.0123456789eE% ") == ""
    )
    return str(environment.get_template(template.name).render(content))


def _table_rows(columns: Iterable[Iterable[object]]) -> Iterator[tuple[object, ...]]:
    """The rows of a table of columns of equal length."""
    return zip(*columns, strict=True)
