"""The demos of scenes run, small, and return what mechanics asks for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from paths import demo

pytestmark = [pytest.mark.fem, pytest.mark.slow]


def test_drop_on_corners(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    numbers = demo("drop_on_corners").main(n=40, size=0.025, out=tmp_path)
    assert len(numbers) == 26
    for name, row in numbers.items():
        kind = name.split()[0]
        assert row["corners"] == {"face": 4, "edge": 2, "corner": 1}[kind]
        assert row["impulse"] == pytest.approx(row["momentum"], rel=1e-3)
        assert row["lost"] > 0
    # the heavy part lies off the middle, but the box and its boards are the same from both sides
    for axis in "xyz":
        one, other = numbers[f"face +{axis}"], numbers[f"face -{axis}"]
        assert one["peak force"] == pytest.approx(other["peak force"], rel=0.05)
    # four corners share what one carries alone
    assert numbers["face -z"]["peak force"] / 4 < 0.6 * numbers["corner -x-y-z"]["peak force"]
    assert (tmp_path / "drop_on_corners.png").stat().st_size > 0
    assert "upper g" in capsys.readouterr().out


def test_tube_between_stops(tmp_path: Path) -> None:
    numbers = demo("tube_between_stops").main(
        gaps=(0.406e-3, 10.0), n=40, duration=0.06, out=tmp_path
    )
    near, far = numbers["0.406 mm"], numbers["10000 mm"]
    assert near["impacts"] > 10
    assert near["drift"] < 1e-2
    # the plates hold the tube to about their gap; without them it swings further
    assert near["end"] < 0.406e-3 + 1.5 * near["peak force"] / 1e5
    assert far["impacts"] == 0
    assert far["peak force"] == 0
    assert far["end"] > 2 * near["end"]
    assert (tmp_path / "tube_between_stops.png").stat().st_size > 0


def test_oblique_blow(tmp_path: Path) -> None:
    mu, speed = 0.25, 2.0
    numbers = demo("oblique_blow").main(
        angles=(20.0, 75.0), size=12e-3, n=16, speed=speed, friction=mu, out=tmp_path
    )
    for row in numbers.values():
        assert row["impulse"] == pytest.approx(row["mass"] * row["normal"], rel=1e-6)
        assert row["friction"] <= mu * row["peak force"] * (1 + 1e-6)
        assert row["drift"] < 1e-3
    flat, steep = numbers["75 rigid"], numbers["20 rigid"]
    # on what does not move the sphere rebounds as it came, and slides all along when it is flat
    assert flat["restitution"] == pytest.approx(1.0, abs=1e-4)
    assert flat["sideways"] == pytest.approx(-mu * 2 * speed, rel=1e-3)
    assert flat["spin"] == pytest.approx(2.5 * mu * 2 * speed / 10e-3, rel=1e-3)
    assert abs(steep["sideways"]) < mu * 2 * speed  # it sticks in between
    assert numbers["75 bracket"]["restitution"] < 0.9
    # sliding all along, friction is mu times the impulse on the bracket as well
    loose = numbers["75 bracket"]
    assert loose["sideways"] == pytest.approx(-mu * loose["normal"], rel=1e-3)
    assert 0 < loose["left in the part"] < 1
    assert np.isfinite([list(row.values()) for row in numbers.values()]).all()
    assert (tmp_path / "oblique_blow.png").stat().st_size > 0
