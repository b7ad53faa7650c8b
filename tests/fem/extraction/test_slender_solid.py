"""Modes of a slender solid, whose K has far larger entries than its forces."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import antiosc as ao
import parts

pytestmark = pytest.mark.fem
LENGTH, THICKNESS = 0.3, 0.003


@pytest.fixture(scope="module")
def ruler(tmp_path_factory: pytest.TempPathFactory) -> ao.Structure:
    path: Path = tmp_path_factory.mktemp("ruler") / "ruler.geo"
    path.write_text(
        f'SetFactory("OpenCASCADE"); Box(1) = {{0, 0, 0, {LENGTH}, 0.02, {THICKNESS}}};'
        'Physical Volume("part") = {1};'
    )
    mesh = ao.read_mesh(path, size=0.003, order=2)
    clamped = ao.Support(lambda x: x[0] < 1e-9)
    return ao.Structure(mesh, ao.Solid(70e9, 0.33, 2700.0), [clamped])


@pytest.mark.slow
def test_the_lowest_mode_of_a_ruler_is_that_of_a_beam(ruler: ao.Structure) -> None:
    """f = 1.8751²/(2π L²) √(E h²/(12 ρ)), within the width's 1 %."""
    beam = 1.8751**2 / (2 * np.pi * LENGTH**2) * np.sqrt(70e9 * THICKNESS**2 / (12 * 2700.0))
    modes = ruler.natural_modes(3)
    assert modes.omega[0] / (2 * np.pi) == pytest.approx(beam, rel=0.01)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::antiosc.AccuracyWarning")  # a coarse mesh
def test_a_part_under_load_takes_a_factor_where_one_fits() -> None:
    """Under loads there is no coarser space: 2.8 s in place of more than 200."""
    loads = ao.Prestress(spin=ao.Spin((0, 0, 1), 200.0, (0, 0, 0)), gravity=(0, 0, -9.81))
    mesh = parts.box((30, 2, 1), (LENGTH, 0.02, 0.006))
    held, steel = [ao.Support(lambda x: x[0] < 1e-9)], ao.Solid(70e9, 0.33, 2700.0)
    site = ao.Site((LENGTH - 0.01, 0.01, 0.006), (0, 0, -1), radius=8e-3)
    models = []
    for solver in ("direct", "iterative"):
        part = ao.Structure(mesh, steel, held, solver=solver, prestress=loads)
        models.append(ao.extract(part, site, n=4))
    assert models[1].info["solver"].startswith("factor")
    assert models[1].k0 == pytest.approx(models[0].k0, rel=1e-6)
