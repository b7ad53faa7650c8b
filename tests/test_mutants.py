"""The breaks that `make mutants` draws are programs, and differ from the source in one place."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

pytest.importorskip("dolfinx")

import breaks
import line_hits
import mutants
import place_notes
from paths import ROOT

ZENER = Path("src/antiosc/closed_form/zener.py")


def test_breaks_change_one_place():
    source = (ROOT / ZENER).read_bytes()
    found = [one for one in breaks.breaks(ZENER) if breaks.works(one)]
    assert len(found) > 50
    for one in found:
        assert one.apply(source)[: one.start] == source[: one.start]
        assert one.apply(source).endswith(source[one.end :])
        assert source[one.start : one.end].decode() == one.before


def test_every_kind_of_break_is_drawn():
    """Constants, operators, comparisons, conditions, arguments and statements."""
    pairs = {(one.before, one.text) for one in breaks.breaks(ZENER)}
    assert ("8", "(9)") in pairs
    assert ("1.5", "(0.0)") in pairs
    assert ("lam > HIGHEST_LAMBDA", "(lam <= HIGHEST_LAMBDA)") in pairs
    assert any(before.startswith("solve_ivp(") for before, _ in pairs)
    assert any(before.startswith("mass / (") and " * " in text for before, text in pairs)
    assert any(before.startswith("raise InputError") and text == "pass" for before, text in pairs)
    # words are no mechanics
    docstring = ast.get_docstring(ast.parse((ROOT / ZENER).read_text(encoding="utf-8")))
    assert docstring is not None
    assert not [before for before, _ in pairs if "Zener" in before]


@pytest.mark.parametrize("source", ["x = 0.0", "max(a, b)", "np.clip(a, b, c)", "f(a, a)"])
def test_changes_that_change_nothing_are_not_drawn(source):
    found = [text for _, text in breaks.changes(ast.parse(source).body[0])]
    assert not set(found) - {"pass", "(1.0)"}


@pytest.mark.parametrize("source", ["x[1]", "x[:, 1]", "f(x, axis=1)"])
def test_the_second_of_two_is_not_drawn_as_the_last(source):
    assert "(2)" in {text for _, text in breaks.changes(ast.parse(source).body[0])}
    assert "(-1)" not in {text for _, text in breaks.changes(ast.parse(source).body[0])}


def test_guards_of_programs_are_not_drawn():
    found = [text for _, text in breaks.changes(ast.parse("zip(a, b, strict=True)").body[0])]
    assert found == ["pass", "(zip(b, a, strict=True))"]


def test_a_product_of_matrices_is_negated():
    assert [text for _, text in breaks.changes(ast.parse("A @ B").body[0])] == ["(-(A @ B))"]


def test_lengths_in_pictures_are_not_drawn_a_tenth_longer():
    found = [one.text for one in breaks.breaks(Path("src/antiosc/charts/histories.py"))]
    assert "(1.1)" not in found
    assert "(0.0)" in found


def test_code_for_other_versions_is_not_drawn():
    source = "if DOLFINX < (0, 1):\n    x = 1\nelse:\n    y = 2\nz = 3 if FFCX >= (0, 1) else 4"
    found = [
        ast.unparse(node) for line in ast.parse(source).body for node, _ in breaks.changes(line)
    ]
    assert set(found) == {"2", "3"}


def test_the_tests_of_a_file_are_found():
    own, near = mutants.mirrored(Path("src/antiosc/simulation/truncation.py"), ROOT)
    assert own == ["tests/simulation/test_truncation.py"]
    assert near == ["tests/simulation"]
    assert mutants.mirrored(Path("src/antiosc/charts/models.py"), ROOT) == ([], ["tests/charts"])


def test_probes_change_nothing_that_is_computed():
    """Each kind of break leaves a program with a probe, whose value is the same."""
    source = (ROOT / ZENER).read_bytes()
    noted: list[int] = []
    for number, one in enumerate(filter(breaks.works, breaks.breaks(ZENER))):
        text = line_hits.probed(source, {number: one})
        assert text.count(b"antiosc_probe") == 1
        assert ast.parse(text)
    source = b"def f(x):\n    x.append(1 + 2)\n    return x[0] * 4.0\n"
    places = [
        breaks.Break(ZENER, 2, 14, 29, "x.append(1 + 2)", "pass"),
        breaks.Break(ZENER, 3, 41, 51, "x[0] * 4.0", "(x[0] / 4.0)"),
    ]
    assert [source[p.start : p.end].decode() for p in places] == [p.before for p in places]
    text = line_hits.probed(source, dict(enumerate(places))).decode()
    text = text.replace('__import__("antiosc_probe").hit', "hit")
    scope: dict[str, object] = {"hit": noted.append}
    exec(text, scope)
    assert scope["f"]([]) == 12.0  # type: ignore[operator]
    assert noted == [0, 1]


def test_durations_of_a_run_are_read():
    lines = ["0.50s call     tests/a.py::b[x y]", "0.25s setup    tests/a.py::b[x y]", "12 passed"]
    assert line_hits.durations(lines) == {"tests/a.py::b[x y]": 0.75}


def test_places_of_a_kept_value_count_for_each_test_that_uses_it(tmp_path, monkeypatch):
    """functools.cache and cached_property; a place that another process runs is noted, too."""
    for name in ("NOTES", "NOW"):
        monkeypatch.setattr(place_notes, name, tmp_path / name)
    place_notes.NOTES.touch()

    class Kept:
        @place_notes._NotingProperty
        def value(self) -> int:
            place_notes.hit(1)
            return 7

    @place_notes._noting_cache(None)
    def of(x: float) -> float:
        place_notes.hit(2)
        with place_notes.NOTES.open("a", encoding="utf-8") as file:
            file.write("3\tanother process\n")
        return 2 * x

    kept = Kept()
    for test in ("first", "second"):
        place_notes.begin(test)
        assert kept.value == 7
        assert of(4.0) == 8.0
    noted = place_notes.NOTES.read_text(encoding="utf-8").splitlines()
    assert {line for line in noted if "second" in line} == {"1\tsecond", "2\tsecond", "3\tsecond"}
    place_notes.begin("")


def test_heads_of_functions_have_probes():
    source = b'def f():\n    """Words."""\n    return 1\n\n\nclass A:\n    def g(self): return 2\n'
    text = line_hits.probed(source, {}, 5).decode()
    assert text.count('__import__("antiosc_probe").hit(5)\n    return 1') == 1
    assert ast.get_docstring(ast.parse(text).body[0]) == "Words."  # type: ignore[arg-type]


def test_tests_of_a_place_that_is_run_at_import_are_not_all():
    """The rest of the tests follows there; elsewhere those of the folder are the last."""
    one = next(iter(breaks.breaks(ZENER)))
    first, *_, last = mutants.stages(one, ROOT, ["tests/a.py::b"], True)
    assert first == (["tests/a.py::b"], [])
    assert last[0] == ["tests/closed_form"]
    assert mutants.stages(one, ROOT, [], False)[-1][0] == ["tests"]
