"""Exported runs against `simulate`, closed forms and the model's dynamic stiffness."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

import antiosc as ao
import stretched
from antiosc import closed_form
from fmus import ERROR, OK, Fmu

DURATION = 2e-3
BALL = ao.RigidMass(mass=0.05, velocity=1.0)
LAW = ao.Hertz(1.55e10)
YIELDS = ao.ElasticPlastic(1e11, 0.01, 2e8, elastic_share=0.3)
VERSIONS = pytest.mark.parametrize("fmi", [2, 3])


@pytest.fixture(scope="module")
def model():
    beam = closed_form.UniformBeam.timoshenko(
        E=206e9, nu=0.3, rho=7833.0, area=1e-4, inertia=1e-8 / 12, length=0.4
    )
    return closed_form.pinned_pinned(beam).anti_oscillators(8)


@pytest.fixture(scope="module")
def hit(model):
    return ao.simulate(model, BALL, LAW, duration=DURATION, tol=1e-7)


@pytest.fixture
def struck(model, tmp_path, fmi):
    """The FMU of the impact."""
    ao.export(tmp_path / "blow.fmu", model, BALL, LAW, duration=DURATION, tol=1e-6, fmi=fmi)
    return Fmu(tmp_path / "blow.fmu", tmp_path / "unpacked")


@pytest.mark.sample(-1)
@VERSIONS
@pytest.mark.parametrize("steps", [1, 40, 1000])
def test_an_fmu_gives_the_impact_at_any_communication_step(struck, hit, steps):
    run = struck.instance()
    assert run.begin() == OK
    names = ["peak_force", "impulse", "displacement", "impactor_displacement", "force"]
    rows = np.array(run.run(DURATION, steps, names))
    expected = [hit.peak_force, hit.impulse, hit.displacement[-1], hit.impactor_displacement[-1]]
    assert rows[-1, :4] == pytest.approx(expected, rel=1e-6)
    moments = DURATION * np.arange(1, steps + 1) / steps
    at = np.searchsorted(hit.time, moments) // 2 * 2  # the parabola of the step
    at = np.clip(at, 0, hit.time.size - 3)
    u = (moments - hit.time[at]) / np.maximum(hit.time[at + 2] - hit.time[at], 1e-300)
    f0, f1, f2 = (hit.force[at + k] for k in range(3))
    force = f0 + u * (4 * f1 - 3 * f0 - f2 + 2 * u * (f0 - 2 * f1 + f2))
    if steps == 1000:
        assert np.linalg.norm(rows[:, 4] - force) <= 1e-5 * np.linalg.norm(force)


@VERSIONS
def test_resets_and_two_instances_and_that_states_are_not_kept(struck):
    one, two = struck.instance(), struck.instance()
    assert one.begin() == two.begin(start=5.0, initial_velocity=0.5) == OK
    assert two.step(5.0, 1e-4) == OK
    assert one.step(0.0, 1e-4) == OK
    assert one.step(1e-4, 4e-4) == OK
    late = one.get("force", "displacement")
    assert one.call("Reset") == OK
    assert one.begin() == OK
    assert one.step(0.0, 5e-4) == OK
    assert one.get("force", "displacement") == pytest.approx(late, rel=1e-12)
    assert one.keep_state() == ERROR


@VERSIONS
def test_the_initial_velocity_is_a_parameter(model, struck):
    run = struck.instance()
    assert run.begin(initial_velocity=0.3) == OK
    assert run.step(0.0, DURATION) == OK
    (peak,) = run.get("peak_force")
    slower = ao.simulate(model, ao.RigidMass(0.05, 0.3), LAW, duration=DURATION, tol=1e-7)
    assert peak == pytest.approx(slower.peak_force, rel=1e-5)


@VERSIONS
def test_calls_in_a_wrong_order_are_errors(struck):
    assert struck.instance(token="another").handle is None
    run = struck.instance()
    for call in ("ExitInitializationMode", "Terminate"):
        assert run.call(call) == ERROR
    assert run.step(0.0, 1e-4) == ERROR
    assert run.begin() == OK
    assert run.call("EnterInitializationMode", *[0] * 5) == ERROR
    assert run.set("force", 1.0) == ERROR
    assert run.set("initial_velocity", 1.0) == ERROR
    for at, h in [
        (0.0, -1e-4),
        (0.0, 0.0),
        (1.0, 1e-4),
        (0.0, np.nan),
        (np.nan, 1e-4),
        (0.0, np.inf),
    ]:
        assert run.step(at, h) == ERROR
    assert run.step(0.0, 1e-4) == OK
    assert run.call("Terminate") == OK
    assert run.step(1e-4, 1e-4) == ERROR
    assert run.said
    run._function("FreeInstance", None)(None)


@VERSIONS
@pytest.mark.parametrize("damage", ["cut", "longer", "counts", "number", "missing"])
def test_a_damaged_model_file_is_refused(struck, damage):
    file = struck.folder / "resources" / "model.aom"
    content = bytearray(file.read_bytes())
    if damage == "counts":
        content[8:12] = (10**6).to_bytes(4, "little")
    if damage == "number":
        content[len(content) // 2] ^= 0x40
    file.write_bytes({"cut": content[:-8], "longer": content + b"0"}.get(damage, content))
    if damage == "missing":
        file.unlink()
    run = struck.instance()
    assert run.handle is None
    assert run.said


def nasty_scene(model):
    """Names that end a comment, that are equal when they are joined, and equal as words of C."""
    ends = "*/ int opened(void) { return 1; } /*"
    bodies = {"a": model, "b,c": BALL, "a,b": model, "c": BALL, ends: BALL, "b c": BALL}
    pairs = [("a", "b,c"), ("a,b", "c"), ("a", ends), ("a,b", "b c")]
    return ao.Scene(bodies, [ao.Contact(a, b, LAW) for a, b in pairs])


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
def test_a_c_file_is_what_it_says_whatever_the_names(model, tmp_path):
    ao.export(tmp_path / "blow1.c", nasty_scene(model), duration=1e-4)
    ao.export(tmp_path / "blow2.c", nasty_scene(model), duration=1e-4)
    uses = {
        f"use{k}.c": f'#include "blow{k}.c"\nint use{k}(void) {{ return !!axm_size(&blow{k}); }}\n'
        for k in (1, 2)
    }
    uses["main.c"] = "int use1(void), use2(void), opened = 3;\n"
    uses["main.c"] += "int main(void) { return use1() + use2() + opened; }\n"
    for name, text in uses.items():
        (tmp_path / name).write_text(text)
    build = ["cc", "-std=c99", "-pedantic", "-Wall", "-Werror", *uses, "-o", "both", "-lm"]
    subprocess.run(build, cwd=tmp_path, check=True)
    assert subprocess.run([tmp_path / "both"], check=False).returncode == 5
    text = (tmp_path / "blow1.c").read_text()
    assert "aom_batch_solve(" not in text
    for flag in ("-ffast-math", "-ffinite-math-only"):
        refused = subprocess.run(
            ["cc", flag, "-c", "blow1.c"], cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert "infinity" in refused.stderr


@pytest.mark.parametrize("name", ["a\nb", "a\x1b[2J", "\ud800", "n" * 300, "", 3])
def test_a_name_is_checked_where_it_enters(model, name):
    for enter in (
        lambda: ao.Scene({name: model, "ball": BALL}, [ao.Contact("ball", "ball:a", LAW)]),
        lambda: ao.Contact(name, "ball", LAW),
        lambda: ao.Load(name, [0.0, 1.0], [0.0, 1.0]),
        lambda: ao.RigidBody(1.0, np.eye(3), sites={name: ([0, 0, 0], [0, 0, 1])}),
        lambda: ao.SiteModes([1.0, 2.0], np.ones((2, 1)), sites=[name], r=[[1e-9]]),
    ):
        with pytest.raises(ao.InputError, match=r"name|end"):
            enter()


@VERSIONS
def test_a_port_answers_a_constant_force_as_its_modes_do(model, tmp_path, fmi):
    ao.export(tmp_path / "port.fmu", model, fmi=fmi)
    run = Fmu(tmp_path / "port.fmu", tmp_path / "unpacked").instance()
    assert run.begin(force=7.0) == OK
    modes = model.modal()
    t = 3e-4
    rows = run.run(t, 3, ["displacement", "velocity"])
    w, b = modes.omega, modes.b
    moved = 7.0 * (np.sum((b / w) ** 2 * (1 - np.cos(w * t))) + modes.r)
    speed = 7.0 * np.sum(b**2 / w * np.sin(w * t))
    assert rows[-1] == pytest.approx([moved, speed], rel=1e-10)


@pytest.mark.slow
@VERSIONS
def test_a_sheet_that_stretches_goes_with_its_tensors(tmp_path, fmi):
    sheet = stretched.model(3)
    ball, law, end = ao.RigidMass(0.3, velocity=1.0), ao.Power(5e8, 1.5), 4e-3
    ao.export(tmp_path / "sheet.fmu", sheet, ball, law, duration=end, tol=1e-9, fmi=fmi)
    run = Fmu(tmp_path / "sheet.fmu", tmp_path / "unpacked").instance()
    assert run.begin() == OK
    names = ["peak_force", "impulse", "displacement"]
    found = run.run(end, 7, names)[-1]
    hit = ao.simulate(sheet, ball, law, end, tol=1e-9)
    assert found == pytest.approx([hit.peak_force, hit.impulse, hit.displacement[-1]], rel=1e-9)
    linear = ao.simulate(replace(sheet, stretch=None), ball, law, end)
    assert abs(hit.peak_force / linear.peak_force - 1) > 0.05
    with pytest.raises(ao.InputError, match="a model alone is linear"):
        ao.export(tmp_path / "port.fmu", sheet)


def test_a_scene_of_several_contacts(model, tmp_path):
    scene = ao.Scene(
        {"strip": model, "ball": BALL, "stop": ao.Obstacle()},
        [
            ao.Contact("strip", "ball", LAW),
            ao.Contact("stop", "strip", ao.HuntCrossley(1e8, 0.3), gap=1e-4),
        ],
    )
    ao.export(tmp_path / "scene.fmu", scene, duration=1e-3, tol=1e-6)
    run = Fmu(tmp_path / "scene.fmu", tmp_path / "unpacked").instance()
    assert run.begin() == OK
    names = ["strip,ball.peak_force", "stop,strip.impulse", "strip.displacement"]
    found = run.run(1e-3, 7, names)[-1]
    hit = scene.run(1e-3, tol=1e-6)
    expected = [
        hit["strip", "ball"].peak_force,
        hit["stop", "strip"].impulse,
        hit.bodies["strip"].displacement()[-1],
    ]
    assert found == pytest.approx(expected, rel=1e-5)


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
@pytest.mark.slow
@pytest.mark.parametrize(("law", "stretches"), [(LAW, False), (YIELDS, True)])
def test_the_c_file_is_the_same_run(model, tmp_path, law, stretches):
    model = stretched.model(3) if stretches else model
    ao.export(tmp_path / "blow.c", model, BALL, law, duration=DURATION, tol=1e-6)
    ao.export(tmp_path / "blow.fmu", model, BALL, law, duration=DURATION, tol=1e-6)
    strict = ["-std=c99", "-O1", "-Wall", "-Werror"]
    build = ["cc", *strict, "-DBLOW_MAIN", "-o", "blow", "blow.c", "-lm"]
    subprocess.run(build, cwd=tmp_path, check=True)
    table = subprocess.run([tmp_path / "blow"], capture_output=True, text=True, check=True)
    rows = np.array([line.split() for line in table.stdout.splitlines()], dtype=float)
    run = Fmu(tmp_path / "blow.fmu", tmp_path / "unpacked").instance()
    assert run.begin() == OK
    names = [name for name in run.fmu.variables if name not in ("time", "initial_velocity")]
    found = np.array(run.run(DURATION, 1000, names))
    size = np.abs(found).max(axis=0)
    assert np.abs(rows[1:, 1:] - found).max(axis=0) / size == pytest.approx(0.0, abs=1e-12)


OTHERS = [
    YIELDS, LAW, ao.Power(1.55e10, 1.6), ao.Gonthier(1.55e10, 0.7), ao.Linear(1e7),
    ao.Thornton(1.55e10, 1e-6), ao.YangSun(1.55e10, 1e-5),
    ao.Tabulated([0.0, 2e-6, 1e-4], [0.0, 40.0, 1e4], ([5e-5, 8e-5, 1e-4], [0.0, 2e3, 1e4])),
]  # fmt: skip


OF_HERTZ = [law for law in OTHERS if law.without(1e-9) is not law]


@pytest.mark.parametrize("law", OF_HERTZ, ids=lambda law: type(law).__name__)
def test_a_law_without_its_patch_is_saved_and_exported_as_it_runs(model, tmp_path, law):
    """What the patch takes is subtracted in a file of the model and in an FMU as in the run."""
    patched = replace(model, local_compliance=2e-9, radius=1e-3)
    patched.save(tmp_path / "model.npz")
    again = ao.AntiOscillators.load(tmp_path / "model.npz")
    hits = [ao.simulate(one, BALL, law, 3e-4, tol=1e-7) for one in (patched, again, model)]
    assert hits[0].peak_force == hits[1].peak_force
    assert hits[0].peak_force > 1.0005 * hits[2].peak_force  # the patch matters
    ao.export(tmp_path / "blow.fmu", again, BALL, law, duration=3e-4, tol=1e-6)
    run = Fmu(tmp_path / "blow.fmu", tmp_path / "unpacked").instance()
    assert run.begin() == OK
    found = run.run(3e-4, 20, ["peak_force", "impulse", "impactor_displacement"])[-1]
    wanted = [hits[0].peak_force, hits[0].impulse, hits[0].impactor_displacement[-1]]
    assert found == pytest.approx(wanted, rel=1e-5)


@VERSIONS
def test_a_contact_that_yields_is_exported_as_it_runs(model, tmp_path, fmi):
    """The dent with it: the ball parts from the bottom of the dent."""
    hit = ao.simulate(model, BALL, YIELDS, duration=DURATION, tol=1e-7)
    assert hit.peak_force > 10 * YIELDS.yield_force
    ao.export(tmp_path / "blow.fmu", model, BALL, YIELDS, duration=DURATION, tol=1e-6, fmi=fmi)
    run = Fmu(tmp_path / "blow.fmu", tmp_path / "unpacked").instance()
    assert run.begin() == OK
    names = ["peak_force", "impulse", "displacement", "impactor_displacement"]
    found = run.run(DURATION, 40, names)[-1]
    wanted = [hit.peak_force, hit.impulse, hit.displacement[-1], hit.impactor_displacement[-1]]
    assert found == pytest.approx(wanted, rel=1e-5)


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
@pytest.mark.parametrize("fmi", [2])  # of the fixture
def test_an_fmu_is_built_from_its_sources(struck, tmp_path):
    listed = [each.attrib["name"] for each in struck.description.iter("File")]
    folder = struck.folder / "sources"
    build = ["cc", "-std=c99", "-shared", "-fPIC", "-o", str(tmp_path / "own.so"), *listed, "-lm"]
    subprocess.run(build, cwd=folder, check=True)
    assert (tmp_path / "own.so").stat().st_size > 0


@pytest.mark.parametrize(
    ("name", "given", "word"),
    [
        ("x.txt", (BALL, LAW), "fmu"),
        ("x.fmu", (BALL,), "both"),
        ("x.xml", (BALL, LAW), "fmu"),
    ],
)
def test_what_cannot_be_exported_is_told_and_nothing_written(model, tmp_path, name, given, word):
    with pytest.raises(ao.InputError, match=word):
        ao.export(tmp_path / name, model, *given)
    assert not list(tmp_path.iterdir())
