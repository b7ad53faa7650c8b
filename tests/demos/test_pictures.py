"""The demos' pictures of histories and studies, drawn from small impacts."""

from __future__ import annotations

import matplotlib.image
import numpy as np
import pytest

import antiosc as ao
from paths import BENCHMARKS, DEMOS, demo
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
    demo("compared").plot_hits({"here": {"aluminium": one, "carbon": other}}, path)
    assert drawn(path)
    demo("fidelity").plot({"strut": {"beam": one, "solid": other}, "strip": {"solid": one}}, path)
    assert drawn(path)
    plate = demo("plate_impact")
    plate.plot(plate.Scene(0.3, 2e-3, 0.1), hits, (3.0, 8.0), {0.3: [0.5, 0.6]}, path)
    assert drawn(path)


def test_no_demo_has_a_plotting_library_of_its_own():
    scripts = [*DEMOS.glob("*.py"), *BENCHMARKS.glob("*.py")]
    own = [p.name for p in scripts if "pyplot" in p.read_text(encoding="utf-8")]
    assert own == []
