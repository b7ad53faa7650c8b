"""The demos' command lines: what they cannot take ends them with one line, not with a traceback."""

from __future__ import annotations

import argparse
from functools import wraps

import pytest

import antiosc as ao
from paths import BENCHMARKS, DEMOS, demo

SCRIPTS = [p.stem for p in DEMOS.glob("*.py") if "def main(" in p.read_text(encoding="utf-8")]


@pytest.mark.parametrize(
    ("kind", "wrong"),
    [
        ("positive", ("0", "-1", "nan", "inf", "x", "")),
        ("count", ("0", "1.5", "1e99", "x")),
        ("seed", ("-1", "x")),
    ],
)
def test_a_bad_argument_is_named(kind, wrong, capsys):
    options = demo("command_line")
    one = getattr(options, kind)
    for text in wrong:
        for read, given in ((one, text), (options.listed(one), f"1,{text}")):
            parser = argparse.ArgumentParser()
            parser.add_argument("--it", type=read)
            with pytest.raises(SystemExit) as ended:
                options.run(parser, lambda **_: pytest.fail("it ran"), [f"--it={given}"])
            assert ended.value.code == 2
            assert "error: argument --it: " in capsys.readouterr().err.splitlines()[-1]


@pytest.mark.fem
@pytest.mark.parametrize("name", SCRIPTS)
def test_what_antiosc_refuses_is_one_line(name, capsys):
    @wraps(demo(name).main)
    def main(**_):
        raise ao.InputError("radius must be > 0 (in m); got 0.")

    with pytest.raises(SystemExit) as ended:
        demo("command_line").command(main, [])
    assert ended.value.code == 1
    assert capsys.readouterr().err.endswith(": radius must be > 0 (in m); got 0.\n")


@pytest.mark.fem
@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(p.stem for p in BENCHMARKS.glob("*.py")))
def test_a_measurement_is_loaded_with_what_it_imports(name):
    if name == "exports":
        pytest.importorskip("fmpy")
        pytest.importorskip("mujoco")
    assert demo(name).__doc__
