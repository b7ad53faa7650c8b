"""The validation book: rows are judged by their source's bound, every case runs, and published
tests of stops and of rods that strike come out by ways other than the book's.

The book takes rods in beam elements; here they are taken in their exact modes (the sines and
cosines of the wave equation) with the rest as residual compliance.
"""

from __future__ import annotations

import importlib
import re

import numpy as np
import pytest

import antiosc as ao
from paths import BENCHMARKS, ROOT

QUICK = {"sdnd101", "sdnd108", "sdnd121", "vm65", "sdnd106", "sdnl105", "hertz", "leeb"}
ALL = [
    *("sdnd101", "sdnd108", "sdnd121", "hammer", "vm65", "sdnd100", "sdnd104", "sdnd106"),
    *("sdnl111", "abaqus_truss", "vm265", "sdnv100", "sdnv100_confined", "ansys_bar"),
    *("sdnl104", "sdnl105", "sdnl301", "hertz", "restituted", "zener", "kharaz", "leeb"),
    *("fv2", "fv5", "fv12", "fv16", "fv32", "fv52"),
    *("r0016_13_modes", "r0016_21_modes", "r0016_5", "r0016_13", "r0016_21"),
]

LONG = {"sdnl301"}  # half a minute: by `make bench-validate` alone


@pytest.fixture
def validation(monkeypatch):
    """A module of the book by its name."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    monkeypatch.syspath_prepend(str(BENCHMARKS / "validation"))
    return importlib.import_module


@pytest.mark.fem
@pytest.mark.parametrize(
    "name",
    [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in ALL if n not in LONG],
)
def test_a_case_lies_within_its_bounds_or_says_why(name, validation, tmp_path, capsys):
    rows = validation("book").main(only=(name,), out=tmp_path)[name]
    assert [row.quantity for row in rows if not row.agrees and not row.why] == []
    assert sum(row.agrees for row in rows) > 0.5 * len(rows)
    assert (tmp_path / "pictures" / f"validation_{name}.png").stat().st_size > 0
    page = (tmp_path / "validation.md").read_text(encoding="utf-8")
    assert page.count("**outside**") == sum(not row.agrees for row in rows)
    assert name in capsys.readouterr().out


@pytest.mark.fem
def test_the_page_holds_every_case(validation):
    book = validation("book")
    text = (ROOT / "docs" / "validation.md").read_text(encoding="utf-8")
    assert [case.name for case in book.CASES] == ALL
    for case in book.CASES:
        assert case.title in text
        assert case.given in text
    assert book.MISSING in text
    pictures = re.findall(r"\]\((pictures/[^)]+)\)", text)
    assert len(pictures) == len(ALL)
    assert [p for p in pictures if not (ROOT / "docs" / p).is_file()] == []
    assert "Not explained" not in text
    read = {line.split("|")[1] for line in text.splitlines() if "| read |" in line}
    assert len(read) >= 20


#: name of a rod's case in the book
WALLS = ("abaqus_truss", "vm265", "sdnv100", "sdnv100_confined", "ansys_bar")


def rod(length: float, E: float, rho: float, area: float, held: bool = False) -> ao.SiteModes:
    """A rod seen from the end x = 0; free there, the other end free or held. One way: +x."""
    c, mass, n = float(np.sqrt(E / rho)), rho * area * length, 60
    j = np.arange(n)
    if held:
        omega, b = (j + 0.5) * np.pi * c / length, np.full(n, np.sqrt(2 / mass))
        rest = length / (E * area) - np.sum(b**2 / omega**2)
    else:
        omega, b = j * np.pi * c / length, np.where(j > 0, np.sqrt(2 / mass), np.sqrt(1 / mass))
        # sum over all elastic modes of b^2/omega^2 = L/(3 E A)
        rest = length / (3 * E * area) - np.sum(b[1:] ** 2 / omega[1:] ** 2)
    momentum = np.zeros((n, 6))
    if not held:
        momentum[0, 0] = np.sqrt(mass)
    matrix = np.diag([mass, mass, mass, 1, 1, 1.0])
    inertia = ao.Inertia(np.zeros(3), matrix, momentum)
    along = [(1.0, 0, 0)]
    return ao.SiteModes(omega, b[:, None], ("end",), r=[[rest]], directions=along, inertia=inertia)


def outside(rows) -> list[str]:
    return [row.quantity for row in rows if not row.agrees]


def test_sdnl104_exact(validation):
    """The printed displacement, 2 % of the gap, holds the error of Newmark's step: 0.8 %."""
    stops = validation("stops")
    hit = stops.pushed(stops.ten_elements()).run(0.16, tol=1e-4)
    assert outside(stops.of_the_tip(hit, "exact", 0.01)) == []
    assert outside(stops.of_the_tip(hit, "exact", 1e-3)[2:]) == []


def test_sdnl111_struck_bar(validation):
    rods = validation("rods")
    hit = rods.collided(rod(*rods.EQUAL), rod(*rods.EQUAL, held=True))
    rows = rods.of_the_struck_end(hit)
    assert len(rows) == 5
    assert outside(rows) == []


@pytest.mark.filterwarnings("ignore:the speed of the blow")
@pytest.mark.parametrize("case", WALLS)
def test_rod_on_a_wall(validation, case):
    """The force is rho c v A for the time 2 L/c; then the whole rod flies back at v."""
    rods = validation("rods")
    data = rods.WALLS[case]
    hit = rods.flown(data, rod(data.length, data.E, data.rho, data.area))
    assert outside(rods.at_the_wall(data, hit)) == []
    one, c = hit["rod:end", "wall"], np.sqrt(data.E / data.rho)
    start, end = one.contacts[0][0], one.contacts[-1][1]
    assert start == pytest.approx(data.gap / data.speed, rel=1e-9)
    assert end - start == pytest.approx(2 * data.passage, rel=0.02)
    # the wall's spring takes the corners off the rectangle: its plateau and its impulse stay
    plateau = np.median(one.force[one.force > 0.1 * one.peak_force])
    assert plateau == pytest.approx(data.rho * c * data.speed * data.area, rel=0.02)
    momentum = data.speed * data.rho * data.area * data.length
    assert one.impulse == pytest.approx(2 * momentum, rel=0.01)
    assert hit.bodies["rod"].momentum[-1, 0] == pytest.approx(momentum, rel=0.02)
