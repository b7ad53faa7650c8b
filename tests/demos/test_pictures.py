"""The demos' pictures of histories and studies, drawn from small impacts."""

from __future__ import annotations

import matplotlib.image
import numpy as np
import pytest

import antiosc as ao
from paths import DEMOS, demo
from scenes import HERTZ, case_two

pytestmark = [pytest.mark.fem, pytest.mark.slow]


@pytest.fixture(scope="module")
def hits() -> list[ao.History]:
    return [ao.simulate(*case_two(n), ao.Hertz(HERTZ), 3e-3) for n in (1, 3)]


def drawn(path) -> bool:
    """Whether a picture has more than its background, and no empty quarter."""
    ink = matplotlib.image.imread(path)[..., :3].min(axis=2) < 0.9
    rows, columns = (size // 2 for size in ink.shape)
    quarters = [ink[a : a + rows, b : b + columns] for a in (0, rows) for b in (0, columns)]
    return min(np.mean(quarter) for quarter in quarters) > 0.005


def test_comparisons_of_histories(tmp_path, hits):
    one, other = hits
    path = tmp_path / "picture.png"
    sites = demo("stiffened_panel").SITES
    demo("stiffened_panel").plot({(n, s): one for s in sites for n in ("shells", "beams")}, path)
    assert drawn(path)
    demo("composite_panel").plot({"aluminium": one, "carbon": other}, path)
    assert drawn(path)
    demo("fidelity").plot({"strut": {"beam": one, "solid": other}, "strip": {"solid": one}}, path)
    assert drawn(path)
    plate = demo("plate_impact")
    plate.plot(plate.Scene(0.3, 2e-3, 0.1), hits, (3.0, 8.0), {0.3: [0.5, 0.6]}, path)
    assert drawn(path)


def test_studies(tmp_path):
    path = tmp_path / "picture.png"
    module = demo("work_precision")
    methods = [*module.SCENE_STEPS, *module.SOLVE_IVP]
    rows = [
        {"scene": s, "method": m, "seconds": t, "evaluations": 1e3 * t, "error": 1e-2 / t / (k + 1)}
        for s in ("first", "second")
        for k, m in enumerate(methods)
        for t in (0.1, 1.0, 10.0)
    ]
    module.chart(rows, path)
    assert drawn(path)


def test_errors_against_seconds(tmp_path):
    module = demo("speed_tables")
    rows = [
        {"method": m, "total": t * (k + 1), "n": int(10 * t), "error force": e, "error Z": e}
        for k, m in enumerate(module.STYLE)
        for t, e in ((1.0, 1e-1), (2.0, 1e-2), (4.0, 1e-3 * (k != 3)))
    ]
    module.plot({"case": "a bar, small", "dofs": 12, "rows": rows}, tmp_path)
    assert drawn(tmp_path / "speed_accuracy_a_bar_small_12.png")


def test_no_demo_has_a_plotting_library_of_its_own():
    own = [p.name for p in DEMOS.glob("*.py") if "pyplot" in p.read_text(encoding="utf-8")]
    assert own == []
