"""Contact pairs of decks: tied, a block in two bodies is the block in one mesh."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import antiosc as ao
from antiosc.base.errors import PiecesError
from assemblies import eigenfrequencies
from contact_decks import cut_block, whole_block
from marks import FREE_ON_PURPOSE
from refusals import refused

pytestmark = [FREE_ON_PURPOSE, pytest.mark.fem]
#: Rigid motions of one body.
RIGID = 6


def read(path, **options) -> tuple[ao.Structure, list[str]]:
    """(the structure of a deck, what is told)."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        part = ao.read_model(path, unit="mm", **options)
    return part, [str(one.message) for one in told]


def elastic(part: ao.Structure, count: int = 6) -> np.ndarray:
    """The lowest circular frequencies of a free body that are not those of rigid motions."""
    found = eigenfrequencies(part, RIGID + count)
    assert found[RIGID - 1] < 1e-2 * found[RIGID], found
    return found[RIGID:]


@pytest.mark.slow
def test_tied_bodies_of_equal_meshes_have_the_frequencies_of_one_mesh(tmp_path):
    one, _ = read(whole_block(tmp_path / "one.inp", (4, 2, 2)))
    two, _ = read(cut_block(tmp_path / "two.inp", (4, 2, 1), (4, 2, 1)), contact="tied")
    assert two.mass == pytest.approx(one.mass, rel=1e-12)
    np.testing.assert_allclose(elastic(two), elastic(one), rtol=1e-7)


@pytest.mark.slow
def test_the_frequencies_of_tied_bodies_tend_to_those_of_one_mesh(tmp_path):
    """The error falls with the square of the size at least; its first is 17 %."""
    exact = elastic(read(whole_block(tmp_path / "one.inp", (8, 2, 4)))[0])
    errors = []
    for k in (1, 2):
        n, m = (4 * k, 2 * k, k), (3 * k, k, k)
        part, told = read(cut_block(tmp_path / f"{k}.inp", n, m), contact="tied")
        errors.append(float(np.abs(elastic(part) / exact - 1).max()))
        assert len(told) == 1
    assert errors[1] < errors[0] / 4
    assert errors[1] < 0.04


@pytest.mark.slow
def test_the_finer_surface_follows_whichever_is_named_first(tmp_path):
    path = cut_block(tmp_path / "a.inp", (6, 3, 1), (2, 1, 1))
    swapped = tmp_path / "b.inp"
    swapped.write_text(path.read_text().replace("UPPER_LOW, LOWER_HIGH", "LOWER_HIGH, UPPER_LOW"))
    (first, told), (second, _) = (read(one, contact="tied") for one in (path, swapped))
    assert f"at {7 * 4} nodes" in told[0]
    np.testing.assert_allclose(elastic(first), elastic(second), rtol=1e-9)


@pytest.mark.slow
def test_pairs_that_touch_are_tied_without_a_word_of_the_caller(tmp_path):
    path = cut_block(tmp_path / "a.inp", (4, 2, 1), (3, 1, 1), shared=True)
    first, second = (read(path, **options)[0] for options in ({}, {"contact": "tied"}))
    np.testing.assert_allclose(elastic(first), elastic(second), rtol=1e-9)
    with refused(None, "contact", ao.InputError):
        ao.read_model(path, unit="mm", contact="glued")


@pytest.mark.slow
def test_general_contact_is_refused_unless_it_is_left_out(tmp_path):
    path = whole_block(tmp_path / "a.inp", (4, 2, 1))
    path.write_text(path.read_text() + "*CONTACT\n")
    with refused(path.read_text().split("\n").index("*CONTACT") + 1, "contact", PiecesError):
        ao.read_model(path, unit="mm")
    _, told = read(path, contact="apart")
    assert "not modelled" in told[0]


@pytest.mark.slow
@pytest.mark.parametrize("gap", [2.0, 0.0])
def test_what_is_open_at_first_or_touches_along_a_line_is_not_tied(tmp_path, gap):
    """A body that touches at an edge alone would turn about it."""
    path = cut_block(tmp_path / "a.inp", (4, 2, 1), (1, 1, 1), gap=gap)
    if not gap:
        text = path.read_text().replace("UPPER_LOW, LOWER_HIGH", "EDGE, LOWER_HIGH")
        edge = "*SURFACE, NAME=EDGE, TYPE=NODE\n10001,\n10003,\n"
        path.write_text(text.replace("*SURFACE INTERACTION", f"{edge}*SURFACE INTERACTION"))
    with warnings.catch_warnings(action="ignore"), refused(None, "pieces", PiecesError):
        ao.read_model(path, unit="mm")
