"""Files of displacements: what they hold."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao


@pytest.mark.slow
@pytest.mark.fem
def test_the_file_of_a_run_has_the_field_of_the_run(tmp_path):
    pytest.importorskip("dolfinx")
    import parts

    part = parts.held_sheet()
    site = ao.Site((0.13, 0.06), (0.2, -1), radius=0.035)
    hit = ao.simulate(ao.extract(part, site, 6), ao.RigidMass(0.1, 1.0), ao.Hertz(1e8), 3e-4)
    fields = np.load(ao.save_fields(part, hit, tmp_path / "fields.npz"))
    assert len(fields["time"]) == len(np.unique(hit.time))
    assert fields["cells0"].max() < len(fields["points"])
    assert fields["kinds"][0].rstrip("0123456789") == "quad"
    i = len(fields["time"]) // 2
    corner = int(np.argmax(fields["points"][:, :2].sum(axis=1)))
    place, moved = fields["points"][corner], fields["shapes"][corner] @ fields["factors"][i]
    there = ao.probe(part, hit, place, times=fields["time"][[i]])[0]
    np.testing.assert_allclose(moved[:2], there, atol=1e-12)
