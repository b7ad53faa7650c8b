"""The validation book: rows are judged by their source's bound, and every case runs."""

from __future__ import annotations

import importlib
import re

import pytest

from paths import BENCHMARKS, ROOT

pytestmark = pytest.mark.fem
QUICK = {"sdnd101", "sdnd108", "vm65", "sdnl105", "hertz"}
ALL = [
    *("sdnd101", "sdnd108", "vm65"),
    *("sdnl111", "abaqus_truss", "vm265", "sdnv100", "sdnv100_confined"),
    *("sdnl104", "sdnl105", "sdnl301", "hertz", "zener", "kharaz"),
    *("fv2", "fv5", "fv12", "fv16", "fv32", "fv52"),
]


@pytest.fixture
def book(monkeypatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    monkeypatch.syspath_prepend(str(BENCHMARKS / "validation"))
    return importlib.import_module("book")


@pytest.mark.sample
@pytest.mark.parametrize(
    "name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in ALL]
)
def test_a_case_lies_within_its_bounds_or_says_why(name, book, tmp_path, capsys):
    rows = book.main(only=(name,), out=tmp_path)[name]
    assert [row.quantity for row in rows if not row.agrees and not row.why] == []
    assert sum(row.agrees for row in rows) > 0.6 * len(rows)
    assert (tmp_path / "pictures" / f"validation_{name}.png").stat().st_size > 0
    page = (tmp_path / "validation.md").read_text(encoding="utf-8")
    assert page.count("**outside**") == sum(not row.agrees for row in rows)
    assert name in capsys.readouterr().out


def test_the_page_holds_every_case(book):
    text = (ROOT / "docs" / "validation.md").read_text(encoding="utf-8")
    assert [case.name for case in book.CASES] == ALL
    for case in book.CASES:
        assert case.title in text
        assert case.given in text
    for test in book.WAITING:
        assert test.title in text
    for experiment, found in book.SEARCHED:
        assert f"| {experiment} | {found} |" in text
    pictures = re.findall(r"\]\((pictures/[^)]+)\)", text)
    assert len(pictures) == len(ALL)
    assert [p for p in pictures if not (ROOT / "docs" / p).is_file()] == []
    assert "Not explained" not in text
    read = {line.split("|")[1] for line in text.splitlines() if "| read |" in line}
    assert len(read) >= 9
