"""The program of docs/matrices.md runs as it stands there."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import antiosc as ao
from matrix_writers import matrix_market, spring_frame

PAGE = Path(__file__).parents[2] / "docs/matrices.md"


def test_the_program_of_the_page(tmp_path, monkeypatch, capsys):
    K, M, labels = spring_frame()
    matrix_market(tmp_path / "K.mtx", K)
    matrix_market(tmp_path / "M.mtx", M)
    points = np.column_stack([0.01 * labels[:, 0], np.zeros((len(K), 2))])
    rows = np.column_stack([labels, points])
    np.savetxt(tmp_path / "dofs.txt", rows, fmt=["%d", "%d", "%g", "%g", "%g"])
    monkeypatch.chdir(tmp_path)
    program = "\n".join(re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.S))
    found: dict = {}
    exec(compile(program, str(PAGE), "exec"), found)
    assert "given matrices, 5 nodes, 15 dofs" in capsys.readouterr().out
    struck = found["blow"]
    assert struck.impulse == pytest.approx(0.1 * (1.0 - struck.impactor_velocity[-1]), rel=1e-6)
    b = np.eye(len(K))[5]
    assert abs(found["model"].k0 * (b @ np.linalg.solve(K, b)) - 1) < 1e-9
    assert found["tip"].shape == (len(found["hit"].time), 3)
    again = ao.Structure.from_files("reduced.pch", "reduced.pch")
    read = ao.extract(again, ao.Site(node=20, dof="z"), n=3)
    assert read.k0 == pytest.approx(found["model"].k0, rel=1e-9)
