"""Blows on a tool whose receptance others measured, beside a convolution with the measurement.

The measurement is public: point 1 of `ExperimentalModalAnalysis` in
github.com/leekunhwee/Vibration-Signal-Processing, receptances [m/N] at the tip of a milling tool in
its holder, struck and measured there, 1 to 5000 Hz. The reference knows no modes: the displacement
is the convolution of the force with the impulse response -(2/pi) int Im H sin(wt) dw, and r F, r
being what the real part has beyond that of the imaginary one (Kramers and Kronig).

    .venv/bin/python benchmarks/measured_public.py Point_1_Channel_1_CH1.txt
"""

from __future__ import annotations

import argparse
import warnings

import numpy as np
from scipy.optimize import brentq

import antiosc as ao
from antiosc.base._types import Array

#: Bands [Hz] of the fit and of the reference; where r is read; step of the reference [s].
BAND, WHOLE, READ, STEP = (100.0, 3500.0), (60.0, 5000.0), (500.0, 3000.0), 2e-6
#: Mass [kg], velocity [m/s], stiffness of Hertz's law, duration [s].
BLOWS = [(0.2, 0.2, 1e9, 2e-3), (0.05, 0.5, 1e9, 1e-3), (0.05, 0.5, 1e10, 1e-3)]


def residual(w: Array, H: Array) -> float:
    """Compliance of what lies above the band [m/N]."""
    middle, dw = (w[1:] + w[:-1]) / 2, w[1] - w[0]
    of_imaginary = [-2 / np.pi * np.sum(w * H.imag / (w**2 - x**2)) * dw for x in middle]
    rest = (H.real[1:] + H.real[:-1]) / 2 - of_imaginary
    low, high = np.searchsorted(middle, 2 * np.pi * np.array(READ))
    return float(np.median(rest[low:high]))


def reference(frf: ao.FRF, mass: float, v: float, k: float, duration: float) -> tuple[Array, Array]:
    """Times and forces of a blow, by convolution."""
    part = frf.within(WHOLE)
    w, H = 2 * np.pi * part.frequency, part.receptance
    r, t = residual(w, H), np.arange(0.0, duration, STEP)
    h = -2 / np.pi * (w[1] - w[0]) * sum(b * np.sin(a * t) for a, b in zip(w, H.imag, strict=True))
    F, x = np.zeros(len(t)), 0.0
    for n in range(len(t) - 1):
        depth = x - STEP * float(h[n:0:-1] @ F[:n])
        if depth > 0:
            F[n] = brentq(lambda f, d=depth: k * max(d - r * f, 0.0) ** 1.5 - f, 0, k * depth**1.5)
        v -= STEP * F[n] / mass
        x += STEP * v
    return t, F


def main(path: str) -> list[tuple[float, float]]:
    """Errors of the peak force and of the force (L2) of all blows."""
    warnings.simplefilter("ignore", ao.AntioscWarning)
    frf = ao.read_frf(path, quantity="receptance")
    model = ao.from_frf(frf, band=BAND, free=False)
    fit, part = model.modal().receptance(2 * np.pi * frf.within(BAND).frequency), frf.within(BAND)
    print(f"{model.n} modes; median |fit/H - 1| {np.median(np.abs(fit / part.receptance - 1)):.1%}")
    found = []
    for mass, v, k, duration in BLOWS:
        t, F = reference(frf, mass, v, k, duration)
        hit = ao.simulate(model, ao.RigidMass(mass, v), ao.Hertz(k), duration, tol=1e-5)
        off = hit.force_at(t) - F
        found.append((hit.peak_force / F.max() - 1, np.linalg.norm(off) / np.linalg.norm(F)))
        print(
            f"{mass:g} kg, {v:g} m/s, {k:g}: {hit.peak_force:.4g} N in {hit.contact_time:.3g} s,"
            f" peak {found[-1][0]:+.1%}, L2 {found[-1][1]:.1%}, bar"
            f" {hit.error_budget['peak_force'].total:.1%}"
        )
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("path", help="the measurement, columns frequency, real, imag")
    main(parser.parse_args().path)
