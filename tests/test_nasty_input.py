"""Whatever is given to a public function: it works, or it refuses in one sentence.

No foreign exception, no warning of NumPy, no hang and no NaN comes out. `tests/support/nasty.py`
lists the functions and the values.
"""

from __future__ import annotations

import functools
import warnings
from typing import Any

import pytest

pytest.importorskip("matplotlib")
pytest.importorskip("hypothesis")

import matplotlib.pyplot as plt
from hypothesis import HealthCheck, given, settings, strategies as st

import antiosc as ao
from nasty import EXTREMES, TYPES, parameters, public, sound, unmade, verdict

plt.switch_backend("Agg")

CALLS = public()
POOL = TYPES + EXTREMES
#: Numbers of values in POOL.
ANY, OF_EXTREMES = range(len(POOL)), range(len(TYPES), len(POOL))
#: Those that assemble, extract, march or draw: some milliseconds a call and more.
DEAR = {
    *("Structure", "extract", "full", "superposition", "impact_map", "simulate", "simulate_many"),
    *("assemble", "choose_n", "truncation_error", "probe", "strain_gauge", "write_series"),
    *("write_report", "from_frf", "save_fields", "read_mesh", "read_model", "peak_field"),
    "box_mesh",
    *("reactions", "strike", "tradeoff", "export", "find_impact", "drop", "design_map"),
    "contact_between",
    "StructureModes.write",
}
ROOMS = ("plotting.", "Fall.", "Many.", "PeakField.", "closed_form.")
DEAR |= {name for name in CALLS if name.endswith(".plot") or name.startswith(ROOMS)}
#: Parameters that take the caller's own function: what that raises is the caller's.
OWN_FUNCTIONS = {"make", "run", "build", "part"}

SETTINGS = settings(
    max_examples=60,
    derandomize=True,
    database=None,
    deadline=None,
    suppress_health_check=list(HealthCheck),
)
#: The calls in parts, so that several processes share them.
PARTS = [[*CALLS][k::8] for k in range(8)]


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path_factory, monkeypatch):
    monkeypatch.chdir(tmp_path_factory.mktemp("nasty"))


@functools.cache
def names_of(name: str) -> list[str]:
    """Parameters of a call, but for results of the caller's own that it gives back."""
    known = {**parameters(CALLS[name]), **unmade(name, CALLS[name])}
    return [p for p in known if p != "self" and (name, p) != ("sweep", "earlier")]


def attempt(name: str, change: dict[str, int]) -> str:
    """What is wrong with the call when some parameters have the values POOL[number]."""
    given = {p: POOL[k] for p, k in change.items()}
    if any(p in OWN_FUNCTIONS and callable(value) for p, value in given.items()):
        return ""
    wrong = verdict(CALLS[name], {**sound(name, CALLS[name]), **given})
    if "plot" in name:
        plt.close("all")
    return wrong


@st.composite
def nasty_calls(draw: Any, names: list[str], numbers: range) -> tuple[str, dict[str, int]]:
    """A call, and one to three of its parameters, each with the number of a value."""
    name = draw(st.sampled_from([name for name in names if names_of(name)]))
    changed = draw(st.lists(st.sampled_from(names_of(name)), min_size=1, max_size=3, unique=True))
    return name, {p: draw(st.sampled_from(numbers)) for p in changed}


def take_sound(name: str) -> None:
    """Call with sound arguments."""
    arguments = sound(name, CALLS[name])
    own = [arguments.pop("self")] if "self" in arguments else []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ao.AntioscWarning)
        CALLS[name](*own, **arguments)


@pytest.mark.slow
@pytest.mark.fem
@pytest.mark.parametrize("names", PARTS, ids=range(len(PARTS)))
def test_sound_arguments_are_taken(names):
    for name in sorted({*names} - DEAR - {"Mesh.group"}):
        take_sound(name)


@pytest.mark.fem
@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(DEAR & {*CALLS}))
def test_sound_arguments_are_taken_where_they_cost_much(name):
    take_sound(name)


@pytest.mark.slow
@pytest.mark.fem
@pytest.mark.parametrize("names", PARTS, ids=range(len(PARTS)))
@SETTINGS
@given(data=st.data())
def test_some_nasty_arguments(names, data):
    name, changed = data.draw(nasty_calls(sorted({*names} - DEAR), ANY))
    assert not attempt(name, changed)


@pytest.mark.fem
@pytest.mark.slow
@pytest.mark.parametrize("names", PARTS, ids=range(len(PARTS)))
@SETTINGS
@given(data=st.data())
def test_nasty_arguments_together(names, data):
    name, changed = data.draw(nasty_calls(names, OF_EXTREMES))
    assert not attempt(name, changed)
