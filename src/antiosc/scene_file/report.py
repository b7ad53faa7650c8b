"""`--report`: one page in HTML, complete in itself, with what was computed and how."""

from __future__ import annotations

import datetime
import platform
import re
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from antiosc import checks, files, info
from antiosc.advice import advise
from antiosc.errors import AntioscError, InputError
from antiosc.scene_file import result_tables
from antiosc.scene_file.output import ends
from antiosc.scene_file.report_pictures import Picture, pictures
from antiosc.scene_file.run import Results, on_first
from antiosc.simulation.error_bars import CAUSES, QUANTITIES
from antiosc.simulation.results import covers
from antiosc.simulation.scene_history import SceneHistory

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem;
  color: #1a1a1a; background: #fff }
h1 { margin-bottom: 0 } h2 { margin-top: 2.5rem; border-bottom: 1px solid #ccc }
table { border-collapse: collapse; margin: 1rem 0 }
th, td { text-align: left; padding: 0.2rem 1rem 0.2rem 0; border-bottom: 1px solid #e4e4e4;
  vertical-align: top } th { white-space: nowrap }
td.number { text-align: right; font-variant-numeric: tabular-nums }
pre { background: #f5f5f5; padding: 1rem; overflow-x: auto; font-size: 13px }
figure { margin: 2rem 0 } img { max-width: 100% }
figcaption, .from { color: #555; font-size: 14px }
.warning { border-left: 4px solid #c60; padding-left: 1rem }
"""
#: Nothing of the page may be fetched, and nothing in it is executed.
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"


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
    scene = found.compiled
    title = scene.title or scene.document.path.stem
    body = [f"<h1>{escape(title)}</h1>", f'<p class="from">{escape(_origin(scene))}</p>']
    body += [f'<p class="warning">{escape(sentence)}</p>' for sentence in found.warnings]
    if found.history is not None:
        body += ["<h2>Results</h2>", *_results(found.history)]
        body.append(_table(result_tables.probe_rows(found)))
    if found.batch is not None:
        body += ["<h2>Sweep</h2>", _columns(result_tables.sweep_columns(found))]
    if found.map is not None:
        body += ["<h2>Map</h2>", _table(result_tables.map_rows(found.map))]
    if found.history is not None:
        body += ["<h2>Errors</h2>", *_errors(found.history)]
    if found.structure is not None or found.model is not None:
        body += ["<h2>Model</h2>", *_model(found)]
    body.append("<h2>Pictures</h2>")
    end = ["<h2>Scene</h2>", f"<pre>{escape(_source(scene.document.path))}</pre>"]
    return page_of(title, body, drawn, end)


def page_of(
    title: str, body: Sequence[str], drawn: Sequence[Picture], end: Sequence[str] = ()
) -> str:
    """A page with a title, elements in HTML, pictures, and further elements."""
    head = (
        '<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        '<meta name="viewport" content="width=device-width">\n'
        f"<title>{escape(title)}</title>\n<style>{STYLE}</style>"
    )
    inner = "\n".join(piece for piece in (*body, *map(_figure, drawn), *end) if piece)
    top = '<!doctype html>\n<html lang="en">\n'
    return f"{top}<head>\n{head}\n</head>\n<body>\n{inner}\n</body>\n</html>\n"


def _origin(scene: Any) -> str:
    now = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC")
    return (
        f"{scene.document.path.name}, {_program()}, Python {platform.python_version()}, NumPy"
        f" {np.__version__}, {now}. All numbers are in SI units."
    )


def _program() -> str:
    return f"antiosc {info.version()}"


def _source(path: Path) -> str:
    """The scene file, which may have gone since it was read."""
    try:
        return path.read_text(encoding="utf-8")
    except OSError:
        return ""


# -- what was found


def _results(history: Any) -> list[str]:
    if isinstance(history, SceneHistory):
        columns: dict[str, list[Any]] = {
            "contact": [f"{a} – {b}" for a, b in ends(history)],
            "peak force (N)": [history[pair].peak_force for pair in ends(history)],
            "impulse (N s)": [history[pair].impulse for pair in ends(history)],
            "contact time (s)": [history[pair].contact_time for pair in ends(history)],
            "contacts": [len(history[pair].contacts) for pair in ends(history)],
        }
        return [_columns(columns), f"<p>{escape(history.message)}</p>"]
    e = history.restitution
    rows = [
        ("peak force", f"{history.peak_force:.6g} N"),
        ("impulse", f"{history.impulse:.6g} N s"),
        ("contact time", f"{history.contact_time:.6g} s"),
        ("contacts", f"{len(history.contacts)}"),
        ("coefficient of restitution", "not defined" if e is None else f"{e:.4f}"),
    ]
    return [_table(rows), f"<p>{escape(history.message)}</p>"]


def _errors(history: Any) -> list[str]:
    rows = [(f"time integration: {name}", f"{value:.2g}") for name, value in history.error.items()]
    rows.append(("these errors cover", covers(history)))
    rows.append(("energy drift over the run", f"{history.energy.drift:.2g} of the energy"))
    pieces = [_table(rows)]
    budget: Any = result_tables.error_budget(history)
    if budget:
        columns: dict[str, list[Any]] = {"quantity": [n.replace("_", " ") for n in budget]}
        columns["value"] = [f"{bar.value:.5g} {QUANTITIES[n]}" for n, bar in budget.items()]
        for cause in (*CAUSES, "total"):
            columns[cause] = [f"{100 * getattr(bar, cause):.2g} %" for bar in budget.values()]
        pieces += ["<h3>Error budget</h3>", _columns(columns)]
        pieces += [f"<p>{escape(note)}</p>" for note in budget.notes]
    return pieces


def _model(found: Results) -> list[str]:
    pieces = []
    if found.structure is not None:
        rows = [("structure", found.structure.describe())]
        rows += _advice(found)
        pieces.append(_table(rows))
    if found.model is not None:
        pieces.append(_table(result_tables.model_rows(found.model)))
        if np.ndim(found.model.k0) == 0:
            pieces.append(_anti_oscillators(found.model))
    return pieces


def _advice(found: Results) -> list[tuple[str, str]]:
    """What `advise` says of the family, where it can."""
    if found.structure is None or not hasattr(found.impactor, "hertz"):
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


def _anti_oscillators(model: Any) -> str:
    columns = {
        "anti-oscillator": list(range(1, model.n + 1)),
        "frequency (Hz)": model.omega / (2 * np.pi),
        "mass (kg)": model.m,
        "stiffness (N/m)": model.k,
    }
    return _columns(columns)


# -- HTML


def _figure(picture: Picture) -> str:
    caption = escape(f"{picture.caption} {_program()}.")
    image = ""
    if picture.data:
        image = f'<img alt="{escape(picture.heading)}" src="{picture.data}">'
    heading = escape(picture.heading)
    return f"<figure><h3>{heading}</h3>{image}<figcaption>{caption}</figcaption></figure>"


def _table(rows: Iterable[tuple[str, str]]) -> str:
    """Names and values."""
    cells = "".join(f"<tr><th>{escape(n)}</th><td>{escape(v)}</td></tr>\n" for n, v in rows)
    return f"<table>\n{cells}</table>" if cells else ""


def _columns(table: dict[str, Any]) -> str:
    """A table with a line of names."""
    head = "".join(f"<th>{escape(name)}</th>" for name in table)
    rows = "".join(
        "<tr>" + "".join(_cell(value) for value in row) + "</tr>\n"
        for row in zip(*table.values(), strict=True)
    )
    return f"<table>\n<tr>{head}</tr>\n{rows}</table>"


def _cell(value: Any) -> str:
    if isinstance(value, float | np.floating):
        text = f"{value:.5g}" if np.isfinite(value) else "–"
    else:
        text = str(value)
    number = re.fullmatch(r"[-–+.\deE]+( %)?", text)
    return f'<td class="number">{text}</td>' if number else f"<td>{escape(text)}</td>"
