"""Free motion of the march, NumPy's and the loops': loads, gaps, amplitudes."""

from __future__ import annotations

from types import ModuleType

import numpy as np
import pytest
from numpy.typing import NDArray

from antiosc.simulation import march
from antiosc.simulation.march import layout
from march_parts import DECAY, OMEGA, SPRING, Parts

Array = NDArray[np.float64]


def test_loads_and_gaps_are_linear_between_their_breaks(module: ModuleType) -> None:
    parts = Parts.of([SPRING], 1)
    clock, count = parts.state[:2]
    at, slope, offset, drift = parts.work[4:8]
    breaks, loads, offsets = parts.acting
    clock[layout.DURATION] = 1.0
    for t, end in ((0.0, 0.2), (0.15, 0.2), (0.2, 0.7), (0.6999, 0.7), (0.7, 1.0), (0.95, 1.0)):
        count[layout.SEGMENT], clock[layout.TIME] = 0, t
        span = module.flight.acting_now(parts.acting, parts.state, parts.work)
        assert span == pytest.approx(end - t, abs=1e-15)
        for found, rise, values in ((at, slope, loads), (offset, drift, offsets)):
            now, later = (
                np.array([np.interp(x, breaks, column) for column in values.T])
                for x in (t, t + span)
            )
            np.testing.assert_allclose(found, now, rtol=1e-12, atol=1e-18)
            np.testing.assert_allclose(rise, (later - now) / span, rtol=1e-9, atol=1e-15)
    clock[layout.DURATION], clock[layout.TIME] = 0.5, 0.3
    assert module.flight.acting_now(parts.acting, parts.state, parts.work) == pytest.approx(0.2)


def test_swings_are_the_amplitudes_of_free_motion_about_its_rest(module: ModuleType) -> None:
    """And a rigid mode's is its largest acceleration, with what its damping may take."""
    parts = Parts.of([SPRING, SPRING])
    x, beta = parts.state[2], parts.system.beta
    at, slope = parts.work[4:6]
    module.flight.amplitudes(0.3, parts.modes, parts.state, parts.work)
    swing, bend, missed, known = parts.work[9:13]
    square = np.where(OMEGA > 0, OMEGA, 1.0) ** 2
    rest = (at - 2 * DECAY * slope / square) / square
    wide = np.hypot(x[0] - rest, (x[1] - slope / square) / np.sqrt(square))
    wide[0] = max(abs(at[0]), abs(at[0] + 0.3 * slope[0])) + 2 * DECAY[0] * abs(x[1, 0])
    np.testing.assert_allclose(swing, np.abs(beta) * wide, rtol=1e-12)
    np.testing.assert_allclose(bend, swing[:, 0], rtol=1e-12)
    curved = swing @ (OMEGA * (OMEGA + 2 * DECAY)) + swing[:, 0]
    np.testing.assert_allclose(missed[layout.LEVELS], curved, rtol=1e-12)
    assert not known.any()


@pytest.mark.parametrize("loaded", [False, True])
@pytest.mark.parametrize("shifted", [False, True])
def test_free_motion_after_half_and_whole_a_step(
    module: ModuleType, loaded: bool, shifted: bool
) -> None:
    parts = Parts.of([SPRING, SPRING])
    h, count, x, out = 1e-3, parts.state[1], parts.state[2], np.empty((4, 2))
    at, slope, offset, drift = parts.work[4:8]
    count[layout.LOADED], count[layout.SHIFTED] = loaded, shifted
    for each, used in ((at, loaded), (slope, loaded), (offset, shifted), (drift, shifted)):
        each[:] *= used
    module.tables.ready_step(4, h, parts.modes, parts.tables)
    arguments = parts.modes, parts.state, parts.tables, parts.work, out
    module.flight.free_step(4, h, *arguments)
    for i, t in enumerate((h / 2, h)):
        for rate in (0, 1):
            expected = []
            for c in (0, 1):
                total = -drift[c] if rate else -offset[c] - drift[c] * t
                for j, (w, d) in enumerate(zip(OMEGA, DECAY, strict=True)):
                    table = march.response(np.array([w]), np.array([d]), t, True)
                    P, W, S, J0, J1, _ = (float(np.ravel(each)[0]) for each in table)
                    way = P * x[0, j] + S * x[1, j] + J0 * at[j] + J1 * slope[j]
                    speed = W * x[1, j] - w * w * S * x[0, j] + S * at[j] + J0 * slope[j]
                    total += parts.system.beta[c, j] * (speed if rate else way)
                expected.append(total)
            np.testing.assert_allclose(out[2 * i + rate], expected, rtol=1e-9, atol=1e-15)
