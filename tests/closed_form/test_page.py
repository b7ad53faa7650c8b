"""The page of the closed forms: its example runs as it stands, and it names all that is public."""

from __future__ import annotations

import re
import runpy

import numpy as np
import pytest

from paths import ROOT

PAGE = (ROOT / "docs" / "closed_forms.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_example_runs(tmp_path, capsys):
    (program,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    (tmp_path / "program.py").write_text(program, encoding="utf-8")
    names = runpy.run_path(str(tmp_path / "program.py"))
    assert "peak force" in capsys.readouterr().out
    # shear makes the plate softer, and an isotropic layer is Mindlin's plate
    assert 0.98 * names["thin"] < names["thick"] < names["thin"]
    assert names["same"] == pytest.approx(names["thick"], rel=1e-9)
    plate = names["plate"]
    assert names["under_patch"] == pytest.approx(plate.compliance(0.12, 0.08), rel=0.05)
    # Euler's beam, which shear and rotary inertia slow down the more the higher the mode
    beam, natural = names["beam"], names["natural"]
    euler = (np.arange(1, 5) * np.pi / beam.length) ** 2 * np.sqrt(beam.EI / beam.rhoA)
    assert np.all(np.diff(natural / euler) < 0)
    assert 0.9 < natural[0] / euler[0] < 1
    assert natural[-1] < beam.cutoff
    hit = names["hit"]
    assert hit.impulse == pytest.approx(0.1 * (1.0 - hit.impactor_velocity[-1]), rel=1e-6)
