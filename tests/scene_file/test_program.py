"""Calls as data, and the entries of files."""

from __future__ import annotations

import json
import math

import numpy as np

import antiosc as ao
from antiosc.scene_file.output import write_numbers, write_table
from antiosc.scene_file.program import Call, Evaluation, ForEach, Name, Statement


def test_expressions_become_their_objects():
    """Calls, methods of variables, entries, attributes, and a list made of another."""
    sphere = {"radius": 0.01, "E": 2.1e11, "nu": 0.3, "rho": 7850.0, "velocity": (1.0, 2.0)}
    law = Call("hertz", {"E": 7e10, "nu": 0.3}, (), Name("ball"))
    own = Evaluation(lambda call, error: error)
    for each in (
        Statement("balls", Call("ao.sweep", {"*make": Name("ao.Sphere"), **sphere})),
        Statement("laws", ForEach(law, "balls")),
        Statement("named", {"first": Call("ao.Linear", {"stiffness": 1e6})}),
        Statement("k", Name("named", "first")),
    ):
        own.run(each)
    expected = ao.Sphere(0.01, 2.1e11, 0.3, 7850.0, 1.0).hertz(E=7e10, nu=0.3).stiffness
    assert [law.stiffness for law in own.variables["laws"]] == [expected] * 2
    assert own.variables["k"].stiffness == 1e6


def test_files_have_no_nan(tmp_path):
    content = {"a": math.nan, "b": np.array([1.0, math.inf]), "c": np.float64(math.nan), 5: (1,)}
    write_numbers(tmp_path / "n.json", content)
    read = json.loads((tmp_path / "n.json").read_text())
    assert [read[key] for key in "abc5"] == [None, [1.0, None], None, [1]]
    write_table(tmp_path / "t.csv", {"x, y": [0.1, math.nan], "n": np.array([1, 2])})
    assert (tmp_path / "t.csv").read_text() == '"x, y",n\n0.1,1\n,2\n'
