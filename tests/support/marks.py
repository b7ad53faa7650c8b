"""Marks that several test files share."""

import pytest

try:
    from antiosc.fem.linalg.cholmod import refusal
except ImportError:
    REFUSAL = "no PETSc"
else:
    REFUSAL = refusal()
#: Tests of what CHOLMOD does: the PETSc of PyPI has none.
BY_CHOLMOD = pytest.mark.skipif(bool(REFUSAL), reason=REFUSAL)

#: Tests of structures whose supports leave rigid-body motions, which antiosc warns of.
FREE_ON_PURPOSE = pytest.mark.filterwarnings(
    "ignore:the supports leave:antiosc.base.errors.AntioscWarning"
)
#: Tests of bodies that turn farther than the theory of small rotations covers.
TURNS_FAR = pytest.mark.filterwarnings("ignore:.*turned by")
