"""A scene on two ranks: the serial answer, printed and written once."""

from __future__ import annotations

import pytest

from mpi import run_ranks
from scene_files import BRACKET, antiosc, numbers, written

LEVER = f"""\
{BRACKET}[extract]
n = 8
[impactor]
kind = "Sphere"
radius = 0.01
E = 210e9
nu = 0.3
rho = 7850
velocity = 2.0
[contact]
kind = "Hertz"
stiffness = 1e9
[simulate]
duration = 5e-4
[probes.corner]
point = [0.0, 0.030, 0.086]
quantity = "velocity"
[output]
fields = true
"""
SCRIPT = """
import sys
from antiosc.app.cli import main
print("ended with", main(sys.argv[1:]))
"""


@pytest.mark.mpi
@pytest.mark.fem
@pytest.mark.slow
def test_two_ranks_give_the_serial_answer_once(tmp_path, capsys):
    pytest.importorskip("dolfinx")
    path = written(tmp_path, LEVER)
    assert antiosc("run", path, "--out", tmp_path / "one", "--report", tmp_path / "one.html") == 0
    serial = capsys.readouterr().out
    files = ("--out", str(tmp_path / "two"), "--report", str(tmp_path / "two.html"))
    first, second = run_ranks(2, SCRIPT, "run", str(path), *files, timeout=200)
    told = [line.split("  ")[0] for line in first.replace("/two", "/one").splitlines()]
    assert told == [*(line.split("  ")[0] for line in serial.splitlines()), "ended with 0"]
    assert second == "ended with 0\n"
    one, two = numbers(tmp_path / "one"), numbers(tmp_path / "two")
    assert two["result"]["peak_force"] == pytest.approx(one["result"]["peak_force"], rel=1e-8)
    assert two["model"]["k0"] == pytest.approx(one["model"]["k0"], rel=1e-8)
    pages = [(tmp_path / name).read_text(encoding="utf-8") for name in ("one.html", "two.html")]
    drawn = [page.count("<img ") for page in pages]
    assert drawn[0] == drawn[1] > 3
    names = sorted(p.name for p in (tmp_path / "one").iterdir())
    assert sorted(p.name for p in (tmp_path / "two").iterdir()) == names
    assert {"history.csv", "probes.csv", "result.json", "series.pvd"} <= set(names)


@pytest.mark.mpi
@pytest.mark.fem
@pytest.mark.slow
def test_a_mistake_is_told_once_and_ends_both_ranks(tmp_path):
    pytest.importorskip("dolfinx")
    path = written(tmp_path, LEVER.replace('"clamp"', '"clampp"'))
    script = "import sys, io, contextlib\nfrom antiosc.app.cli import main\n"
    script += "told = io.StringIO()\nwith contextlib.redirect_stderr(told):\n"
    script += "    code = main(sys.argv[1:])\nprint(code, told.getvalue())\n"
    first, second = run_ranks(2, script, "run", str(path))
    assert first.startswith("1 ")
    assert "has no group 'clampp'" in first
    assert second == "1 \n"


@pytest.mark.mpi
@pytest.mark.fem
@pytest.mark.slow
def test_a_file_that_cannot_be_written_ends_both_ranks(tmp_path):
    """The report comes after it, and its field is shared among the ranks."""
    pytest.importorskip("dolfinx")
    (tmp_path / "out/result.json").mkdir(parents=True)
    path = written(tmp_path, LEVER.replace("fields = true", "csv = false"))
    files = ("--out", str(tmp_path / "out"), "--report", str(tmp_path / "r.html"))
    first, second = run_ranks(2, SCRIPT, "run", str(path), *files, timeout=200)
    assert first.endswith("ended with 1\n")
    assert second == "ended with 1\n"
    assert not (tmp_path / "r.html").exists()
