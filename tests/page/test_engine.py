"""The engine of the page: its numbers are those of `simulate`, and it is built of these sources."""

from __future__ import annotations

import json
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

import antiosc as ao
import stretched
from antiosc.base.texts import engineering
from antiosc.engine import library
from antiosc_app import live as assets
from laws import yield_speed

node = pytest.mark.skipif(shutil.which("node") is None, reason="no node, which runs WebAssembly")
MODEL = ao.AntiOscillators(m0=2e-3, k0=5e5, m=[0.05, 0.03, 0.01], omega=[2e3, 7e3, 1.9e4])
FREE = ao.AntiOscillators(m0=2e-3, k0=0.0, m=[0.05, 0.03, 0.01], omega=[2e3, 7e3, 1.9e4])
STRIKER, LAW = ao.RigidMass(0.2, 1.5), ao.Hertz(1e9)
YIELDS = ao.ElasticPlastic(1e10, 0.01, 5e7, elastic_share=0.4)
NAMES = ("peak_force", "impulse", "contact_time", "restitution")
PROGRAM = """
const fs = require("fs"), given = unpacked(fs.readFileSync(0, "utf8"));
Engine.load(fs.readFileSync(given.engine)).then((engine) => {
  const found = given.sets.map((set) => {
    const posed = pose(given.blow.body, given.blow, set);
    const hit = engine.strike(posed, given.blow.duration, given.tol);
    return { ...hit, posed: 0, time: 0, force: 0,
      q: Array.from(engine.state(hit, given.at).q), at: engine.state(hit, given.at).force };
  });
  process.stdout.write(JSON.stringify(found));
});
"""


def on_the_page(hit, sets, tol=1e-6, at=0.0):
    """The numbers of impacts on the page with other settings."""
    case = assets.impact_of_history(hit, None)
    own = {name: case[name] for name in ("mass", "speed", "stiffness", "gap")}
    own["damping"] = case["ratio"] or 0.0
    data = {"blow": case, "tol": tol, "at": at, "engine": str(assets.PAGE_FOLDER / "engine.wasm")}
    data["sets"] = [own | each for each in sets]
    names = ("units", "engine", "data")
    scripts = "".join((assets.PAGE_FOLDER / f"{name}.js").read_text() for name in names)
    done = subprocess.run(
        ["node", "-e", scripts + PROGRAM], input=assets.embedded_json(data), capture_output=True,
        text=True, check=True, timeout=60,
    )  # fmt: skip
    return json.loads(done.stdout)


def same(found, hit, rel=1e-9):
    for name in NAMES:
        wanted = getattr(hit, name)
        if wanted is None:
            assert found[name] is None
        else:
            assert found[name] == pytest.approx(wanted, rel=rel, abs=1e-15), name
    assert found["contacts"] == len(hit.contacts)


@pytest.mark.slow
@node
@pytest.mark.parametrize(
    ("model", "striker", "law", "options"),
    [
        (MODEL, STRIKER, LAW, {}),
        (FREE, STRIKER, ao.Linear(1e7), {"gap": 1e-4}),
        (replace(MODEL, damping=ao.Damping(0.02)), STRIKER, ao.HuntCrossley(1e9, 0.7), {}),
        (replace(MODEL, local_compliance=2e-8), STRIKER, LAW, {}),
        (MODEL, STRIKER, ao.Thornton(1e9, 1e-6), {}),
        (MODEL, STRIKER, YIELDS, {}),
        (replace(MODEL, local_compliance=2e-8), STRIKER, YIELDS, {}),
        (FREE, ao.Obstacle(), LAW, {"initial_velocity": 1.0}),
        (MODEL, ao.Impactor(FREE, 1.5), ao.Power(1e8, 1.3), {}),
        (stretched.model(3), STRIKER, ao.Power(5e8, 1.5), {}),
        (MODEL, STRIKER, ao.Tabulated([0, 1e-5, 1e-4, 1e-3], [0, 50, 1e3, 5e4]), {}),
    ],
)
def test_the_engine_gives_the_numbers_of_simulate(model, striker, law, options):
    hit = ao.simulate(model, striker, law, 3e-3, tol=1e-6, **options)
    at = 0.7 * hit.contact_time
    (found,) = on_the_page(hit, [{}], at=at)
    same(found, hit)
    q, _ = hit.states(np.array([at]))
    assert found["q"] == pytest.approx(q[0], rel=1e-8, abs=1e-9 * np.abs(q).max())
    assert found["at"] == pytest.approx(float(hit.force_at([at])[0]), rel=1e-8)


@pytest.mark.slow
@node
@pytest.mark.parametrize("model", [MODEL, replace(MODEL, local_compliance=1e-8)])
def test_sliders_through_yield_leave_the_dent_of_simulate(model):
    onset = yield_speed(YIELDS, 0.2)
    sets = [{"speed": v} for v in (0.3 * onset, 0.9 * onset, 3 * onset, 0.3, 1.5, 6.0)]
    hit = ao.simulate(model, STRIKER, YIELDS, 3e-3, tol=1e-6)
    found = on_the_page(hit, sets)
    for one, given in zip(found, sets, strict=True):
        other = ao.simulate(model, ao.RigidMass(0.2, given["speed"]), YIELDS, 3e-3, tol=1e-6)
        dent = 0.0 if other.dent is None else other.dent.depth
        assert one["dent"] == pytest.approx(dent, rel=1e-6, abs=1e-12)
    assert found[0]["dent"] == 0 < found[-1]["dent"]


def test_the_engine_is_built_of_these_sources():
    """If not: `make page`, and commit engine.wasm."""
    if not (library.SOURCE_FOLDER / "page").is_dir():
        pytest.skip("an installation without the C sources")
    assert library.source_hash(library.SOURCE_FOLDER).encode() in assets.engine_wasm()


def test_other_scenes_are_not_repeated():
    class Own(ao.Hertz):
        pass

    assert assets.impact_of_history(ao.simulate(MODEL, STRIKER, Own(1e9), 3e-3), None) is None
    damped = replace(MODEL, damping=ao.DampingMatrix(5.0 * np.eye(1 + MODEL.n)))
    assert assets.impact_of_history(ao.simulate(damped, STRIKER, ao.Hertz(1e9), 3e-3), None) is None


CASES = [
    (82.7e-6, "s", "82.7 µs"), (2204, "N", "2.20 kN"), (999.6, "N", "1.00 kN"),
    (0.0042, "kg", "4.20 g"),
    (12.5, "kg", "12.5 kg"), (2, "m/s", "2.00 m/s"), (0, "N", "0 N"), (float("nan"), "N", "–"),
    (1.55e10, "N/m^1.5", "15.5 GN/m^1.5"), (1.234e5, "1/s", "123000 1/s"),
    (-3.2e-9, "m", "-3.20 nm"), (0.61, "", "0.610"), (1224.0, "m/s²", "1220 m/s²"),
    (9.996e2, "m/s²", "1000 m/s²"), (3.2e6, "m/s²", "3.20e+06 m/s²"),
]  # fmt: skip


@pytest.mark.parametrize(("value", "unit", "shown"), CASES)
def test_engineering_notation(value, unit, shown):
    assert engineering(value, unit) == shown
