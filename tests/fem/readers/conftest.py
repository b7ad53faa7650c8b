"""Fixtures of the tests of readers."""

from __future__ import annotations

import pytest


@pytest.fixture
def session():
    """A gmsh session of this process."""
    gmsh = pytest.importorskip("gmsh")
    gmsh.initialize(readConfigFiles=False)
    gmsh.option.setNumber("General.Terminal", 0)
    yield gmsh
    gmsh.finalize()
