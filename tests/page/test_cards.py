"""The first answer of an impact: whether the part breaks, in one sentence with one colour."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import antiosc as ao
from antiosc_app.cards import (
    BENDS_TONE,
    DENT_TONE,
    SAFE_TONE,
    UNKNOWN_TONE,
    cards_of_history,
    dent_depth,
    verdict_card,
)
from laws import yield_speed

#: 100 MPa ± 10 % of 235 MPa.
MARGIN = ao.results.Margin("yield", 1e8, 235e6, np.zeros(3), 0.0, force_error=0.1)


@pytest.mark.parametrize(
    ("changed", "dent", "has_bar", "tone"),
    [
        ({}, 0.0, True, SAFE_TONE),
        ({}, 1e-6, True, DENT_TONE),
        ({}, None, True, UNKNOWN_TONE),  # whether the contact yields is not known
        ({}, 0.0, False, UNKNOWN_TONE),  # no bar, no verdict
        ({"errors": (0.0, 6e8)}, 0.0, False, UNKNOWN_TONE),  # nor by the bar of the mesh alone
        ({"value": 3e8}, 0.0, False, BENDS_TONE),
        ({"value": 2.2e8}, 0.0, True, BENDS_TONE),  # it may: 242 MPa
        ({"value": 3e8}, 0.0, True, BENDS_TONE),  # it does: 270 MPa at least
        ({"errors": (5e7, np.inf)}, 0.0, True, UNKNOWN_TONE),  # the cells are too coarse to say
        ({"criterion": "tension", "value": 3e8}, 0.0, True, BENDS_TONE),
    ],
)
def test_the_verdict_has_one_colour(changed, dent, has_bar, tone):
    card = verdict_card([replace(MARGIN, **changed)], dent, has_bar=has_bar)
    assert card.tone == tone
    assert card.text.startswith("Cannot say") or tone != UNKNOWN_TONE or dent is None
    assert " to " in card.text or "no bar" in card.text or not has_bar


@pytest.mark.parametrize(
    ("value", "largest", "answer"),
    [
        (1e8, 1.5e8, "it stays elastic"),
        (1e8, 2.5e8, "it may bend for good"),
        (1e8, np.inf, "cannot say"),
        (4e8, 5e8, "it bends for good"),
    ],
)
def test_the_margin_and_the_card_give_the_same_answer(value, largest, answer):
    margin = replace(MARGIN, value=value, errors=(value, largest))
    assert margin.answer == answer
    assert margin.sentence.startswith(answer)
    assert verdict_card([margin], 0.0, has_bar=True).text.lower().startswith(answer)


def test_a_contact_with_a_strength_dents_or_does_not():
    model = ao.AntiOscillators(m0=2e-3, k0=5e5, m=[0.05], omega=[2e3])
    law = ao.ElasticPlastic(1e10, 0.01, 5e7, elastic_share=0.4)
    slow, fast = (
        ao.simulate(model, ao.RigidMass(0.2, share * yield_speed(law, 0.2)), law, 3e-3)
        for share in (0.3, 30.0)
    )
    assert dent_depth(slow) == 0 < dent_depth(fast)
    cards = cards_of_history(fast, None, None)
    assert [card.text for card in cards[::3]] == ["…", "…"]  # as long as no stress is known
    assert "no error bar" in cards[1].text
