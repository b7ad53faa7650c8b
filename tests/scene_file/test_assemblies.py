"""Assemblies, nested objects and the schema of scene files."""

from __future__ import annotations

import re
import tomllib

import numpy as np
import pytest

from antiosc.app.scene_file.schema import schema
from antiosc.base.texts import engineering
from paths import MESHES
from scene_files import BEAM, FRAME, SCENES, SWEEP, antiosc, numbers, written

#: What a report shows of a map.
MAPPED = ("peak force", "contact time", "k0")


pytestmark = pytest.mark.fem

PART = f"""\
[parts.NAME.geometry]
source = "{MESHES}/beam.msh"
[parts.NAME.material]
kind = "Beam"
E = 210e9
nu = 0.3
rho = 7850
section = {{ kind = "Section.rectangle", width = 0.02, height = 0.01 }}
orientation = [0, 0, 1]
"""
#: Two bars of 1 m, welded end to end; the first is clamped.
BARS = f"""\
{PART.replace("NAME", "first")}
[[parts.first.supports]]
near = [[0, 0, 0], 1e-6]
{PART.replace("NAME", "second")}
[at.second]
shift = [1.0, 0, 0]
[[joints]]
kind = "Weld"
a = ["first", [1.0, 0, 0]]
b = ["second", [1.0, 0, 0]]
[sites.tip]
point = [2.0, 0, 0]
direction = [0, 0, -1]
[extract]
n = 6
[impactor]
kind = "RigidMass"
mass = 0.1
velocity = 1
[contact]
kind = "Linear"
stiffness = 1e5
[simulate]
duration = 5e-3
[probes.middle]
point = [1.0, 0, 0]
part = "first"
quantity = "rotation"
"""


def test_an_assembly_runs(tmp_path, capsys):
    pytest.importorskip("dolfinx")
    assert antiosc("run", written(tmp_path, BARS), "--out", tmp_path) == 0
    # a cantilever of 2 m, 3EI/L³
    stiffness = 3 * 210e9 * 0.02 * 0.01**3 / 12 / 2.0**3
    assert numbers(tmp_path)["model"]["k0"] == pytest.approx(stiffness, rel=2e-3)
    assert (tmp_path / "probes.csv").read_text().startswith("time (s),middle x (rad),")
    assert re.search(
        r"probe middle +rotation magnitude: largest [\d.e-]+ rad", capsys.readouterr().out
    )


@pytest.mark.parametrize(
    ("old", "new", "held"),
    [
        ('a = ["first"', 'a = ["frist"', "'first'"),
        ("[at.second]", "[at.secnd]", "'second'"),
        ('"Section.rectangle"', '"Section.rectangel"', "'Section.rectangle'"),
        ("[at.second]", "[material]\n[at.second]", "parts.NAME"),
        ("near = [[0, 0, 0], 1e-6]", "near = [[0, 0, 0]]", "1 entries"),
        ("[[parts.first.supports]]", "[[parts.first.suports]]", "[supports]"),
        ("point = [1.0, 0, 0]\npart", 'point = "second:rihgt"\npart', "'right'"),
        ("[parts.first.material]", "[parts.first.material.bar]", "the group"),
    ],
)
def test_mistakes_in_an_assembly(tmp_path, capsys, old, new, held):
    pytest.importorskip("dolfinx")
    path = written(tmp_path, BARS.replace(old, new, 1))
    assert antiosc("check", path) == 1
    told = capsys.readouterr().err.splitlines()
    line = BARS[: BARS.index(old)].count("\n") + 1
    assert any(text.startswith(f"{path}:{line}: ") and held in text for text in told), told


