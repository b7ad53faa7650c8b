"""The page of the assemblies: its example runs as it stands, and it names every joint."""

from __future__ import annotations

import re
import runpy

import numpy as np
import pytest

pytest.importorskip("dolfinx")

from paths import ROOT

pytestmark = pytest.mark.fem

PAGE = (ROOT / "docs" / "assemblies.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_example_runs(tmp_path, capsys):
    (program,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    (tmp_path / "program.py").write_text(program, encoding="utf-8")
    names = runpy.run_path(str(tmp_path / "program.py"))
    assert "peak force" in capsys.readouterr().out
    part, hit = names["part"], names["hit"]
    spacers = 4 * 1150.0 * 6e-3 * 6e-3 * 10e-3
    assert part.mass == pytest.approx(1900.0 * 1.6e-3 * 0.1 * 0.08 + spacers + 5e-3, rel=1e-12)
    assert hit.impulse == pytest.approx(2e-3 * (0.3 - hit.impactor_velocity[-1]), rel=1e-6)
    assert np.abs(names["deflection"][:, 2]).max() > 1e-6
