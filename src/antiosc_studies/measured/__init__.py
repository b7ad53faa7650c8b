"""`from_frf`: the anti-oscillators of a part from its measured frequency responses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from antiosc import AntiOscillators, Damping, from_free_modes
from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import AccuracyError, AccuracyWarning, InputError, warn, without_warnings
from antiosc.base.texts import percent
from antiosc.models.body import MeasuredBodies, ModelInfo
from antiosc_studies.measured.fit import (
    BodyFit,
    MeasuredReceptances,
    is_support_unclear,
    most_probable_fit,
    with_other_noise,
)
from antiosc_studies.measured.frf import DERIVATIVE_ORDERS, FRF, FittedModes

DampingForm = Literal["viscous", "hysteretic"]
#: Largest number of values in a fit.
MAX_FITTED_VALUES = 100_000
#: chi^2 over the degrees of freedom above which a poor fit is reported, …
POOR_CHI2 = 2.0
#: … unless its median error is below this: for data without noise the noise level is unknown.
SMALL_MEDIAN_ERROR = 0.005
#: Median |H - fit| over |H| above which a measurement is refused, …
MAX_MISFIT = 0.5
#: … and above which it is reported.
ROUGH_MISFIT = 0.15
#: Rigid-body modes that move the sites by less than this share of the largest are dropped.
MIN_RIGID_SHARE = 0.05
#: Least eigenvalue of a residual compliance over the largest.
MIN_RESIDUAL_RATIO = 1e-7
#: Shift over the lowest omega^2.
SHIFT_RATIO = 0.1
#: Share of the power at the driving points that leaves the part, above which the sign of the
#: measurement is reversed, …
REVERSED_SHARE = 0.8
#: … and above which the sensor is not at the driving point.
MISPLACED_SHARE = 0.2


@checks.within_range
def from_frf(
    frf: FRF,
    band: ArrayLike | None = None,
    sensor_mass: float | Mapping[str, float] = 0.0,
    *,
    damping: DampingForm | None = None,
    free: bool | None = None,
) -> AntiOscillators:
    """A passive model of a part from measured frequency responses, with error bars.

    Parameters
    ----------
    frf : FRF
        One driving point, or several sites with a driving point at each reference.
    band : (low, high), optional
        Frequencies [Hz] to fit; default: all lines.
    sensor_mass : float or {site: float}
        Mass [kg] of the sensor at the site, which is removed (`FRF.without_sensor`).
    damping : "viscous" or "hysteretic", optional
        Form of the damping in the fit; default: the form with the smaller chi^2. In both cases the
        model has damping ratios.
    free : bool, optional
        Whether the part has rigid-body motion at the site; default: if the measurement shows it.

    Returns
    -------
    AntiOscillators
        The `hit.error_budget` of an impact on it has an error "noise", computed from
        `model.info.measured`.

    Raises
    ------
    InputError
        Unsound arguments; a measurement without a driving point.
    AccuracyError
        A measurement that no passive body of few modes explains.
    """
    checks.instance("frf", frf, FRF, "an FRF, as read_frf returns it")
    if damping is not None:
        checks.choice("damping", damping, get_args(DampingForm))
    if free is not None:
        checks.flag("free", free)
    data = _with_power_into_part(_measured_of(frf.within(band).without_sensor(sensor_mass)))
    best = most_probable_fit(data, free, None if damping is None else damping == "hysteretic")
    _check_fit(data, best)
    if free is None and is_support_unclear(data, best.modes):
        _warn_unclear(data, best.modes)

    info = ModelInfo(
        method="frf",
        measured=None if frf.sites else _consistent_bodies(data, best),
        notes={
            "structure": f"measured, {len(data.w)} lines to {data.w[-1] / (2 * np.pi):.5g} Hz",
            "damping": get_args(DampingForm)[best.modes.hysteretic],
            "chi2": best.chi2,
        },
    )

    return anti_oscillators(best.modes, frf.sites, info)


def _measured_of(frf: FRF) -> MeasuredReceptances:
    """The measurement in the form that the fit needs."""
    w = 2 * np.pi * frf.frequency
    if frf.values.size > MAX_FITTED_VALUES:
        raise InputError(
            f"the band holds {frf.values.size} values, more than the {MAX_FITTED_VALUES} that can"
            " be fitted: take a narrower band, fewer sites, or every second line."
        )

    if not any(m == n for m, n in frf.pairs):
        raise InputError("no reference is among the sites: one driving point is needed.")
    sigma = frf.receptance_sigma

    return MeasuredReceptances(
        w=w,
        H=frf.receptance.reshape(len(w), -1),
        pairs=frf.pairs,
        sites=max(len(frf.sites), 1),
        sigma=None if sigma is None else sigma.reshape(len(w), -1),
        derivative_order=DERIVATIVE_ORDERS[frf.quantity],
    )


def _with_power_into_part(data: MeasuredReceptances) -> MeasuredReceptances:
    """The measurement with the sign that makes power flow into the part at driving points."""
    if not np.any(_driving_power(data)):
        raise InputError(
            "the FRF at the driving point has no imaginary part: magnitudes and real parts do not"
            " tell damping or masses; give complex values, with their phase."
        )

    outflow = _outflow_share(data)
    if outflow < REVERSED_SHARE:
        return data

    warn(
        f"at the driving point {percent(outflow)} of the power flows out of the part, which has "
        "none: force and motion were taken in opposite directions, and the sign was turned."
    )
    return replace(data, H=-data.H)


def _outflow_share(data: MeasuredReceptances) -> float:
    """Share of |power| that leaves the part, for equal forces at its driving points."""
    power = _driving_power(data)
    return -np.sum(np.minimum(power, 0.0)) / np.sum(np.abs(power))


def _driving_power(data: MeasuredReceptances) -> Array:
    """Power into the part at its driving points / (squared force amplitude / 2): (W, p)."""
    driving = [column for column, (m, n) in enumerate(data.pairs) if m == n]
    return -data.w[:, None] * data.H[:, driving].imag


def _check_fit(data: MeasuredReceptances, fit: BodyFit) -> None:
    """Raise an error if no body explains the measurement; warn of doubtful properties."""
    H = fit.modes.receptance(data.w, data.pairs)
    misfit = np.median(np.abs(data.H - H) / np.abs(data.H))

    if (outflow := _outflow_share(data)) > MISPLACED_SHARE:
        warn(
            f"at the driving point {percent(outflow)} of the power flows out of the part, which has"
            " none: the sensor lies beside the struck point, where modes may have another sign, or"
            " its phase is wrong; measure both at one place."
        )

    if misfit > MAX_MISFIT:
        raise AccuracyError(
            f"no passive body explains the measurement: the best one is off by {percent(misfit)} "
            "in the median; check that it is a driving point, its quantity and its units."
        )

    if misfit > ROUGH_MISFIT or (fit.chi2 > POOR_CHI2 and misfit > SMALL_MEDIAN_ERROR):
        warn(
            f"the model differs from the measurement by {percent(misfit)} in the median, chi^2 ="
            f" {fit.chi2:.3g}: the noise is strong, the part not linear, or sigma too small.",
            AccuracyWarning,
        )

    if not fit.modes.n_band:
        warn(
            f"no mode lies in the band up to {data.w[-1] / (2 * np.pi):.4g} Hz: what the model does"
            " above it is a guess, and its bars are too small; measure to a higher frequency.",
            AccuracyWarning,
        )


def _warn_unclear(data: MeasuredReceptances, modes: FittedModes) -> None:
    """Warn that the measurement does not show whether the part is supported."""
    assumption = "free, k0 = 0" if modes.rigid is not None else "supported"
    warn(
        f"the lowest line, {data.w[0] / (2 * np.pi):.4g} Hz, shows neither the mass of a free part"
        f" nor the stiffness of a supported one: the part was taken as {assumption}; measure from a"
        " lower frequency, or give free=True or free=False.",
        AccuracyWarning,
    )


def _consistent_bodies(data: MeasuredReceptances, fit: BodyFit) -> MeasuredBodies:
    """Free modes of other bodies that fit the measurement equally well."""
    noisy = with_other_noise(data, fit)
    rows = (_free_modes_of(modes) for modes in (*noisy, *fit.other_tails))
    omega, decay, b, r = map(list, zip(*rows, strict=True))
    return MeasuredBodies(
        top=float(data.w[-1]), draws=len(noisy), omega=omega, decay=decay, b=b, r=r
    )


def _free_modes_of(modes: FittedModes) -> tuple[list[float], list[float], list[float], float]:
    """Free modes (omega, decay, b, r) of a fitted body with one site, a rigid-body mode first."""
    omega = modes.omega.tolist()
    decay = (modes.zeta * modes.omega).tolist()
    b = modes.b[:, 0].tolist()
    r = float(modes.residual_root[0, 0] ** 2)
    if modes.rigid is None:
        return omega, decay, b, r
    return [0.0, *omega], [0.0, *decay], [float(modes.rigid[0, 0]), *b], r


def anti_oscillators(
    modes: FittedModes, sites: tuple[str, ...], info: ModelInfo
) -> AntiOscillators:
    """The model of a fitted body."""
    order = np.argsort(modes.omega)
    omega = modes.omega[order]
    zeta = modes.zeta[order]
    b = modes.b[order]
    r = modes.residual_root @ modes.residual_root.T

    if modes.rigid is not None:
        size = np.linalg.norm(modes.rigid, axis=0)
        rigid = modes.rigid.T[size > MIN_RIGID_SHARE * size.max()]
        b = np.vstack((rigid, b))
        omega = np.append(np.zeros(len(rigid)), omega)
    fitted = omega[omega > 0]
    shift = SHIFT_RATIO * fitted[0] ** 2 if modes.rigid is not None else 0.0
    if sites:
        model = _model_of_sites(omega, b, r, sites)
    else:
        compliance = np.sum(b[:, 0] ** 2 / (omega**2 + shift)) + r[0, 0]
        model = from_free_modes(omega, b[:, 0], compliance, shift=shift)
    elastic = model.free_modes.omega
    elastic = elastic[elastic > 0]
    ratios = [zeta[np.argmin(np.abs(np.log(fitted / w)))] for w in elastic]
    with without_warnings():  # broad modes hide in the fit: nobody gave their ratios
        return replace(model, damping=Damping(ratio=ratios), info=info)


def _model_of_sites(omega: Array, b: Array, r: Array, sites: tuple[str, ...]) -> AntiOscillators:
    """Anti-oscillators of several sites from free modes and a residual compliance r.

    With u = b'q + r f and the sites fixed at u, statics gives q = S u, S = (X + b r^-1 b')^-1 b
    r^-1, X = diag(omega^2); K0 = S'XS + (1 - b'S)' r^-1 (1 - b'S), M_st = S'S.
    """
    values, vectors = np.linalg.eigh(r)
    values = np.maximum(values, MIN_RESIDUAL_RATIO * np.abs(r).max())
    stiff = (vectors / values) @ vectors.T

    # singular values of a root of the stiffness: its eigenvalues would lose the low modes
    root = np.hstack((np.diag(omega), b @ (vectors / np.sqrt(values))))
    shapes, singular, _ = np.linalg.svd(root, full_matrices=False)
    S = shapes @ (shapes.T @ (b @ stiff) / singular[:, None] ** 2)
    remaining = np.eye(len(r)) - b.T @ S
    k0 = S.T @ (omega[:, None] ** 2 * S) + remaining.T @ stiff @ remaining
    return AntiOscillators(
        m0=np.zeros_like(r), k0=(k0 + k0.T) / 2, P=S.T @ shapes, omega=singular, sites=sites
    )
