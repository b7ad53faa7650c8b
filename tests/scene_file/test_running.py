"""Scenes that run, are swept or exported: the numbers of the program that is printed, and files."""

from __future__ import annotations

import pickle
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import StateSpace, lsim

import antiosc as ao
from antiosc.base.texts import engineering, percent
from antiosc_app.scene_file.compiled import compile_document
from antiosc_app.scene_file.document import read_document
from antiosc_app.scene_file.schema import SECTIONS
from fmus import OK, Fmu
from paths import MESHES
from scene_files import (
    BEAM,
    BRACKET,
    FRAME,
    HIT,
    LAW,
    MASS,
    MATERIAL,
    MATRICES,
    PROBE,
    SCENES,
    STRIKE,
    SWEEP,
    antiosc,
    numbers,
    objects,
    table,
    written,
)

#: Of a probe of a force that has no bar.
NO_BAR = " no error bar"


def test_a_scene_runs_as_its_program(tmp_path, capsys):
    path = written(tmp_path, BEAM + PROBE)
    assert antiosc("run", path, "--out", tmp_path / "out") == 0
    told = capsys.readouterr().out
    found = objects(path)
    hit = found.history
    assert engineering(hit.peak_force, "N") in told
    assert found.structure.describe() in told
    result = numbers(tmp_path / "out")["result"]
    assert result["peak_force"] == hit.peak_force
    assert result["restitution"] == hit.restitution
    columns = table(tmp_path / "out/history.csv")
    assert np.array_equal(columns["time (s)"], hit.time)
    assert np.array_equal(columns["force (N)"], hit.force)
    probes = table(tmp_path / "out/probes.csv")
    assert np.array_equal(probes["quarter z (m)"], found.probes["quarter"][:, 2])
    assert np.abs(probes["quarter z (m)"]).max() > 0
    half = found.model.truncated(found.model.n // 2)
    other = ao.simulate(half, found.impactor, hit.law, float(hit.time[-1]))
    asked = found.compiled.probes["quarter"].arguments
    signal = found.probes["quarter"]
    times = probes["time (s)"]
    off = signal - ao.probe(found.structure, other, asked["point"], "displacement", times)
    told_of = numbers(tmp_path / "out")["probes"]["quarter"]
    expected = np.linalg.norm(off, axis=1).max() / np.linalg.norm(signal, axis=1).max()
    assert told_of["truncation"] == pytest.approx(expected, rel=1e-2)
    assert f"{NO_BAR} (anti-oscillators {percent(told_of['truncation'])})" in told
    assert told_of["error"] is told_of["force"] is None  # of a model without error = "estimate"


@pytest.mark.slow
def test_the_shock_spectrum_of_a_probe_is_that_of_oscillators_on_its_point(tmp_path, capsys):
    """Oscillators on a base that has the displacement of the point, integrated by lsim."""
    text = f'{BEAM.replace("2e-3", "3e-3")}{PROBE}quantity = "acceleration"\nsrs = [345, 1e6]\n'
    path = written(tmp_path, text + '[output]\nplot = "svg"\n')
    page = tmp_path / "a.html"
    assert antiosc("run", path, "--out", tmp_path / "out", "--report", page) == 0
    told = capsys.readouterr().out
    made = objects(path)
    t = np.linspace(0, 3e-3, 2001)
    moved = ao.probe(made.structure, made.history, (0.2, 0.0, 0.0), "displacement", t)[:, 2]
    columns = table(tmp_path / "out/srs.csv")
    frequencies, found = columns["frequency (Hz)"], columns["quarter z (m/s²)"]
    known = ao.resolved_frequency(made.model)
    assert frequencies[-1] == pytest.approx(known)
    speeds = np.gradient(moved, t)
    after = t[1] * np.arange(1, 4 * t.size)  # in which the point moves on at its last speed
    base = np.append(moved, moved[-1] + speeds[-1] * after)
    inputs = np.column_stack([base, np.append(speeds, np.full(after.size, speeds[-1]))])

    def largest(frequency):
        w = 2 * np.pi * frequency
        spring = np.array([[w * w, w / 10]])
        mass = StateSpace([[0, 1], *-spring], [[0, 0], *spring], -spring, spring)
        _, accelerations, _ = lsim(mass, inputs, np.append(t, t[-1] + after))
        return np.abs(accelerations).max()

    for k in np.searchsorted(frequencies, [100.0, 300.0, 700.0]):
        assert found[k] == pytest.approx(largest(frequencies[k]), rel=0.01)
    k = int(np.argmax(found))
    numbers_told = numbers(tmp_path / "out")["probes"]["quarter"]["srs"]
    assert (numbers_told["value"], numbers_told["frequency"]) == (found[k], frequencies[k])
    assert numbers_told["component"] == "z"
    at, beyond = numbers_told["at"]
    assert (at["component"], at["frequency"]) == ("z", 345)
    assert at["value"] == pytest.approx(largest(345.0), rel=0.01)
    assert beyond["value"] is None
    value = f"largest {engineering(found[k], 'm/s²', 4)} (no error bar)"
    assert f"shock response spectrum (Q = 10) z: {value}" in told
    assert f"Probe quarter: shock response spectrum (Q = 10) z: {value}" in page.read_text()
    assert (tmp_path / "out/srs.svg").stat().st_size > 0


@pytest.mark.fem
@pytest.mark.slow
def test_the_bar_of_a_probe_holds_that_of_the_force(tmp_path, capsys):
    """A deflection that follows the force is not known better than the force."""
    probe = '[probes.quarter]\npoint = [0.02, 0.04, 0.075]\nquantity = "von_mises"\nsnap = 0.1\n'
    path = written(tmp_path, f'{BRACKET}[extract]\nn = 24\nerror = "estimate"\n{HIT}{probe}')
    assert antiosc("run", path, "--out", tmp_path / "out") == 0
    told = capsys.readouterr().out
    made = numbers(tmp_path / "out")
    bar = made["result"]["error_budget"]["peak_force"]
    peak = made["probes"]["quarter"]
    causes = ("mesh", "time", "patch", "law")
    assert peak["force"] == pytest.approx(sum(bar[cause] or 0.0 for cause in causes))
    shares = peak["force"], peak["mesh"], peak["truncation"]
    assert peak["error"] == pytest.approx(sum(shares))
    assert peak["error"] >= bar["total"] - bar["truncation"] > 0
    assert f" ± {percent(peak['error'])} (anti-oscillators" in told


@pytest.mark.slow
def test_a_sweep_is_many_runs(tmp_path, capsys):
    path = written(tmp_path, BEAM + SWEEP)
    assert antiosc("sweep", path, "--out", tmp_path / "out") == 0
    columns = table(tmp_path / "out/sweep.csv")
    assert columns["impactor.velocity"].tolist() == [0.5, 1.0, 2.0]
    batch = objects(path, "sweep").batch
    assert np.array_equal(columns["peak force (N)"], batch.peak_force)
    first, _, last = batch.peak_force
    for velocity, duration, peak in ((0.5, 3e-3, first), (2.0, 2e-3, last)):
        single = BEAM.replace("velocity = 1.0", f"velocity = {velocity}")
        single = single.replace("duration = 2e-3", f"duration = {duration}")
        assert antiosc("run", written(tmp_path, single), "--out", tmp_path / "one") == 0
        assert numbers(tmp_path / "one")["result"]["peak_force"] == pytest.approx(peak, rel=2e-3)


@pytest.mark.fem
@pytest.mark.slow
def test_a_sweep_has_the_bars_of_its_runs_and_fails_with_one_of_them(tmp_path, capsys):
    """Each row has the bar of its run; a row without a result is told by the exit code."""
    ball = '[impactor]\nkind = "Sphere"\nradius = 0.01\nmaterial = "steel S235"\nvelocity = 1.0\n'
    law = '[contact]\nkind = "Hertz"\nstiffness = 5e9\n[simulate]\nduration = 1e-3\n'
    scene = f'{BRACKET}[extract]\nn = 8\nerror = "estimate"\n{ball}{law}'
    steps = "simulate.step = [1e-6, 1e-6, 1e-13]\n"  # the last takes more than a million
    path = written(tmp_path, f"{scene}[sweep]\nimpactor.velocity = [0.5, 1.0, 1.0]\n{steps}")
    report = tmp_path / "sweep.html"
    assert antiosc("sweep", path, "--out", tmp_path / "out", "--report", report) == 1
    page = report.read_text()
    assert '<th class="number">impactor.velocity</th>' in page
    assert "peak force (N)  ± without the law (%)" in capsys.readouterr().out
    columns = table(tmp_path / "out/sweep.csv")
    assert columns["status"].tolist() == [0, 0, 2]
    bars = columns["± without the law (%)"]
    assert np.isnan(bars).tolist() == [False, False, True]
    single = scene.replace("duration = 1e-3", "duration = 1e-3\nstep = 1e-6")
    hit = objects(written(tmp_path, single, "single.toml")).history
    assert bars[1] == pytest.approx(100 * hit.error_budget["peak_force"].numerical, rel=1e-6)
    assert bars[0] != pytest.approx(bars[1], rel=0.01)


@pytest.mark.slow
def test_a_sweep_of_structures_is_many_scenes(tmp_path):
    """Another site and another number of anti-oscillators: each as in a scene of its own."""
    swept = "[sweep]\nsites.middle.node = [9, 14]\nextract.n = [6, 3]\n"
    path = written(tmp_path, BEAM + swept)
    assert antiosc("sweep", path, "--out", tmp_path / "out") == 0
    columns = table(tmp_path / "out/sweep.csv")
    assert columns["sites.middle.node"].tolist() == [9, 14]
    batch = objects(path, "sweep").batch
    for k, (node, n) in enumerate(((9, 6), (14, 3))):
        single = BEAM.replace("node = 9", f"node = {node}").replace("n = 6", f"n = {n}")
        hit = objects(written(tmp_path, single)).history
        assert columns["peak force (N)"][k] == batch.peak_force[k]
        assert batch.peak_force[k] == pytest.approx(hit.peak_force, rel=2e-3)


@pytest.mark.parametrize(
    ("sweep", "held"),
    [
        ("extract.n = [6, -1]", "n"),
        ("extract.count = [6]", "'count'"),
        ("sites.middle.node = 3", "list"),
        ("sites = [3]", "lists"),
        ("sites.middle.node = [9, 'a']", "node"),
        ("sites.middle.node = [9]\nimpactor.mass = [0.1, 0.2]", "equally"),
        ("impactor.velocity = [1, 2]\ncontact.stiffness = [1e8]", "equally"),
        ("impactor.velocity = []", "1 to"),
        ("impactor.velocity = 2.0", "list"),
        ("impactor.velocity = [1.0, '2']", "number"),
        ("impactor.mass = [1.0, -2.0]", "kg"),
        ("impactor.speed = [1.0]", "'speed'"),
        ("material.E = [1e9]", "impactor"),
        ("simulate.method = ['exact']", "'method'"),
        ("", "list"),
    ],
)
def test_mistakes_of_a_sweep(tmp_path, capsys, sweep, held):
    assert antiosc("check", written(tmp_path, f"{BEAM}[sweep]\n{sweep}\n")) == 1
    (told,) = capsys.readouterr().err.splitlines()
    assert held in told
    assert int(re.search(r"scene.toml:(\d+):", told)[1]) > len(BEAM.splitlines())


def test_a_mistake_that_shows_in_the_run_has_its_line(tmp_path, capsys):
    path = written(tmp_path, BEAM.replace("node = 9", "node = 99"))
    assert antiosc("check", path) == 0  # the files are not read for it
    capsys.readouterr()
    assert antiosc("run", path, "--out", tmp_path / "out") == 1
    told = capsys.readouterr().err
    line = next(i for i, text in enumerate(path.read_text().splitlines(), 1) if "99" in text)
    assert told.startswith(f"{path}:")
    assert "99" in told
    assert abs(int(told[len(f"{path}:") :].split(":")[0]) - line) <= 4
    assert not list((tmp_path / "out").iterdir())


def test_files_go_only_where_they_are_asked_for(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = written(tmp_path, BEAM)
    assert antiosc("run", path.name) == 0
    assert sorted(tmp_path.iterdir()) == [path]
    path.write_text(BEAM + "[output]\ncsv = false\n")
    assert antiosc("run", path.name) == 0
    assert [p.name for p in (tmp_path / "scene_out").iterdir()] == ["result.json"]
    assert antiosc("run", path.name, "--out", path.name) == 1
    assert "cannot make the folder" in capsys.readouterr().err


LOADED = """\
[prestress]
gravity = [0, 0, -9.81]
force = { clamp = [0, 0, 0] }
spin = { axis = [0, 0, 1], omega = 20.0, about = [0.1, 0, 0] }
"""


@pytest.mark.slow
def test_a_scene_has_the_prestress_of_its_part(tmp_path):
    found = objects(written(tmp_path, BRACKET + LOADED + HIT))
    state = found.structure.prestress
    assert state.loads.spin == ao.Spin((0, 0, 1), 20.0, (0.1, 0, 0))
    assert found.model.info["structure"] == found.structure.describe()
    assert "spin of 20 rad/s, without Coriolis" in found.structure.describe()
    struck = objects(written(tmp_path, STRIKE + LOADED))
    assert struck.history.structure.prestress.loads.spin == state.loads.spin
    with pytest.raises(ao.AntioscError, match=r"\[prestress\] has no place beside \[drop\]"):
        objects(written(tmp_path, BRACKET + LOADED + "[drop]\nheight = 1.0\n"))


@pytest.mark.slow
def test_new_writes_a_scene_that_is_complete_or_absent(tmp_path, capsys):
    target = tmp_path / "first.toml"
    assert antiosc("new", target) == 0
    text = target.read_text()
    for name in SECTIONS:
        assert re.search(rf"\[+{name}\b", text) or name == "title", name
    assert antiosc("new", target) == 1
    assert "exists already" in capsys.readouterr().err
    assert target.read_text() == text
    assert {p.name for p in tmp_path.iterdir()} - {"first.png"} == {"first.toml", "first.geo"}
    assert antiosc("new", tmp_path / "none/first.toml") == 1


@pytest.mark.slow
@pytest.mark.fem
def test_what_a_new_scene_has_in_comments_is_right(tmp_path, capsys):
    """Its keys and values are taken when their # is removed."""
    target = tmp_path / "new.toml"
    assert antiosc("new", target, MESHES / "bracket.msh") == 0
    sections_and_keys = r"^# (?=\[+[a-z_.]+\]+( +#|$)|\w[\w.]* = )"
    text = re.sub(sections_and_keys, "", target.read_text(), flags=re.M)
    assert len(re.findall(r"^\w[\w.]* = ", text, re.M)) > 35
    text = re.sub(r"^(size|refine|unit) = .*", "", text, flags=re.M)  # not of this mesh
    text = text.replace('where = "top"', 'where = "eye"')
    head, _, tail = text.partition("\n[strike]\n")
    strike, _, rest = tail.partition("\n# A scene of several")
    simulated = written(tmp_path, head + rest)
    assert antiosc("check", simulated) == 0, capsys.readouterr().err
    start = head.index("[simulate]")
    extract = slice(head.index("[extract]"), head.index("# -- the impact"))
    struck = head[: extract.start] + head[extract.stop : start] + "[strike]\n" + strike
    assert antiosc("check", written(tmp_path, struck)) == 0, capsys.readouterr().err


def test_an_impactor_by_name(tmp_path, capsys):
    start, end = BEAM.index("[impactor]"), BEAM.index("[simulate]")
    hammer = """[impactor]
kind = "named_impactor"
name = "IK07"
[contact]
kind = "Hertz"
stiffness = 5e9
"""
    path = written(tmp_path, BEAM[:start].replace("n = 6", "n = 12") + hammer + BEAM[end:])
    assert antiosc("run", path, "--out", tmp_path) == 0
    found = objects(path)
    assert found.impactor.mass == 0.5
    assert numbers(tmp_path)["result"]["peak_force"] == found.history.peak_force
    assert antiosc("check", written(tmp_path, path.read_text().replace("IK07", "IK77"))) == 1
    (told,) = capsys.readouterr().err.splitlines()
    assert ":13: impactor: name must be 'IK01'" in told


def test_a_sweep_of_impactors_and_laws_pairs_them(tmp_path):
    start, end = BEAM.index("[impactor]"), BEAM.index("[simulate]")
    ball = '[impactor]\nkind = "Sphere"\nradius = 0.01\nE = 210e9\nnu = 0.3\nrho = 7850\n'
    law = 'velocity = 1.0\n[contact]\nkind = "Hertz"\nstiffness = 1e9\n'
    scene = BEAM[:start] + ball + law + BEAM[end:]
    lists = "[sweep]\nimpactor.radius = [0.01, 0.02]\ncontact.stiffness = [1e9, 2e9]\n"
    batch = objects(written(tmp_path, scene + lists), "sweep").batch
    single = scene.replace("radius = 0.01", "radius = 0.02").replace("= 1e9", "= 2e9")
    own = objects(written(tmp_path, single, "single.toml")).history
    assert own.peak_force == pytest.approx(batch.peak_force[1], rel=2e-3)


def test_the_program_is_the_api_as_users_write_it(tmp_path):
    hit = objects(written(tmp_path, BEAM)).history
    part = ao.Structure.from_files(
        f"{SCENES}/beam_K.mtx", f"{SCENES}/beam_M.mtx", map=f"{SCENES}/beam_nodes.txt"
    )
    model = ao.extract(part, ao.Site(node=9, dof="z"), n=6)
    own = ao.simulate(model, ao.RigidMass(0.05, 1.0), ao.Hertz(5e8), 2e-3)
    assert np.array_equal(hit.force, own.force)
    # closed form: k0 = 48 E I / L³ of a simply supported beam at its middle
    assert model.k0 == pytest.approx(48 * 210e9 * 0.03 * 0.01**3 / 12 / 0.8**3, rel=1e-3)


def test_a_model_that_was_saved_is_struck_again(tmp_path, capsys):
    first = written(tmp_path, BEAM + "[output]\nmodel = true\n")
    assert antiosc("run", first, "--out", tmp_path / "out") == 0
    start = BEAM.index("[impactor]")
    again = written(tmp_path, '[model]\npath = "out/model.npz"\n' + BEAM[start:], "again.toml")
    assert antiosc("run", again, "--out", tmp_path / "again") == 0
    peaks = [numbers(tmp_path / name)["result"]["peak_force"] for name in ("out", "again")]
    assert peaks[0] == pytest.approx(peaks[1], rel=1e-12)


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


STRIKE_PLATE = f"""\
[geometry]
source = "plate.geo"
gdim = 2
{MATERIAL.format("material")}plane = "stress"
thickness = 0.01
[[supports]]
where = "left"
[sites.tip]
point = [0.15, 0.05]
direction = [0, -1]
radius = 0.02
{MASS}[contact]
kind = "Linear"
stiffness = 1e7
[strike]
duration = 1e-3
tol = 0.2
[probes.tip]
point = [0.15, 0.05]
[probes.root]
point = [0.02, 0.049]
quantity = "stress"
"""


PLATE = """\
SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 0.2, 0.05};
Physical Surface("plate") = {1};
Physical Curve("left") = {4};
"""


@pytest.mark.slow
@pytest.mark.fem
def test_a_strike_takes_what_the_scene_says(tmp_path, capsys):
    """Its mesh is chosen where nothing but a mesh says what is struck; else the structure is."""

    def struck(text: str) -> dict:
        found = compile_document(read_document(written(tmp_path, text))).history
        assert found.name == "strike"
        return found.arguments

    assert struck(STRIKE)["source"].name == "Structure"
    meshed = STRIKE.replace("order = 1\n", "").replace("[structure]\n", "")
    assert antiosc("run", written(tmp_path, meshed.replace('"clamp"', '"klamp"'))) == 1
    assert "'clamp'" in capsys.readouterr().err
    given = struck(meshed)
    assert given["source"] == f"{MESHES}/bracket.msh"
    assert given["material"].name == "Solid"
    assert [one.arguments["where"] for one in given["supports"]] == ["clamp"]
    assert antiosc("check", written(tmp_path, f"{STRIKE}[simulate]\nduration = 1e-3\n")) == 1
    assert "[simulate] has no place beside [strike]" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.fem
def test_probes_of_a_strike_are_those_of_its_last_mesh(tmp_path, capsys):
    (tmp_path / "plate.geo").write_text(PLATE)
    path = written(tmp_path, STRIKE_PLATE)
    assert antiosc("run", path, "--out", tmp_path / "out") == 0
    capsys.readouterr()
    found = objects(path)
    hit, probes = found.history, found.probes
    assert hit.structure.dofs == hit.model.info["strike"][-1]["dofs"]
    rows = table(tmp_path / "out" / "probes.csv")
    site = -probes["tip"][np.isin(rows["time (s)"], hit.time), 1]  # one point of the patch
    assert np.abs(site - hit.displacement).max() < 0.05 * np.abs(hit.displacement).max()
    np.testing.assert_array_equal(rows["root xx (Pa)"], probes["root"][:, 0, 0])
    assert pickle.loads(pickle.dumps(hit)).structure is None


SHEET = """\
[geometry]
source = "sheet.geo"
size = 0.06
gdim = 3
[material]
kind = "Shell"
E = 210e9
nu = 0.3
rho = 7850
thickness = 0.8e-3
[[supports]]
where = "rim"
[sites.off]
point = [0.12, 0.1, 0.0]
direction = [0, 0, -1]
[extract]
n = 12
"""
RECTANGLE = """\
SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 0.3, 0.2};
Physical Surface("sheet") = {1};
Physical Curve("rim") = {1, 2, 3, 4};
"""
BLOW = """\
[impactor]
kind = "RigidMass"
mass = 0.2
velocity = 1.5
[contact]
kind = "Hertz"
stiffness = 2e6
[simulate]
duration = 1e-2
"""
SCENE_OF_BLOW = """\
[bodies.ball]
kind = "RigidMass"
mass = 0.2
velocity = 1.5
[[contacts]]
a = "structure:off"
b = "ball"
law = {kind = "Hertz", stiffness = 2e6}
[run]
duration = 1e-2
"""


@pytest.mark.fem
@pytest.mark.slow
def test_a_scene_chooses_second_order_forces_itself(tmp_path):
    """Its answer is that of a program that asks for them, with one body and with several."""
    (tmp_path / "sheet.geo").write_text(RECTANGLE)
    found = objects(written(tmp_path, SHEET + BLOW), "run")
    assert not any("deflects by" in one for one in found.warnings)
    assert found.model.stretch is not None
    site = ao.Site((0.12, 0.1, 0.0), (0, 0, -1))
    model = ao.extract(found.structure, site, n=12, stretch="auto")
    law = ao.Hertz(2e6)
    hit = ao.simulate(model, ao.RigidMass(0.2, velocity=1.5), law, 1e-2)
    assert found.history.peak_force == pytest.approx(hit.peak_force, rel=1e-9)
    linear = objects(written(tmp_path, f"{SHEET}stretch = false\n{BLOW}"), "run")
    assert linear.history.peak_force < 0.9 * hit.peak_force
    assert any("deflects by" in one for one in linear.warnings)
    stepped = objects(written(tmp_path, f"{SHEET}{BLOW}step = 1e-4\n"), "run")
    assert stepped.history.peak_force == pytest.approx(linear.history.peak_force, rel=0.01)
    assert any("deflects by" in one for one in stepped.warnings)  # such a run is linear
    many = objects(written(tmp_path, SHEET + SCENE_OF_BLOW), "run")
    assert many.history.peak_force == pytest.approx(hit.peak_force, rel=2e-3)
    sweep = "[sweep]\nimpactor.velocity = [0.001, 1.5]\n"
    swept = objects(written(tmp_path, SHEET + BLOW + sweep), "sweep").batch
    assert swept.peak_force[1] == pytest.approx(hit.peak_force, rel=1e-6)
    flat = replace(model, stretch=None)
    alone = ao.simulate_many(flat, ao.RigidMass(0.2, velocity=1e-3), law, 1e-2)
    assert swept.peak_force[0] == alone.peak_force[0]
    slow = BLOW.replace("velocity = 1.5", "velocity = 0.01")
    small = objects(written(tmp_path, SHEET + slow), "run")
    assert not small.history.assembly.stretch_forces
    assert small.model.stretch is None


@pytest.mark.slow
@pytest.mark.fem
def test_a_scene_holds_a_side_of_a_geometry(tmp_path, capsys):
    ball = 'velocity = 1\nmaterial = "bearing steel 100Cr6"\n'
    (tmp_path / "ball.geo").write_text(
        'SetFactory("OpenCASCADE"); Sphere(1) = {0, 0, 0, 0.05, -0.5};'
    )
    (tmp_path / "a.toml").write_text(
        '[geometry]\nsource = "ball.geo"\nsize = 0.02\n[material]\nname = "steel S235"\n'
        '[[supports]]\nwhere = "SIDE"\n[sites.top]\npoint = [0, 0, 0.05]\n'
        "direction = [0, 0, -1]\nradius = 0.02\nsnap = true\n[extract]\nn = 4\n"
        f'[impactor]\nkind = "Sphere"\nradius = 0.01\n{ball}[simulate]\nduration = 1e-4\n'
    )
    text = (tmp_path / "a.toml").read_text()
    for side, code in (("-z", 0), ("+z", 1)):
        (tmp_path / "a.toml").write_text(text.replace("SIDE", side))
        assert antiosc("check", tmp_path / "a.toml") == 0
        assert antiosc("run", tmp_path / "a.toml", "--out", tmp_path / "o") == code
    assert "none lies at z = 0.05 m" in capsys.readouterr().err
