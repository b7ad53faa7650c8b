"""Contact laws and paths of indentation on which tests are made."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao

LOADING_DEPTHS = np.linspace(0.0, 1e-4, 12)
LOADING = 1e9 * LOADING_DEPTHS**1.4
UNLOADING_DEPTHS = np.linspace(3e-5, 1e-4, 9)
_SHARE = (UNLOADING_DEPTHS - UNLOADING_DEPTHS[0]) / np.ptp(UNLOADING_DEPTHS)
UNLOADING = LOADING[-1] * _SHARE**1.8

LAWS = {
    "linear": ao.Linear(1e7),
    "power": ao.Power(1e9, 2.2),
    "hertz": ao.Hertz(1e9),
    "hertz without patch": ao.Hertz(1e9, compliance=2e-8),
    "hunt-crossley": ao.HuntCrossley(1e9, 0.6),
    "lankarani-nikravesh": ao.LankaraniNikravesh(1e9, 0.6),
    "flores": ao.Flores(1e9, 0.6),
    "gonthier": ao.Gonthier(1e9, 0.6),
    "thornton": ao.Thornton(1e9, 1e-5),
    "elastic-plastic": ao.ElasticPlastic(1e10, 5.6e-3, 4e7),
    "elastic-plastic near yield": ao.ElasticPlastic(1e10, 5.6e-3, 3.4e8),
    "elastic-plastic, elastic side": ao.ElasticPlastic(1e10, 5.6e-3, 4e7, elastic_share=0.6),
    "hunt-crossley without patch": ao.HuntCrossley(1e9, 0.6, compliance=2e-9),
    "thornton without patch": ao.Thornton(1e9, 1e-5, compliance=2e-8),
    "yang-sun without patch": ao.YangSun(1e9, 1e-5, compliance=2e-9),
    "elastic-plastic without patch": ao.ElasticPlastic(
        1e10, 5.6e-3, 4e7, elastic_share=0.3, compliance=5e-9
    ),
    "yang-sun": ao.YangSun(1e9, 1e-5),
    "table": ao.Tabulated(LOADING_DEPTHS, LOADING, (UNLOADING_DEPTHS, UNLOADING)),
    "elastic table": ao.Tabulated(LOADING_DEPTHS, LOADING),
}


def yield_speed(law: ao.ElasticPlastic, mass: float) -> float:
    """Closing speed [m/s] above which a contact of bodies with a reduced mass [kg] yields."""
    return float(np.sqrt(0.8 * law.yield_force * law.yield_indentation / mass))


laws = pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())
