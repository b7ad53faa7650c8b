"""What the tests of simulations share."""

from __future__ import annotations

from types import ModuleType

import pytest

from antiosc.simulation import march
from marches import written_out


@pytest.fixture(params=["numpy", "loops"])
def module(request: pytest.FixtureRequest) -> ModuleType:
    """The march by NumPy's operations, and by the loops that numba compiles."""
    return march if request.param == "numpy" else written_out()
