"""What demos print is read once more."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from antiosc.plot import charts
from paths import demo


@pytest.fixture(autouse=True)
def pictures_without_layout(monkeypatch: pytest.MonkeyPatch) -> None:
    """Most of the time of a picture goes into its layout, which tests/charts tests."""

    def rough(figure, target, **options):
        figure.set_layout_engine("none")
        figure.savefig(target, dpi=50)

    monkeypatch.setattr(charts, "render", rough)


@pytest.fixture(autouse=True)
def bars_tell_what_they_hold(capsys: pytest.CaptureFixture[str]) -> Iterator[None]:
    """No demo prints a bar without the law's error, or the word numerical."""
    yield
    assert demo("page_outputs").unsaid(capsys.readouterr().out) == []