def violations(value, rule, place="scene") -> list[str]:
    """What of a value breaks a schema; the words of JSON Schema that ours has."""
    unknown = set(rule) - {
        *("type", "properties", "required", "additionalProperties", "items", "prefixItems"),
        *("anyOf", "enum", "const", "pattern", "minItems", "description", "default", "title"),
        "$schema",
    }
    assert not unknown
    found = []
    if "anyOf" in rule and all(violations(value, one) for one in rule["anyOf"]):
        found.append(f"{place} fits nothing")
    kinds = {"object": dict, "array": list, "string": str, "number": (int, float), "integer": int}
    kinds["boolean"] = bool
    named = rule.get("type", [])
    named = [named] if isinstance(named, str) else named
    if named and not any(isinstance(value, kinds[name]) for name in named):
        return [f"{place} is no {named}"]
    if value not in rule.get("enum", [value]) or value != rule.get("const", value):
        found.append(f"{place} is {value!r}")
    if "pattern" in rule and not re.search(rule["pattern"], value):
        found.append(f"{place} is {value!r}")
    if isinstance(value, dict):
        known = rule.get("properties", {})
        found += [f"{place} lacks {name}" for name in rule.get("required", ()) if name not in value]
        for key, each in value.items():
            more = rule.get("additionalProperties", True)
            if key in known:
                found += violations(each, known[key], f"{place}.{key}")
            elif more is False:
                found.append(f"{place} has {key}")
            elif isinstance(more, dict):
                found += violations(each, more, f"{place}.{key}")
    if isinstance(value, list):
        first = rule.get("prefixItems", [])
        if len(value) < rule.get("minItems", 0):
            found.append(f"{place} is short")
        for i, each in enumerate(value):
            one = first[i] if i < len(first) else rule.get("items", {})
            found += violations(each, one, f"{place}[{i}]")
    return found


@pytest.mark.slow
def test_sound_scenes_keep_the_schema_and_wrong_ones_break_it():
    pytest.importorskip("dolfinx")
    rule = schema()
    texts = [BEAM + SWEEP, FRAME, BARS]
    texts += [path.read_text() for path in sorted(SCENES.glob("*.toml"))]
    for text in texts:
        assert violations(tomllib.loads(text), rule) == []
    for old, new in {
        "stiffness = 5e8": 'stiffness = "5e8"',
        "[extract]": "[extrakt]",
        "mass = 0.05": "radius = 0.05",
        'kind = "Hertz"': 'kind = "Herz"',
        "duration = 2e-3": "",
        "n = 6": "n = 6.5",
    }.items():
        assert old in BEAM
        assert violations(tomllib.loads(BEAM.replace(old, new)), rule)


@pytest.mark.slow
def test_a_map_of_both_parts_and_a_probe_of_a_group(tmp_path, capsys):
    """`antiosc map` tells the hardest blow on each part; `run` the motion of "second:right"."""
    pytest.importorskip("dolfinx")
    several = '[map]\nwhere = ["first", "second"]\ndirection = [0, 0, -1]\nn = 3\nmodes = 8\n'
    end = '[probes.end]\npoint = "second:right"\n[probes.middle]'
    path = written(tmp_path, BARS.replace("[probes.middle]", several + end))
    assert antiosc("map", path, "--out", tmp_path, "--report", tmp_path / "map.html") == 0
    told = capsys.readouterr().out
    table = (tmp_path / "map.csv").read_text().splitlines()
    names = [row.split(",")[0] for row in table[1:]]
    assert table[0].startswith("surface,x (m),")
    force = table[0].split(",").index("peak_force (N)")
    for name in ("first", "second"):
        forces = [float(row.split(",")[force]) for row in table[1:] if row.startswith(name)]
        hardest = engineering(max(forces), "N", 4)
        assert f"{names.count(name)} sites, at most {hardest} at (" in told
    page = (tmp_path / "map.html").read_text()
    assert "at most" in page
    assert re.findall("<h3>(.*?)</h3>", page) == [f"Map: {name}" for name in MAPPED]
    assert numbers(tmp_path)["map"]["surface"] == names
    assert antiosc("run", path, "--out", tmp_path) == 0
    end = np.loadtxt(tmp_path / "probes.csv", delimiter=",", skiprows=1)[:, :4]
    struck = np.genfromtxt(tmp_path / "history.csv", delimiter=",", names=True)
    own = struck[next(name for name in struck.dtype.names if name.startswith("displacement"))]
    assert np.diff(end[:, 0]).max() <= 1.001e-3 * end[-1, 0]  # flights too
    end = end[np.isin(end[:, 0], struck["time_s"])]
    np.testing.assert_allclose(-end[:, 3], own, atol=1e-6 * np.abs(own).max())
