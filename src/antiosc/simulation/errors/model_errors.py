"""The shares of an error budget that come with the model: of a beam, and of a measured model.

"model": what Timoshenko's beam leaves out of a bar that is solid. A point load on a solid bar
deforms the section around it. Beyond the half-space that a contact law holds, this changes three
things, which were measured on solid bars of rectangular section against closed forms
(`benchmarks/beam_model.py`; lengths of 5 to 40 heights, widths of half to twice the height; x is a
frequency over that at which the section deforms):

    compliance of the site    by up to LOCAL/(E √A)
    values of modes there     by up to VALUES x   (stresses across the axis, as in von Kármán's and
                              Seewald's correction of the deflection under a point load)
    natural frequencies       by up to FREQUENCIES x, and CLAMP d/L for each clamped end (d the
                              larger side, L the length: the clamp hinders Poisson's contraction)

The same impact with all of these changes at once, to one side and to the other, differed by more
than that on the solid bar for 449 of 450 quantities, and by 0.97 times as much for one; `SAFETY` is
for other bars.

"noise" and "band": the record of a measured model (`ModelInfo.measured`) has bodies that the
measurement does not tell from it: some are drawn from the noise, some from what is not known of the
modes above the band. The same impact on all of them tells what either leaves open; a bar is `BAR`
standard deviations.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from antiosc.base.errors import AccuracyWarning, warn
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.body import InModes, LinearBody
from antiosc.models.modal import ModalBody
from antiosc.models.model_info import BeamSection, info_of
from antiosc.simulation.histories.error_bars import NO_SHARE, QUANTITIES, differences, floored
from antiosc.simulation.histories.history import History

LOCAL, VALUES, FREQUENCIES, CLAMP = 0.8, 0.6, 0.06, 0.05
SAFETY = 1.25

Shares = dict[str, float]
#: Simulates an impact on another body to a tolerance.
Again = Callable[[LinearBody, float], History]


@dataclass(frozen=True, eq=False)
class Repeated:
    """An impact that is simulated again on other bodies, by the exact method to `tol`.

    `raw` is that on the `model` itself; `run` simulates it.
    """

    model: AntiOscillators
    raw: History
    run: Again
    tol: float

    def on(self, body: LinearBody) -> History:
        """The impact on another body."""
        return self.run(body, self.tol)

    def change(self, body: LinearBody) -> Shares:
        """By how much the three quantities differ there, relatively."""
        return differences(self.raw, self.on(body))


def model_errors(impact: Repeated) -> tuple[Shares, list[str]]:
    """(share of each quantity, what is to be said).

    The model's info tells what is needed ("model"), or why there is no figure.
    """
    facts = impact.model.info.model
    if isinstance(facts, str):
        return NO_SHARE, [facts]
    if facts is None:
        return NO_SHARE, []
    softer, stiffer = map(impact.change, _changed(impact.model, facts))
    return floored({name: SAFETY * max(softer[name], stiffer[name]) for name in softer}), []


def _changed(model: AntiOscillators, facts: BeamSection) -> tuple[InModes, InModes]:
    """The model with all changes that make it softer, and with all that make it stiffer.

    Contact laws with a half-space lose the local compliance of the second.
    """
    modes = model.modal()
    x = np.minimum(modes.omega / facts["omega"], 1.0)
    slower, local = FREQUENCIES * x + CLAMP * facts["clamps"], LOCAL * facts["compliance"]

    def moved(sign: float, r: float) -> ModalBody:
        omega, b = modes.omega * (1 - sign * slower), modes.b * (1 + sign * VALUES * x)
        return replace(modes, omega=omega, b=b, r=r)

    return InModes(moved(1.0, modes.r + local)), InModes(moved(-1.0, modes.r), local)


#: A bar in standard deviations of the bodies (benchmarks/measured_frf.py).
BAR = 2.0
#: Least product of the top of the band [Hz] and the time of the pulse.
LEAST_PRODUCT = 1.0

#: Share of the energy of a force below the frequency to which its spectrum reaches; that frequency
#: times the length of a half-sine; samples of the force, and its length with zeros behind.
ENERGY, HALF_SINE, SAMPLES, PADDED = 0.99, 1.18, 8192, 8


def measured_errors(impact: Repeated) -> tuple[Shares, Shares]:
    """The shares of noise and band of peak force, impulse and contact time."""
    facts = impact.model.info.measured
    if facts is None:
        return NO_SHARE, NO_SHARE
    bodies = zip(*(np.asarray(facts[name]) for name in ("omega", "b", "r", "decay")), strict=True)
    off = [
        impact.change(InModes(ModalBody(omega, b, float(r), decay)))
        for omega, b, r, decay in bodies
    ]
    drawn, others = off[: int(facts["draws"])], off[int(facts["draws"]) :]
    noise, band = (
        {
            name: BAR * float(np.sqrt(np.mean([one[name] ** 2 for one in part])))
            for name in QUANTITIES
        }
        for part in (drawn, others)
    )
    return floored(noise), floored(band)


def low_band(hit: History) -> str:
    """That the band of the measurement is too low for the contact; "" where it is not."""
    facts = info_of(hit.model).measured
    if facts is None or not hit.contacts:
        return ""
    top, pulse = float(facts["top"]) / (2 * np.pi), pulse_time(hit)
    if top * pulse >= LEAST_PRODUCT:
        return ""
    return (
        f"The measurement ends at {top:.4g} Hz, and the force is as short as a half-sine of"
        f" {pulse:.3g} s: their product {top * pulse:.2g} is below {LEAST_PRODUCT:g}, and the force"
        " depends on modes that were not measured; measure to a higher frequency, or take a softer"
        " or heavier impactor."
    )


def pulse_time(hit: History) -> float:
    """Length [s] of a half-sine whose spectrum reaches as far as that of the force.

    The spectrum of the main impact reaches to where `ENERGY` of its energy lie below.
    """
    start, end = hit.contacts[0][0], hit.contacts[-1][1]
    time = np.linspace(start, end, SAMPLES)
    energy = np.cumsum(np.abs(np.fft.rfft(hit.force_at(time), PADDED * SAMPLES)) ** 2)
    reach = int(np.searchsorted(energy, ENERGY * energy[-1])) or 1
    return HALF_SINE * PADDED * (end - start) / reach


def warn_low_band(hit: History) -> None:
    """Warn of a band that is too low for the contact."""
    if sentence := low_band(hit):
        warn(sentence, AccuracyWarning)
