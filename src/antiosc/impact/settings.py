"""Options of the integration of a scene: method, tolerance, step and limits."""

from __future__ import annotations

from dataclasses import dataclass

from antiosc.base import checks

IVP_METHODS = ("RK45", "RK23", "DOP853", "Radau", "BDF", "LSODA")
METHODS = ("exact", "newmark", "leapfrog", *IVP_METHODS)

#: Default bounds of a run; a million steps with two anti-oscillators take 6 s.
MAX_CONTACTS = 10_000
MAX_STEPS = 1_000_000


@dataclass(frozen=True)
class Settings:
    """Options of the integration of a scene, as for `Scene.run`."""

    tol: float = 1e-3
    method: str = "exact"
    step: float | None = None
    max_contacts: int = MAX_CONTACTS
    max_steps: int = MAX_STEPS

    def __post_init__(self) -> None:
        checks.choice("method", self.method, METHODS)
        checks.store(
            self,
            tol=checks.tolerance(self.tol),
            max_contacts=checks.whole("max_contacts", self.max_contacts),
            max_steps=checks.whole("max_steps", self.max_steps),
        )
