"""A model of one site as masses on springs: what multibody programs can hold."""

from __future__ import annotations

from antiosc.base.errors import AccuracyWarning, InputError, warn
from antiosc.models.anti_oscillators import AntiOscillators

#: residual mass, of m_st, below which it is enlarged by the highest anti-oscillator
_SMALLEST = 1e-6


def chain(model: object, ending: str) -> AntiOscillators:
    """The model with a residual mass > 0; InputError for one that is no chain of springs."""
    if not isinstance(model, AntiOscillators) or model.sites:
        raise InputError(
            f"a file {ending} holds AntiOscillators of one site; got {type(model).__name__}"
            f"{' of several sites' if isinstance(model, AntiOscillators) else ''}."
        )
    if model.damping is not None:
        warn(f"the damping of the model is left out of the file {ending}.", AccuracyWarning)
    while model.n and model.m0 <= _SMALLEST * model.m_st:
        model = model.truncated(model.n - 1)  # its mass joins m0
    if model.m0 <= 0:
        raise InputError(f"a file {ending} needs a residual mass m0 > 0; got m0 = {model.m0:g} kg.")
    return model
