"""`ErrorBudget`: the bars of an impact's three quantities by cause, and differences of impacts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from antiosc.base.texts import engineering, percent

#: Quantities of an impact that have bars, and their units.
QUANTITIES = {"peak_force": "N", "impulse": "N s", "contact_time": "s"}
#: What a cause adds that does not apply.
NO_SHARE = dict.fromkeys(QUANTITIES, 0.0)
#: Causes of error, in the order in which they are told.
CAUSES = ("mesh", "truncation", "time", "patch", "geometry", "noise", "band", "model")
#: Those that are told only of models that were measured.
MEASURED = ("noise", "band")


@dataclass(frozen=True)
class ErrorBar:
    """The bar of one quantity: bounds on its relative errors, by cause.

    Attributes
    ----------
    value : of the quantity, SI units.
    mesh : of the displacements that the mesh cannot represent.
    truncation : of the anti-oscillators that the model leaves out.
    time : of the time integration.
    patch : of the radius of the site's patch.
    geometry : of flat faces that stand for a curved surface.
    noise, band : of a measured model, of the noise and of the modes above the measured band.
    model : of the element family, such as a beam in place of a solid bar.
    """

    value: float
    mesh: float
    truncation: float
    time: float
    patch: float
    geometry: float = 0.0
    noise: float = 0.0
    band: float = 0.0
    model: float = 0.0

    @property
    def numerical(self) -> float:
        """Sum of all causes but the model, which no finer mesh changes."""
        return sum(getattr(self, cause) for cause in CAUSES if cause != "model")

    @property
    def total(self) -> float:
        """Sum of all causes."""
        return self.numerical + self.model


@dataclass(frozen=True)
class ErrorBudget(Mapping[str, ErrorBar]):
    """The bars of "peak_force", "impulse" and "contact_time".

    Attributes
    ----------
    bars : quantity -> ErrorBar.
    energy_error : share of the errors of strains in the strain energy, mean over the contact.
    notes : what the bars do not include, and what makes them doubtful.
    safety : factor of the mesh's bars over the differences to the corrected model.
    """

    bars: Mapping[str, ErrorBar]
    energy_error: float
    notes: tuple[str, ...] = ()
    safety: float = 2.0

    def __getitem__(self, name: str) -> ErrorBar:
        return self.bars[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.bars)

    def __len__(self) -> int:
        return len(self.bars)

    def of_corrected(self, hit: object) -> ErrorBudget:
        """The bars of `hit`, the same impact on the corrected model, for a `safety` of 2 or more.

        With the difference d of both, an error of the raw model of at most S d is one of at most
        (S - 1) d of the corrected one: it is nearer by d, or beyond the truth by less than d.
        """
        nearer = 1 - 1 / self.safety
        bars = {
            name: replace(bar, value=getattr(hit, name), mesh=nearer * bar.mesh)
            for name, bar in self.bars.items()
        }
        return replace(self, bars=bars)

    @property
    def causes(self) -> tuple[str, ...]:
        """Those that are told: noise and band of a measured model alone."""
        bars = self.bars.values()
        return tuple(c for c in CAUSES if c not in MEASURED or any(getattr(b, c) for b in bars))

    @property
    def worst(self) -> float:
        """Largest total of the three quantities."""
        return max(bar.total for bar in self.bars.values())

    @property
    def numerical(self) -> float:
        """Largest of the three without the shares of the model."""
        return max(bar.numerical for bar in self.bars.values())

    def __str__(self) -> str:
        lines = []
        for name, bar in self.bars.items():
            causes = ", ".join(f"{c} {percent(getattr(bar, c))}" for c in self.causes)
            value = engineering(bar.value, QUANTITIES[name], 4)
            lines.append(f"{name.replace('_', ' ')} {value} ± {percent(bar.total)}: {causes}")
        return "\n".join([*lines, *self.notes])


#: Each error is at least this share of the largest of the three.
FLOOR = 0.5


def differences(one: object, other: object) -> dict[str, float]:
    """Relative differences of the three quantities."""
    return {name: _relative(getattr(one, name), getattr(other, name)) for name in QUANTITIES}


def floored(errors: Mapping[str, float]) -> dict[str, float]:
    """Errors of the three quantities, each at least `FLOOR` times the largest."""
    worst = max(errors.values())
    return {name: max(error, FLOOR * worst) for name, error in errors.items()}


def _relative(a: float, b: float) -> float:
    return abs(a - b) / max(abs(a), abs(b)) if a != b else 0.0
