"""What stands in the pictures of a report: curves, labels and views, drawn into lists."""

from __future__ import annotations

import base64
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from antiosc.errors import InputError
from antiosc.scene_file import report_pictures as drawn
from antiosc.scene_file.program import Call


class Axes:
    """Remembers what is drawn into it."""

    def __init__(self) -> None:
        self.curves: list[tuple] = []
        self.words: dict[str, object] = {}

    def plot(self, x, y, *style, label="", **_):
        self.curves.append((np.asarray(x).tolist(), np.asarray(y).tolist(), label))

    def vlines(self, x, low, high, **_):
        self.curves.append((np.asarray(x).tolist(), low, np.asarray(high).tolist()))

    def __getattr__(self, name):
        return lambda *value, **named: self.words.update({name: value[0] if value else named})


@pytest.fixture
def ax(monkeypatch) -> Axes:
    monkeypatch.setattr(drawn, "legend_beside", lambda axes: axes.words.update(legend=True))
    return Axes()


TIME = np.array([0.0, 1e-3, 2e-3])


def test_energies_over_time(ax):
    names = ("kinetic", "strain", "contact", "dissipated")
    energy = SimpleNamespace(**{name: TIME + k for k, name in enumerate(names)})
    drawn._energies(SimpleNamespace(time=TIME, energy=energy), ax)
    assert ax.curves == [([0, 1, 2], (TIME + k).tolist(), name) for k, name in enumerate(names)]
    assert ax.words == {"set_xlabel": "time (ms)", "set_ylabel": "energy (J)", "legend": True}


def test_forces_of_the_first_twelve_contacts(ax, monkeypatch):
    pairs = [(f"a{k}", "b") for k in range(14)]
    monkeypatch.setattr(drawn, "ends", lambda hit: pairs)
    hit = {pair: SimpleNamespace(time=TIME, force=TIME * k) for k, pair in enumerate(pairs)}
    drawn._forces(hit, ax)
    assert [label for _, _, label in ax.curves] == [f"a{k} – b" for k in range(12)]
    assert ax.curves[3][:2] == ([0, 1, 2], (3 * TIME).tolist())
    assert ax.words["set_ylabel"] == "contact force (N)"


@pytest.mark.parametrize(("last", "log"), [(29.0, False), (31.0, True)])
@pytest.mark.parametrize("several", [False, True])
def test_masses_over_frequencies(ax, several, last, log):
    omega = 2 * np.pi * np.array([0.0, 1.0, last])
    shares = np.array([0.1, 0.2, 0.3])
    k0 = np.eye(2) if several else 1.0
    model = SimpleNamespace(k0=k0, n=3, omega=omega, m=10 * shares, mass_shares=shares)
    drawn._spectrum(model, ax)
    heights = (model.mass_shares if several else model.m).tolist()
    assert ax.curves == [([0, 1, last], 0, heights), ([0, 1, last], heights, "")]
    assert ("set_xscale" in ax.words) == log
    assert ax.words["set_ylim"] == {"bottom": 0}
    assert ax.words["set_ylabel"] == ("share of the static mass" if several else "mass (kg)")
    free = SimpleNamespace(**{**vars(model), "n": 0, "omega": np.zeros(0), "m": np.zeros(0),
                              "mass_shares": np.zeros(0)})  # fmt: skip
    drawn._spectrum(free, Axes())


@pytest.mark.parametrize(("values", "x"), [([1, 2.5], [1, 2.5]), (["a", 2], [0, 1])])
def test_a_sweep_over_its_first_values(ax, values, x):
    found = SimpleNamespace(compiled=SimpleNamespace(varied={"a.b$": values, "c": [0, 0]}),
                            batch=SimpleNamespace(peak_force=np.array([5.0, 6.0])))  # fmt: skip
    drawn._swept(found, ax)
    assert ax.curves == [(x, [5, 6], "")]
    assert ax.words["set_xlabel"] == r"a.b\$ (SI)"


def test_probes_by_their_largest_component(ax):
    """Each over its own times, divided by its largest value."""
    values = {"a": np.array([[1.0, -4.0], [2.0, 3.0], [0.0, 0.0]]), "b": np.array([0.0, 0.0]),
              **{str(k): np.ones(3) for k in range(12)}}  # fmt: skip
    asked = {name: Call("ao.probe", {"times": [0, 5e-3]} if name == "b" else {}) for name in values}
    found = SimpleNamespace(probes=values, compiled=SimpleNamespace(probes=asked),
                            history=SimpleNamespace(time=TIME))  # fmt: skip
    drawn._probes(found, ax)
    assert ax.curves[:2] == [([0, 1, 2], [-1, 0.75, 0], "a, at most 4 m"),
                             ([0, 5], [0, 0], "b, at most 0 m")]  # fmt: skip
    assert len(ax.curves) == 12


