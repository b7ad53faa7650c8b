"""Marks that several test files share."""

import pytest

#: Tests of structures whose supports leave rigid-body motions, which antiosc warns of.
FREE_ON_PURPOSE = pytest.mark.filterwarnings(
    "ignore:the supports leave:antiosc.base.errors.AntioscWarning"
)
#: Tests of bodies that turn farther than the theory of small rotations covers.
TURNS_FAR = pytest.mark.filterwarnings("ignore:.*turned by")
