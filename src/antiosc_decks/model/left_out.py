"""What is left out of a model with the elements that are not chosen."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from antiosc._types import BoolArray
from antiosc_decks.model.builder import ModelBuilder
from antiosc_decks.model.choice import some_rows
from antiosc_decks.model.constraints import Term


def keep(builder: ModelBuilder, kept: BoolArray, roles: list[str]) -> list[str]:
    """Leave out elements, and what acts on their nodes; the roles of the blocks that remain."""
    if kept.all():
        return roles
    ends = np.cumsum([0, *map(len, builder.deck.blocks)])
    own = [kept[a:b] for a, b in pairwise(ends)]
    roles = [role for role, some in zip(roles, own, strict=True) if some.any()]
    builder.deck.blocks = [
        some_rows(block, some) for block, some in zip(builder.deck.blocks, own, strict=True)
        if some.any()
    ]  # fmt: skip
    number = np.cumsum(kept) - 1
    sets = builder.deck.element_sets
    builder.deck.element_sets = {name: number[one[kept[one]]] for name, one in sets.items()}
    builder.of_element = builder.of_element[kept]
    _leave(builder)
    return roles


def _leave(builder: ModelBuilder) -> None:
    """Drop what acts on nodes of elements that are not chosen."""
    count = len(builder.gone)

    def stays(terms: Sequence[Term]) -> bool:
        return not any(n < count and builder.gone[n] for n, _, _ in terms)

    joints = builder.joints
    before = len(joints.every()) + len(builder.masses) + len(builder.springs)
    joints.equations = [terms for terms in joints.equations if stays(terms)]
    joints.springs = [one for one in joints.springs if stays(one[0])]
    joints.dampers = [one for one in joints.dampers if stays(one[0])]
    joints.masses = [one for one in joints.masses if all(map(stays, one[0]))]
    builder.masses = [one for one in builder.masses if not builder.gone[one[0]]]
    builder.springs = [one for one in builder.springs if not builder.gone[one[0]]]
    left = before - len(joints.every()) - len(builder.masses) - len(builder.springs)
    if left:
        builder.ignored.append(
            f"{left} constraints, springs, dampers or masses on parts that are left out"
        )