def test_names_in_pictures_are_no_formulas():
    assert drawn._plain("$a$\n") == r"\$a\$?"
    assert drawn._plain("x" * 60) == "x" * 60
    assert drawn._plain("x" * 61) == "x" * 57 + "…"


STRUCK = {
    "one": ({"a": {"point": [1, 2, 3], "direction": [0, 0, 1]}}, ([1, 2, 3], [0, 0, 1])),
    "two": ({"a": {"point": [1, 2, 3], "direction": [0, 0, 1]}, "b": {}}, (None, None)),
    "none": ({}, (None, None)),
    "plane": ({"a": {"point": [1, 2], "direction": [0, 1]}}, (None, None)),
    "group": ({"a": {"point": "tip", "direction": [0, 0, 1]}}, (None, None)),
    "node": ({"a": {"node": 3, "dof": "z"}}, (None, None)),
    "no direction": ({"a": {"point": [1, 2, 3]}}, (None, None)),
}


def results(sites=(), **variables):
    document = SimpleNamespace(data={"sites": sites} if sites else {})
    found = {"history": None, "model": None, "batch": None, "found": None, "structure": None,
             "probes": None, **variables}  # fmt: skip
    return SimpleNamespace(compiled=SimpleNamespace(document=document), **found)


@pytest.mark.parametrize("case", STRUCK)
def test_the_arrow_of_the_impact(case):
    sites, expected = STRUCK[case]
    assert drawn._struck(results(sites)) == expected


@pytest.mark.parametrize("known", [True, False])
def test_a_structure_from_several_sides(monkeypatch, known):
    shown = []
    monkeypatch.setattr(drawn, "plot_deformed", lambda *one, **named: shown.append((one, named)))

    def draw(heading, caption, draw, ending):
        draw("path")
        return drawn.Picture(heading, caption, "data")

    monkeypatch.setattr(drawn, "_drawn", draw)
    found = results(STRUCK["one"][0] if known else {}, structure="structure", history="history")
    headings = [one.heading for one in drawn._of_structure(found)]
    assert len(set(headings)) == len(headings) == (3 if known else 1)
    point, direction = STRUCK["one"][1] if known else (None, None)
    views = list(drawn.VIEWS.values())[: len(headings)]
    assert shown == [
        (("structure", "history", "path"), {"view": view, "point": point, "direction": direction})
        for view in views
    ]
    monkeypatch.setattr(drawn, "_drawn", lambda *_: drawn.Picture("one", "not drawn", ""))
    assert [one.heading for one in drawn._of_structure(found)] == ["one"]


def test_pictures_are_those_of_what_was_found(monkeypatch):
    monkeypatch.setattr(drawn, "_chart", lambda heading, *_: heading)
    monkeypatch.setattr(drawn, "_drawn", lambda heading, *_: heading)
    monkeypatch.setattr(drawn, "_of_structure", lambda found: ["Structure"])
    hit = SimpleNamespace()
    force = ["Contact force", "Displacements", "Energies"]
    assert list(drawn.pictures(results(history=hit))) == force
    assert list(drawn.pictures(results(history=hit, probes={"a": 1}, structure=1))) == [
        *force, "Probes", "Structure",
    ]  # fmt: skip
    assert list(drawn.pictures(results(model=1))) == ["Anti-oscillators", "Dynamic stiffness"]
    assert list(drawn.pictures(results(batch=1))) == ["Sweep"]
    surface = SimpleNamespace(quantities=lambda: {"k0": 1, "peak_force": 1, "m_st": 1})
    assert list(drawn.pictures(results(found=surface))) == ["Map: peak force", "Map: k0"]


def test_a_picture_is_data_or_a_sentence():
    one = drawn._drawn("a", "b", lambda path: path.write_bytes(b"<svg>"), ".svg")
    content = base64.b64encode(b"<svg>").decode()
    assert one == drawn.Picture("a", "b", f"data:image/svg+xml;base64,{content}")
    one = drawn._drawn("a", "b", lambda path: path.write_bytes(b"png"), ".png")
    assert one.data.startswith("data:image/png;base64,")
    for error in (InputError("no points."), ValueError("no formula")):

        def broken(path, error=error):
            raise error

        one = drawn._drawn("a", "b", broken, ".png")
        assert one == drawn.Picture("a", f"Not drawn: {error}", "")
