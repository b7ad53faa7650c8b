"""The demos of assemblies, small, on one rank and on two: what mechanics asks of their numbers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from paths import demo

pytestmark = [pytest.mark.fem, pytest.mark.slow]

SMALL = {
    "board_on_spacers": {"size": 0.02, "n": 40, "duration": 2e-3},
    "machine_guard": {"bolts": (1, 3), "size": 0.15, "n": 20},
}


def test_board_on_spacers(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    script = demo("board_on_spacers")
    numbers = script.main(**SMALL["board_on_spacers"], out=tmp_path)
    for row in numbers.values():
        assert row["impulse"] == pytest.approx(row["momentum"], rel=1e-6)
    solid, springs = numbers["solid spacers"], numbers["springs"]
    spacers = 4 * script.NYLON["rho"] * script.WIDE**2 * script.HIGH
    assert solid["mass"] - springs["mass"] == pytest.approx(spacers, rel=1e-9)
    # the springs are those of the spacers as beams; 40 anti-oscillators give the chip its motion,
    # not its largest acceleration
    for name, share in (("k0", 1e-3), ("first", 1e-3), ("peak_force", 0.03), ("moved", 0.06)):
        assert springs[name] == pytest.approx(solid[name], rel=share)
    assert (tmp_path / "board_on_spacers.png").stat().st_size > 0
    assert "solid spacers" in capsys.readouterr().out


@pytest.mark.filterwarnings("ignore:.*deflects by")  # by more than half its thickness
def test_machine_guard(tmp_path: Path) -> None:
    script = demo("machine_guard")
    numbers = script.main(**SMALL["machine_guard"], out=tmp_path)
    few, many = numbers["4 bolts"], numbers["12 bolts"]
    tube = script.STEEL["rho"] * (2 * script.HIGH + 2 * script.WIDE)
    tube *= script.TUBE**2 - (script.TUBE - 2 * script.WALL) ** 2
    panel = script.GLASS["rho"] * 5e-3 * script.WIDE * (script.TOP - script.LOW)
    bolt = script.STEEL["rho"] * np.pi / 4 * script.BOLT**2 * script.TUBE / 2
    for row, count in ((few, 4), (many, 12)):
        assert row["mass"] == pytest.approx(tube + panel + count * bolt, rel=1e-9)
        assert row["impulse"] == pytest.approx(row["momentum"], rel=1e-6)
        assert row["post"] < 0.1 * row["sag"]
    assert many["k0"] > 2 * few["k0"]
    assert many["first"] > 1.5 * few["first"]
    for name in ("machine_guard.png", "machine_guard_4.pvd", "machine_guard_12.pvd"):
        assert (tmp_path / name).stat().st_size > 0


def test_assembly_accuracy(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With one element the joined halves err as the solid with this element does, Rigid more."""
    bar, strip = demo("assembly_accuracy").main(most=2, out=tmp_path)
    for found, joined in ((bar, "beam on Mean"), (strip, "shell on Tie")):
        for ours, mesh in zip(found[joined], found["solid throughout"], strict=True):
            assert np.abs(ours).max() < 1e-2
            np.testing.assert_allclose(ours, mesh, atol=0.3 * mesh[0])
            assert abs(ours[1]) < 0.4 * abs(ours[0])
    assert (bar["beam on Rigid"][0] > bar["beam on Mean"][0]).all()
    assert (tmp_path / "assembly_accuracy.png").stat().st_size > 0
    assert "strip: shell on Tie" in capsys.readouterr().out


def test_spiders(tmp_path: Path) -> None:
    """Elimination and multipliers give one compliance; the factor of Rigid is leaner eliminated."""
    found = demo("spiders").main(sizes=(12,), out=tmp_path)  # a mean of more dofs than `wide.WIDE`
    assert set(found) == {"Mean of 625 nodes", "Rigid of 625 nodes"}
    for ways in found.values():
        exact = ways["bordered"]["compliance"]
        for way in set(ways) - {"block alone"}:
            assert ways[way]["compliance"] == pytest.approx(exact, rel=1e-9)
    mean, rigid = found.values()
    entries = "of the factor, MUMPS"
    assert mean["as assemble does"][entries] <= mean["eliminated, no basis"][entries]
    assert rigid["as assemble does"][entries] < rigid["bordered"][entries]
    assert "| Mean, 625 |" in (tmp_path / "spiders.md").read_text()
