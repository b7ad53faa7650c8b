"""The demos' command lines: what they cannot take ends them with one line, not with a traceback."""

from __future__ import annotations

import warnings
from functools import wraps

import pytest

import antiosc as ao
from paths import demo

FEM = pytest.mark.fem
#: demo -> an option and values that it cannot take
BAD = {
    "assembly_accuracy": {"--most": ("0", "x")},
    "assembly_speed": {"--sizes": ("x", "0"), "--rounds": ("0",)},
    "board_on_spacers": {"--size": ("0", "x"), "--height": ("-1",), "--n": ("0",)},
    "cholmod_or_mumps": {"--sizes": ("x", "0"), "--sites": ("0",), "--rounds": ("0",)},
    "composite_panel": {"--length": ("x", "-1", "nan", "0"), "--elements": ("1.5", "0")},
    "drop": {"--height": ("0", "x"), "--impacts": ("0",), "--falls": ("-1",)},
    "drop_on_corners": {"--height": ("0", "x"), "--n": ("0",), "--size": ("-1",)},
    "error_budget": {"--parts": ("0", "x"), "--seed": ("-1",), "--dim": ("4", "x")},
    "fidelity": {"--fine": ("x", "0", "-1", "inf"), "--cases": ("x", ""), "--n": ("0", "2.5")},
    "free_modes": {"--sizes": ("x", "0"), "--counts": ("0", "1.5"), "--rounds": ("0",)},
    "fuzz": {"--scenes": ("0", "x"), "--seed": ("-1", "x"), "--budget": ("0",)},
    "fuzz_scenes": {"--scenes": ("0", "x"), "--first": ("-1",), "--budget": ("0",)},
    "impact_map": {"--size": ("0", "x"), "--radius": ("-1",), "--check": ("-1",)},
    "impact_on_bracket": {"--size": ("x", "0"), "--n": ("-1", "x"), "--velocity": ("nan",)},
    "machine_guard": {"--bolts": ("", "0", "1,x"), "--thickness": ("0",), "--mass": ("nan",)},
    "oblique_blow": {"--angles": ("", "10,x", "-1"), "--friction": ("0",), "--n": ("1.5",)},
    "plate_impact": {"--inelasticities": ("", "0.1,x", "0"), "--sizes": ("2,-3",), "--n": ("0",)},
    "scene_errors": {"--scenes": ("0", "x"), "--first": ("-1",), "--tol": ("0", "nan")},
    "shell_error_bars": {"--shells": ("0", "x"), "--seed": ("-1",)},
    "shell_size": {"--elements": ("", "3,x", "0"), "--n": ("x",)},
    "spiders": {"--sizes": ("x", "0")},
    "speed_accuracy": {"--sizes": ("x", "0")},
    "stability": {"--most": ("0",), "--counts": ("x",), "--decades": ("-1",), "--fine": ("1.5",)},
    "strike_or_uniform": {"--tols": ("x", "0"), "--scenes": ("0", "99", "x"), "--dofs": ("0",)},
    "stiffened_panel": {"--skin": ("0", "x"), "--n": ("0",), "--duration": ("1e99",)},
    "tube_between_stops": {"--gaps": ("", "1,-2"), "--duration": ("nan",)},
    "work_precision": {"--repeats": ("0",), "--scenes": ("x",)},
}
LIGHT = {"fuzz", "fuzz_scenes", "scene_errors", "stability", "work_precision"}
CASES = [
    pytest.param(name, option, value, marks=[] if name in LIGHT else [FEM])
    for name, options in BAD.items()
    for option, values in options.items()
    for value in values
]


@pytest.mark.parametrize(("name", "option", "value"), CASES)
def test_a_bad_argument_is_named(name, option, value, capsys, monkeypatch):
    script = demo(name)
    monkeypatch.setattr(script, "main", wraps(script.main)(lambda **_: pytest.fail("it ran")))
    with pytest.raises(SystemExit) as ended:
        script.command([f"{option}={value}"])
    assert ended.value.code == 2
    said = capsys.readouterr().err.strip().splitlines()[-1]
    assert f"error: argument {option}: " in said


@pytest.mark.parametrize("name", [n if n in LIGHT else pytest.param(n, marks=FEM) for n in BAD])
def test_what_antiosc_refuses_is_one_line(name, capsys, monkeypatch):
    script = demo(name)

    @wraps(script.main)
    def main(**_):
        raise ao.InputError("radius must be > 0 (in m); got 0.")

    monkeypatch.setattr(script, "main", main)
    with pytest.raises(SystemExit) as ended:
        script.command([])
    assert ended.value.code == 1
    assert capsys.readouterr().err.endswith(": radius must be > 0 (in m); got 0.\n")


@pytest.mark.fem
@pytest.mark.parametrize("fine", [0.05, 0.5, 0.7])
def test_the_ladder_of_models_has_meshes_however_coarse(fine):
    ladder = demo("fidelity")
    for case in ladder.CASES.values():
        for size, cells in (((case.length, case.width), (28, 4)), (case.size, (32, 8, 4))):
            mesh = ladder.graded(size, tuple(round(n * fine) for n in cells), case.thickness / 8)
            x = mesh.geometry.x[:, : len(size)]
            assert x.min() >= 0
            assert x.max(axis=0) == pytest.approx(size)


@pytest.mark.fem
@pytest.mark.slow
def test_the_composite_panels_converge_at_the_defaults(tmp_path):
    numbers = demo("composite_panel").main(out=tmp_path)  # a warning would be an error
    for row in numbers.values():
        assert row["impulse"] == pytest.approx(row["momentum"], rel=1e-6)


@pytest.mark.fem
@pytest.mark.slow
def test_the_ladder_climbs_a_coarse_mesh(tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ao.AntioscWarning)  # of patches that are not resolved
        found = demo("fidelity").main(cases=("panel, large sphere",), n=12, fine=0.5, out=tmp_path)
    assert 0 < found["panel, large sphere"]["shell"]["error"] < 0.2
