"""What demos print is read once more."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from paths import demo


@pytest.fixture(autouse=True)
def bars_tell_what_they_hold(capsys: pytest.CaptureFixture[str]) -> Iterator[None]:
    """No demo prints a bar without the law's error, or the word numerical."""
    yield
    assert demo("page_outputs").unsaid(capsys.readouterr().out) == []
