"""Whether the band of a measured model is wide enough for a contact."""

from __future__ import annotations

import numpy as np

from antiosc.impact.histories import History
from antiosc.models.body import info_of

#: Least product of the top of the band [Hz] and the time of the pulse.
MIN_TIME_BAND_PRODUCT = 1.0
#: The spectrum of a force ends at the frequency below which this share of its energy lies.
ENERGY_SHARE = 0.99
#: This frequency times the duration of a half-sine: with |F| ∝ cos(πfT)/(1 − 4f²T²) it is 1.182.
HALF_SINE_PRODUCT = 1.18
#: Number of samples of the force in its Fourier transform.
SAMPLE_COUNT = 8192
#: Samples with zero padding over samples without: the frequency is within 1/(8 record length).
PADDING_FACTOR = 8


def low_band_message(hit: History) -> str:
    """Warning of a measured band that is too low for the contact; "" if it is not."""
    facts = info_of(hit.model).measured
    if facts is None or not hit.contacts:
        return ""

    top = float(facts["top"]) / (2 * np.pi)
    pulse = pulse_time(hit)
    if top * pulse >= MIN_TIME_BAND_PRODUCT:
        return ""
    return (
        f"The measurement ends at {top:.4g} Hz, and the force is as short as a half-sine of"
        f" {pulse:.3g} s: their product {top * pulse:.2g} is below {MIN_TIME_BAND_PRODUCT:g}, and"
        " the force depends on modes that were not measured; measure to a higher frequency, or take"
        " a softer or heavier impactor."
    )


def pulse_time(hit: History) -> float:
    """Duration [s] of the half-sine with the bandwidth of the force (99 % of its energy)."""
    start = hit.contacts[0][0]
    end = hit.contacts[-1][1]
    time = np.linspace(start, end, SAMPLE_COUNT)
    energy = np.cumsum(np.abs(np.fft.rfft(hit.force_at(time), PADDING_FACTOR * SAMPLE_COUNT)) ** 2)
    reach = int(np.searchsorted(energy, ENERGY_SHARE * energy[-1])) or 1

    return HALF_SINE_PRODUCT * PADDING_FACTOR * (end - start) / reach
