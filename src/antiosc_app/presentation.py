"""`Presentation`: texts and pictures of a result for terminal, files and reports."""

from __future__ import annotations

import base64
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

from antiosc.base import progress
from antiosc.base._types import Array
from antiosc.base.errors import AntioscError
from antiosc.base.texts import unit_prefix
from antiosc.plot.charts import legend_beside, new_figure, save_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Most curves of one chart.
MAX_CURVES = 12


class Picture(NamedTuple):
    """A picture of a report; `draw` writes it to a file with this ending."""

    heading: str
    caption: str
    draw: Callable[[Path], object]
    ending: str = ".png"


class DrawnPicture(NamedTuple):
    """A drawn picture; `data`: its data URL, or "" if drawing failed, for the caption's reason."""

    heading: str
    caption: str
    data: str


def drawn_pictures(pictures: Iterable[Picture]) -> Iterator[DrawnPicture]:
    """Draw pictures as data URLs; every rank must call it, since fields are distributed."""
    for picture in pictures:
        caption = picture.caption
        data_url = ""

        with progress.doing(f"drawing: {picture.heading}"), tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"picture{picture.ending}"
            try:
                picture.draw(path)
                kind = {".svg": "svg+xml"}.get(picture.ending, "png")
                content = base64.b64encode(path.read_bytes()).decode("ascii")
                data_url = f"data:image/{kind};base64,{content}"
            except (AntioscError, ValueError) as error:  # ValueError: a name read as a formula
                caption = f"Not drawn: {error}"
        yield DrawnPicture(picture.heading, caption, data_url)


def chart_picture(heading: str, caption: str, draw_axes: Callable[[Axes], object]) -> Picture:
    """A picture for which the function `draw_axes` draws into new axes."""

    def draw(path: Path) -> None:
        figure = new_figure((7.0, 3.4), shown=False)
        draw_axes(figure.subplots())
        save_figure(figure, path)

    return Picture(heading, caption, draw, ".svg")


def draw_curves(series: Iterable[tuple[str, Array, Array]], y: str, ax: Axes) -> None:
    """Draw at most MAX_CURVES curves (name, times [s], values) into `ax`; `y`: its label."""
    for name, time, values in islice(series, MAX_CURVES):
        ax.plot(1e3 * time, values, lw=1.2, label=escaped_name(name))
    ax.set_xlabel("time (ms)")
    ax.set_ylabel(y)
    legend_beside(ax)


def escaped_name(name: str) -> str:
    """A user's name, safe for matplotlib: no formulas, no control characters, not too long."""
    printable = "".join(c if c.isprintable() else "?" for c in name.replace("$", r"\$"))
    if len(printable) <= 60:
        return printable
    return f"{printable[:57]}…"


#: (name, value) rows; a table as name of a column -> its values.
Rows: TypeAlias = list[tuple[str, str]]
Columns: TypeAlias = dict[str, Any]
#: A block below a heading: names and values, a table of columns, a sentence, or nothing.
Block: TypeAlias = Rows | Columns | str

#: Largest number of rows of a table that are printed; the files contain all.
MAX_PRINTED_ROWS = 30
# -- texts and tables


def format_rows(rows: Rows) -> str:
    """Rows (name, text) as lines with two aligned columns."""
    width = max((len(name) for name, _ in rows), default=0)
    return "\n".join(f"{name:<{width}}  {value}".rstrip() for name, value in rows)


def format_columns(table: Columns) -> str:
    """The first MAX_PRINTED_ROWS rows of a table as text with prefixed units."""
    columns = with_unit_prefixes(table)
    rows = list(zip(*columns.values(), strict=True))
    cells = [
        list(columns),
        *([format_number(value) for value in row] for row in rows[:MAX_PRINTED_ROWS]),
    ]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    pairs = [zip(row, widths, strict=True) for row in cells]
    text = ["  ".join(f"{cell:>{width}}" for cell, width in row).rstrip() for row in pairs]
    if len(rows) > MAX_PRINTED_ROWS:
        text.append(f"… and {len(rows) - MAX_PRINTED_ROWS} more rows (the .csv file has all)")
    return "\n".join(text)


def with_unit_prefixes(table: Columns) -> dict[str, list[object]]:
    """A table whose values are scaled to prefixed units: "time (s)" -> "time (µs)"."""
    return dict(_prefixed_column(name, list(values)) for name, values in table.items())


def _prefixed_column(name: str, values: list[object]) -> tuple[str, list[object]]:
    """(name, values) of a column named as "time (s)", scaled to the prefix of the largest value."""
    title, _, unit = name.partition(" (")
    if unit == "%)":  # error bars: their further digits mean nothing
        return name, [float(f"{value:.2g}") for value in values]
    if not unit or not all(isinstance(v, float | np.floating) for v in values):
        return name, values
    numbers = np.array(values, dtype=float)
    largest = max(np.abs(numbers[np.isfinite(numbers)]), default=0.0)
    factor, prefixed_unit = unit_prefix(largest, unit.rstrip(")"))
    return f"{title} ({prefixed_unit})", list(factor * numbers)


def format_number(value: object) -> str:
    """Text of a number to five digits, or a dash if it is not finite; `str` of other values."""
    if isinstance(value, float | np.floating):
        if np.isfinite(value):
            return f"{value:.5g}"
        return "–"
    return str(value)


def spaced_name(name: str) -> str:
    """The name with blanks instead of underscores."""
    return name.replace("_", " ")


class Card(NamedTuple):
    """An answer: its question, its text, and for "does it break" the kind of verdict."""

    name: str
    text: str
    tone: str = ""


@dataclass
class Presentation:
    """Content for terminal, files, page and report on a result, made on every rank.

    Attributes
    ----------
    cards : the first answers: does it break, how hard, how far, where.
    asked : further numbers that were requested; rows : a few more.
    caution : caution to read with the answers; "" if there is none.
    sentences : sentences on how the answers were found.
    sections : blocks on the computation, by their heading.
    tables, fields : columns of a file, or function that writes it, by name of the file.
    numbers : numbers for result.json.
    plotted : objects with a method `plot`, by name of the file.
    pictures : pictures of a report.
    """

    cards: Sequence[Card] = ()
    asked: Rows = field(default_factory=list)
    rows: Rows = field(default_factory=list)
    caution: str = ""
    sentences: Sequence[str] = ()
    sections: dict[str, list[Block]] = field(default_factory=dict)
    tables: dict[str, Columns] = field(default_factory=dict)
    fields: dict[str, Callable[[Path], Path]] = field(default_factory=dict)
    numbers: dict[str, object] = field(default_factory=dict)
    plotted: dict[str, object] = field(default_factory=dict)
    pictures: Sequence[Picture] = ()

    @property
    def answers(self) -> Rows:
        """Rows (name, text) of the short text: cards, asked numbers, further rows."""
        return [*(card[:2] for card in self.cards), *self.asked, *self.rows]

    @property
    def of_report(self) -> list[tuple[str, list[Block]]]:
        """(heading, blocks) of each section of a report; the first one begins with `rows`."""
        first, *others = self.sections.items() or [("Results", [])]
        return [(first[0], [self.rows, *first[1]]), *others]

    @property
    def text(self) -> list[str]:
        """The paragraphs of the long text, which contains each number once."""
        blocks = (block for part in self.sections.values() for block in part)
        sentences = "\n".join(self.sentences)
        return [format_rows(self.answers), self.caution, sentences, *map(format_block, blocks)]


def format_block(block: Block) -> str:
    """A block as text."""
    if isinstance(block, str):
        return block
    return format_columns(block) if isinstance(block, dict) else format_rows(block)
