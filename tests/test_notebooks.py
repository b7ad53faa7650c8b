"""Notebooks: a figure shows once, long work tells what it does and how long it took."""

from __future__ import annotations

import sys
from types import ModuleType, SimpleNamespace

import pytest

from antiosc.base import progress


def test_a_notebook_shows_what_is_done_and_how_long_it_took(monkeypatch):
    told: list[str] = []
    clock = iter([0.0, 5.0, 5.01, 20.0, 30.0, 30.0])

    def shown(line, **options):
        told.append(line["text/plain"])
        return SimpleNamespace(update=shown)

    display = ModuleType("IPython.display")
    display.display = shown
    notebook = ModuleType("IPython")
    notebook.get_ipython = lambda: SimpleNamespace(kernel=True)
    monkeypatch.setitem(sys.modules, "IPython", notebook)
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    monkeypatch.setattr(progress, "time", SimpleNamespace(monotonic=lambda: next(clock)))
    with progress.doing("reducing") as further:
        further("3 of 20")
        further("4 of 20")  # too soon after the one before
        further("9 of 20")
    assert told == [
        *("antiosc: reducing …", "antiosc: reducing: 3 of 20 …", "antiosc: reducing: 9 of 20 …"),
        "antiosc: reducing: 30.0 s",
    ]


@pytest.mark.parametrize("backend", ["agg", "module://matplotlib_inline.backend_inline"])
def test_a_figure_that_a_cell_returns_is_not_known_to_pyplot_too(backend, monkeypatch):
    pyplot = pytest.importorskip("matplotlib.pyplot")
    from antiosc.base import charts

    told: list[bool] = []
    pyplot.switch_backend("agg")
    monkeypatch.setattr(pyplot, "get_backend", lambda: backend)
    monkeypatch.setattr(charts, "_let_notebook_draw", lambda: told.append(True))
    before = len(pyplot.get_fignums())
    figure = charts.new_figure((3.0, 2.0), shown=True)
    assert len(pyplot.get_fignums()) - before == (backend == "agg")
    assert told == [True] * (backend != "agg")
    pyplot.close(figure)


def test_a_notebook_draws_the_figure_of_its_first_cell(monkeypatch):
    """pyplot tells it how after that cell only, which would show the name of the figure."""
    matplotlib = pytest.importorskip("matplotlib.figure")
    from antiosc.base import charts

    formatters: dict[str, set[object]] = {"image/png": set()}
    shell = SimpleNamespace(display_formatter=SimpleNamespace(formatters=formatters))
    notebook, tools = ModuleType("IPython"), ModuleType("IPython.core.pylabtools")
    notebook.get_ipython = lambda: shell
    tools.select_figure_formats = lambda shell, formats: formatters["image/png"].update(formats)
    monkeypatch.setitem(sys.modules, "IPython", notebook)
    monkeypatch.setitem(sys.modules, "IPython.core.pylabtools", tools)
    charts._let_notebook_draw()
    assert formatters["image/png"] == {"png"}
    formatters["image/png"] = {matplotlib.Figure}  # as its user has set it
    charts._let_notebook_draw()
    assert formatters["image/png"] == {matplotlib.Figure}
