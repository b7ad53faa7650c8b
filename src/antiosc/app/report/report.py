"""`--report` and `write_report`: one page in HTML, complete in itself, which strikes anew."""

from __future__ import annotations

import contextlib
import datetime
import importlib
import os
import platform
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from antiosc.app import info
from antiosc.app.page import assets, live as of_page, verdict
from antiosc.app.page.assets import Data
from antiosc.app.report.pictures import drawn
from antiosc.app.report.results import advice_of, error_budget, shown, told, with_prefixes
from antiosc.app.scene_file.run import Results, on_first
from antiosc.app.scene_file.scene import by_strengths
from antiosc.base import checks, files
from antiosc.base.errors import AntioscError, InputError, MissingDependencyError
from antiosc.base.isolation import loading
from antiosc.simulation.histories import History, SceneHistory
from antiosc.studies.map_results import ImpactMap

if TYPE_CHECKING:
    from antiosc.fem.structure.structure import Structure

#: Headings of the picture that stands for the live one, in print and where nothing runs.
STILLS = ("Deformed structure", "Map")


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
    found = Results(title=target.stem if title is None else checks.text("title", title))
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
    text = page(found)
    on_first(lambda: files.write_text(path, text, "the report"))
    return [path]


def page(found: Results) -> str:
    """The page as a text."""
    live, headline = _live(found)
    one_view = live is not None and live.get("part") is not None
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
    model, *parts = told(found)
    views = (each for one in (*parts, model) for each in one.pictures)
    pictures = list(drawn(each for each in views if not (one_view and each.again)))
    stills = [each for each in pictures if each.heading.startswith(STILLS) and each.data]
    return rendered(
        Path(__file__).with_name("report.html"),
        title=found.title,
        origin=f"{', '.join(names)}. All numbers are in SI units.",
        warnings=found.warnings,
        headline=headline,
        sections=[each for one in parts for each in one.sections.items()],
        details=[(n, [advice_of(found), *blocks]) for n, blocks in model.sections.items()],
        still=stills[0] if stills else None,
        pictures=[each for each in pictures if each not in stills[:1]],
        program=program,
        source=source,
        style=assets.style(),
        script=script,
        policy=assets.policy(script),
        live="" if live is None else assets.embedded(live),
        drawn="" if live is None else of_page.drawn(live),
    )


def _live(found: Results) -> tuple[Data | None, verdict.Headline | None]:
    """What the page strikes anew, and its first screen; None for scenes, sweeps and falls."""
    if found.map is not None:
        return of_page.of_map(found.map, found.structure), verdict.of_map(found.map)
    hit = found.history
    if hit is None or isinstance(hit, SceneHistory):
        return None, None
    budget = error_budget(hit)
    live = of_page.of_history(hit, found.structure, budget)
    worst = ((live or {}).get("part") or {}).get("worst")
    stresses = found.stresses or {}
    return live, verdict.of_history(hit, found.structure, budget, stresses, worst)


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
    environment.filters |= {"shown": shown, "prefixed": with_prefixes, "zipped": _zipped}
    environment.tests["numeric"] = lambda cell: shown(cell).strip("-–+.0123456789eE% ") == ""
    return str(environment.get_template(template.name).render(content))


def _zipped(columns: Iterable[Iterable[object]]) -> Iterator[tuple[object, ...]]:
    return zip(*columns, strict=True)
