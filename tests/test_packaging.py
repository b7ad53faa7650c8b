"""Wheel, source archive, conda recipe and Dockerfile agree with the project."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import numpy as np
import pytest

import antiosc as ao
from antiosc.engine import library
from paths import ROOT

PROGRAM = """
import antiosc as ao

assert "site-packages" in ao.__file__, ao.__file__
model = ao.AntiOscillators(m0=0.02, k0=1e6, m=[0.1], omega=[2000.0])
print(ao.simulate(model, ao.RigidMass(0.1, velocity=1.0), ao.Hertz(1e9), duration=3e-3).summary())
print(*model.to_matrices().save("blow.mtx"))
ao.export("blow.c", model, ao.RigidMass(0.1, velocity=1.0), ao.Hertz(1e9))
"""


def test_a_library_that_is_missing_damaged_or_of_other_sources_is_refused(tmp_path: Path):
    damaged = tmp_path / "damaged.so"
    damaged.write_bytes(b"no library")
    with pytest.raises(ao.MissingDependencyError, match="missing"):
        library.load(tmp_path / "none.so")
    with pytest.raises(ao.MissingDependencyError, match="cannot be loaded"):
        library.load(damaged)
    (tmp_path / "antiosc_march.h").write_text("changed")
    with pytest.raises(ao.MissingDependencyError, match="make"):
        library.load(source=tmp_path)


@pytest.mark.slow
def test_wheel_and_archive_are_whole_and_the_wheel_runs(tmp_path: Path):
    own = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}

    def run(*command: str) -> str:
        done = subprocess.run(
            command, cwd=tmp_path, capture_output=True, text=True, check=False, env=own
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    run("bash", str(ROOT / ".ci" / "dist"), str(tmp_path / "dist"), sys.executable)
    (wheel,), (archive,) = (list((tmp_path / "dist").glob(kind)) for kind in ("*.whl", "*.tar.gz"))
    sources = {
        str(path.relative_to(ROOT / "src"))
        for package in ("antiosc", "antiosc_app", "antiosc_decks", "antiosc_studies")
        for path in (ROOT / "src" / package).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    with zipfile.ZipFile(wheel) as file:
        inside = {name for name in file.namelist() if ".dist-info/" not in name}
        (points,) = (name for name in file.namelist() if name.endswith("entry_points.txt"))
        registered = file.read(points).decode()
        (about,) = (file.read(n).decode() for n in file.namelist() if n.endswith("METADATA"))
    assert re.search(r"^License(-Expression)?: BSD-3-Clause$", about, re.MULTILINE)
    links = re.findall(r"\]\(([^)]+)\)", about)
    assert len(links) > 10
    assert [link for link in links if not link.startswith("https://")] == []
    assert "antiosc = antiosc_app.cli:main" in registered
    assert "inp = antiosc_decks.readers:ABAQUS" in registered
    ours = sorted((ROOT / "csrc").rglob("*.[ch]"))
    assert inside == sources | {f"antiosc/{path.relative_to(ROOT)}" for path in ours}
    with tarfile.open(archive) as file:
        names = {name.split("/", 1)[-1] for name in file.getnames()}
    kept = {f"src/{name}" for name in sources if "libantiosc_march" not in name}
    assert kept | {"pyproject.toml", "LICENSE", "setup.py", "csrc/antiosc_march.h"} <= names
    assert {"tests/conftest.py", "demos/drop.py", "meshes/bracket.geo", "Makefile"} <= names
    assert not any("libantiosc_march" in name for name in names)

    # an environment of its own with the NumPy and SciPy of this machine; nothing is fetched
    run(sys.executable, "-m", "venv", "--without-pip", "fresh")
    fresh = tmp_path / "fresh" / "bin"
    (packages,) = (tmp_path / "fresh").glob("lib/*/site-packages")
    (packages / "others.pth").write_text(str(Path(np.__file__).parents[1]))
    pip = (sys.executable, "-m", "pip", "--python", str(fresh / "python"), "install", "--quiet")
    run(*pip, "--no-deps", "--no-index", "--force-reinstall", str(wheel))
    (tmp_path / "program.py").write_text(PROGRAM, encoding="utf-8")
    assert "peak force" in run(str(fresh / "python"), "program.py")
    assert "antiosc" in run(str(fresh / "antiosc"), "--help")


@pytest.mark.slow
def test_the_closing_lines_say_where_skipped_tests_run(tmp_path):
    (tmp_path / "test_one.py").write_text("import pytest\n\ndef test_a():\n    pytest.skip('no')\n")
    shutil.copy(ROOT / "tests" / "conftest.py", tmp_path)
    environment = {**os.environ, "PYTHONPATH": f"{ROOT / 'tests' / 'support'}:{ROOT / 'src'}"}
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(tmp_path)],
        cwd=tmp_path, env=environment, capture_output=True, text=True, check=True,
    )  # fmt: skip
    *_, told, closing = done.stdout.splitlines()
    assert told.startswith("1 skipped: `.ci/more`")
    assert "1 skipped" in closing


@pytest.mark.parametrize("script", ["run", "more"])
def test_scripts_of_continuous_integration_are_sound(script):
    lists = (ROOT / ".ci" / script).read_text()
    subprocess.run(["bash", "-n", ROOT / ".ci" / script], check=True)
    for kind in re.findall(r"for list in ([\w ]+);", lists):
        assert all((ROOT / ".ci" / f"packages-{name}").is_file() for name in kind.split())
