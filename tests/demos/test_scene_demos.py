"""The demos of scenes run, small, and return what mechanics asks for."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import antiosc as ao
from paths import demo

pytestmark = [pytest.mark.fem, pytest.mark.slow]


def test_oblique_blow(pictured: Path) -> None:
    mu, speed = 0.25, 2.0
    numbers = demo("oblique_blow").main(
        angles=(20.0, 75.0), size=20e-3, n=8, speed=speed, friction=mu, out=pictured
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
    "machine_guard": {"bolts": (1, 3), "size": 0.15, "n": 8},
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


@pytest.mark.filterwarnings("ignore:.*free to move as a rigid body")
def test_robot_contact(tmp_path: Path) -> None:
    """The arm is as a rigid one on a pivot, but for its bending; a faster tip strikes harder."""
    script = demo("robot_contact")
    numbers, faster = (script.main(velocity=v, out=tmp_path) for v in (0.125, 0.25))
    area = np.pi / 4 * (script.DIAMETER**2 - (script.DIAMETER - 2 * script.WALL) ** 2)
    link = 2700.0 * area * np.hypot(script.ELBOW[0], script.ELBOW[2])
    turned = link * sum((x + 0.2) ** 2 + 0.4**2 / 12 for x in (0.0, 0.4))  # about the vertical axis
    at_tip = (turned + script.JOINT * 0.4**2 + script.WRIST * 0.8**2) / 0.8**2
    for region, row in numbers.items():
        stiffness, mass, limit = script.BODY[region]
        spring = 1 / (1 / stiffness + 1 / 40e3)
        rigid = script.by_standard(0.125, spring, mass, at_tip)
        assert row["force"] == pytest.approx(rigid, rel=5e-3)
        assert row["force"] < row["standard"]
        assert row["allowed"] * row["force"] == pytest.approx(0.125 * limit)
        assert faster[region]["force"] == pytest.approx(2 * row["force"], rel=1e-3)
        assert faster[region]["allowed"] == pytest.approx(row["allowed"], rel=1e-3)
    assert (tmp_path / "robot_contact.png").stat().st_size > 0


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


def test_random_parts(tmp_path):
    out = tmp_path / "cases.jsonl"
    book = demo("error_budget")
    book.REFERENCE, book.FINE = 0.1, {2: 4e-3}  # coarser meshes of the truth
    main = book.main
    assert len(main(parts=1, seed=4, dim=2, out=str(out))) == 1
    cases = main(parts=2, seed=4, dim=2, out=str(out))
    assert len(cases) == 2
    assert any(case.holds for case in cases)
    assert 0.4 < np.median([case.k0 for case in cases]) < 2.5
    assert np.median([case.corrected for case in cases]) < 0.8
    rows = [json.loads(row) for row in out.read_text().splitlines()]
    assert [row["number"] for row in rows] == [0, 1]
    assert out.with_suffix(".png").exists()
