"""The demos of scenes run, small, and return what mechanics asks for."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import antiosc as ao
from mpi import one_and_several
from paths import demo

pytestmark = [pytest.mark.fem, pytest.mark.slow]


def test_drop_on_corners(pictured: Path) -> None:
    numbers = demo("drop_on_corners").main(n=40, size=0.025, out=pictured)
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


def test_tube_between_stops(pictured: Path) -> None:
    numbers = demo("tube_between_stops").main(
        gaps=(0.406e-3, 10.0), n=40, duration=0.06, out=pictured
    )
    near, far = numbers["0.406 mm"], numbers["10000 mm"]
    assert near["impacts"] > 10
    assert near["drift"] < 1e-2
    # the plates hold the tube to about their gap; without them it swings further
    assert near["end"] < 0.406e-3 + 1.5 * near["peak force"] / 1e5
    assert far["impacts"] == 0
    assert far["peak force"] == 0
    assert far["end"] > 2 * near["end"]


def test_oblique_blow(pictured: Path) -> None:
    mu, speed = 0.25, 2.0
    numbers = demo("oblique_blow").main(
        angles=(20.0, 75.0), size=12e-3, n=16, speed=speed, friction=mu, out=pictured
    )
    for row in numbers.values():
        assert row["impulse"] == pytest.approx(row["mass"] * row["normal"], rel=1e-6)
        assert row["friction"] <= mu * row["peak force"] * (1 + 1e-6)
        assert row["drift"] < 1e-3
    flat, steep = numbers["75 rigid"], numbers["20 rigid"]
    # the contact yields; on what does not move the sphere slides all along when the blow is flat
    change = (1 + flat["restitution"]) * speed
    assert 0.4 < flat["restitution"] < 0.7
    assert flat["sideways"] == pytest.approx(-mu * change, rel=1e-3)
    assert flat["spin"] == pytest.approx(2.5 * mu * change / 10e-3, rel=1e-3)
    assert abs(steep["sideways"]) < mu * change  # it sticks in between
    assert numbers["75 bracket"]["restitution"] < 0.9
    # sliding all along, friction is mu times the impulse on the bracket as well
    loose = numbers["75 bracket"]
    assert loose["sideways"] == pytest.approx(-mu * loose["normal"], rel=1e-3)
    assert 0 < loose["left in the part"] < 1
    assert np.isfinite([list(row.values()) for row in numbers.values()]).all()


SMALL = {
    "board_on_spacers": {"size": 0.02, "n": 40, "duration": 2e-3},
    "machine_guard": {"bolts": (1, 3), "size": 0.15, "n": 20},
}


def test_board_on_spacers(pictured: Path) -> None:
    script = demo("board_on_spacers")
    numbers = script.main(**SMALL["board_on_spacers"], out=pictured)
    for row in numbers.values():
        assert row["impulse"] == pytest.approx(row["momentum"], rel=1e-6)
    solid, springs = numbers["solid spacers"], numbers["springs"]
    spacers = 4 * script.NYLON.rho * script.WIDE**2 * script.HIGH
    assert solid["mass"] - springs["mass"] == pytest.approx(spacers, rel=1e-9)
    # the springs are those of the spacers as beams
    for name, share in (("k0", 1e-3), ("first", 1e-3), ("peak_force", 0.03), ("moved", 0.06)):
        assert springs[name] == pytest.approx(solid[name], rel=share)


@pytest.mark.filterwarnings("ignore:.*deflects by")  # by more than half its thickness
def test_machine_guard(tmp_path: Path) -> None:
    script = demo("machine_guard")
    numbers = script.main(**SMALL["machine_guard"], out=tmp_path)
    few, many = numbers["4 bolts"], numbers["12 bolts"]
    tube = ao.material(script.STEEL).rho * (2 * script.HIGH + 2 * script.WIDE)
    tube *= script.TUBE**2 - (script.TUBE - 2 * script.WALL) ** 2
    panel = ao.material("PC").rho * 5e-3 * script.WIDE * (script.TOP - script.LOW)
    bolt = ao.material(script.STEEL).rho * np.pi / 4 * script.BOLT**2 * script.TUBE / 2
    for row, count in ((few, 4), (many, 12)):
        assert row["mass"] == pytest.approx(tube + panel + count * bolt, rel=1e-9)
        assert row["impulse"] == pytest.approx(row["momentum"], rel=1e-6)
        assert row["post"] < 0.1 * row["sag"]
    assert many["k0"] > 2 * few["k0"]
    assert many["first"] > 1.5 * few["first"]
    for name in ("machine_guard.png", "machine_guard_4.pvd", "machine_guard_12.pvd"):
        assert (tmp_path / name).stat().st_size > 0


def test_assembly_accuracy(pictured: Path) -> None:
    """With one element the joined halves err as the solid with this element does, Rigid more."""
    bar, strip = demo("assembly_accuracy").main(most=2, out=pictured)
    for found, joined in ((bar, "beam on Mean"), (strip, "shell on Tie")):
        for ours, mesh in zip(found[joined], found["solid throughout"], strict=True):
            assert np.abs(ours).max() < 1e-2
            np.testing.assert_allclose(ours, mesh, atol=0.3 * mesh[0])
            assert abs(ours[1]) < 0.4 * abs(ours[0])
    assert (bar["beam on Rigid"][0] > bar["beam on Mean"][0]).all()


def test_spiders(tmp_path: Path) -> None:
    """Elimination and multipliers give one compliance; the factor of Rigid is leaner eliminated."""
    found = demo("spiders").main(
        sizes=(12,), out=tmp_path
    )  # a mean of more dofs than `layout.DENSE_ROW`
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


def test_random_parts(tmp_path):
    out = tmp_path / "cases.jsonl"
    main = demo("error_budget").main
    assert len(main(parts=2, seed=4, dim=2, out=str(out))) == 2
    cases = main(parts=4, seed=4, dim=2, out=str(out))
    assert len(cases) == 4
    assert sum(case.holds for case in cases) >= 3
    assert 0.4 < np.median([case.k0 for case in cases]) < 2.5
    assert np.median([case.corrected for case in cases]) < 0.8
    rows = [json.loads(row) for row in out.read_text().splitlines()]
    assert [row["number"] for row in rows] == [0, 1, 2, 3]
    assert out.with_suffix(".png").exists()


def test_strike_over_lines(tmp_path):
    page = tmp_path / "beams.md"
    rows = demo("strike_beams").main(cases=2, seed=1, tols=(0.01,), page=str(page))
    assert len(rows) == 2
    for row in rows:
        assert row["true"] <= row["promised"] <= row["asked"]
        assert row["ratio"] <= 1
    assert "| 1.0% | 2 | 100% | 100% | 100% |" in page.read_text()


def test_random_shells(tmp_path, capsys):
    script = demo("shell_error_bars")
    script.HALVINGS, script.COSTLY, script.ROUNDS = 1, {"plate": 0.3}, 1
    out, page = tmp_path / "shells.jsonl", tmp_path / "page.md"
    (first,) = script.main(shells=1, seed=3, out=str(out))
    cases = script.main(shells=2, seed=3, out=str(out), page=str(page))
    assert [case.number for case in cases] == [0, 1]
    assert cases[0] == first
    assert all(case.holds and not case.refused for case in cases)
    told = capsys.readouterr().out
    assert "| all | 2 | 100% |" in told
    assert "| all | 2 | 100% |" in page.read_text()
    assert "| plate |" in page.read_text()


@pytest.mark.filterwarnings("ignore:the facets at the site")  # of a coarse mesh
def test_beams_beside_solid_bars(tmp_path):
    page = tmp_path / "model.md"
    (found,) = demo("beam_model").main(bars=1, fine=0.6, page=str(page))
    pairs = [pair for blow in found["blows"] for pair in blow.values()]
    assert max(true / share for true, share in pairs) <= 1
    assert max(true for true, _ in pairs) > 0.03
    assert found["compliance"] < -0.5
    assert "30 of 30" in page.read_text()


@pytest.mark.mpi
def test_two_ranks_find_the_same(tmp_path: Path) -> None:
    script = """
    import contextlib, io, json, sys
    from pathlib import Path
    from paths import demo
    with contextlib.redirect_stdout(io.StringIO()):
        numbers = demo("machine_guard").main(**json.loads(sys.argv[1]), out=Path(sys.argv[2]))
    names = "mass", "k0", "first", "peak_force", "impulse"
    print(json.dumps([[row[name] for name in names] for row in numbers.values()]))
    """
    one, two = one_and_several(script, json.dumps(SMALL["machine_guard"]), str(tmp_path))
    np.testing.assert_allclose(two, one, rtol=1e-5)
