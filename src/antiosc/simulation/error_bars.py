"""`ErrorBudget`: the bars of an impact's three quantities, by cause."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

#: Quantities of an impact that have bars, and their units.
QUANTITIES = {"peak_force": "N", "impulse": "N s", "contact_time": "s"}
#: Causes of error, in the order in which they are told.
CAUSES = ("mesh", "truncation", "time", "patch", "geometry")


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
    """

    value: float
    mesh: float
    truncation: float
    time: float
    patch: float
    geometry: float = 0.0

    @property
    def total(self) -> float:
        """Sum of all causes."""
        return self.mesh + self.truncation + self.time + self.patch + self.geometry


@dataclass(frozen=True)
class ErrorBudget(Mapping[str, ErrorBar]):
    """The bars of "peak_force", "impulse" and "contact_time".

    Attributes
    ----------
    bars : quantity -> ErrorBar.
    energy_error : share of the errors of strains in the strain energy, mean over the contact.
    notes : what the bars do not include, and what makes them doubtful.
    """

    bars: Mapping[str, ErrorBar]
    energy_error: float
    notes: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> ErrorBar:
        return self.bars[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.bars)

    def __len__(self) -> int:
        return len(self.bars)

    @property
    def worst(self) -> float:
        """Largest total of the three quantities."""
        return max(bar.total for bar in self.bars.values())

    def __str__(self) -> str:
        lines = []
        for name, bar in self.bars.items():
            causes = ", ".join(f"{cause} {_percent(getattr(bar, cause))}" for cause in CAUSES)
            value = f"{bar.value:.5g} {QUANTITIES[name]}"
            lines.append(f"{name} {value} ± {_percent(bar.total)} %: {causes}")
        return "\n".join([*lines, *self.notes])


def _percent(share: float) -> str:
    """A share in per cent, two digits."""
    return f"{100 * share:.2g}"
