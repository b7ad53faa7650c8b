"""`antiosc export`: the impact, the scene or the model of a scene file for another program."""

from __future__ import annotations

import pytest

import antiosc as ao
from fmus import OK, Fmu
from scene_files import BEAM, FRAME, HIT, LAW, MATRICES, antiosc, objects, written

MODEL = f"{MATRICES}dof = 'z'\n[extract]\nn = 6\n"
#: The ball falls on the beam.
FALLS = BEAM.replace("duration", "gap = 1e-5\ngravity = 9.81\nduration")


@pytest.mark.parametrize(("text", "fmi"), [(BEAM, 2), (BEAM, 3), (FALLS, 2), (FRAME, 3)])
def test_the_fmu_of_a_scene_file_gives_its_forces(tmp_path, text, fmi):
    path = written(tmp_path, text)
    assert antiosc("export", path, tmp_path / "blow.fmu", "--fmi", fmi) == 0
    fmu = Fmu(tmp_path / "blow.fmu", tmp_path / "unpacked")
    assert fmu.version == fmi
    run, hit = fmu.instance(), objects(path).history
    assert run.begin() == OK
    contacts = [name for name in fmu.variables if name.endswith("peak_force")]
    found = run.run(hit.time[-1], 3, contacts)[-1]
    run.close()
    several = isinstance(hit, ao.SceneHistory)
    pairs = [tuple(name.removesuffix(".peak_force").split(",")) for name in contacts]
    expected = [hit[pair].peak_force if several else hit.peak_force for pair in pairs]
    assert found == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize(
    ("text", "out", "word"),
    [
        ("no TOML", "x.txt", ".fmu"),
        ("no TOML", "x.fmu", "TOML"),
        (HIT, "x.fmu", "model"),
        (MODEL.replace("n = 6", "n = -6"), "x.fmu", "-6"),
        (FRAME, "x.mo", "Scene"),
        (BEAM, "none/x.fmu", "x.fmu"),
        (BEAM.replace(LAW, "[contact]\nkind = 'Linear'\nstiffness = -1.0\n"), "x.c", "stiffness"),
    ],
)
def test_what_cannot_be_exported_is_one_sentence(tmp_path, capsys, text, out, word):
    path = written(tmp_path, text)
    assert antiosc("export", path, tmp_path / out) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert word in line
    assert list(tmp_path.iterdir()) == [path]
