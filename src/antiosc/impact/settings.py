"""Options of the integration of a scene: method, tolerance, step and limits."""

from __future__ import annotations

from dataclasses import dataclass, replace

from antiosc.base import checks

IVP_METHODS = ("RK45", "RK23", "DOP853", "Radau", "BDF", "LSODA")
METHODS = ("exact", "newmark", "leapfrog", *IVP_METHODS)

#: Default bounds of a run; a million steps with two anti-oscillators take 6 s.
MAX_CONTACTS = 10_000
MAX_STEPS = 1_000_000
#: Largest `tol` of a run whose forces get proved bounds: what its steps leave of the contact laws
#: widens them (a hub's: 2.2 % at 1e-3, 1.7 % at 1e-4, 1.5 % at 1e-5).
PROOF_TOL = 1e-4


@dataclass(frozen=True)
class Settings:
    """Options of the integration of a scene, as for `Scene.run`."""

    tol: float = 1e-3  # relative error of the contact forces
    method: str = "exact"  # one of `METHODS`
    step: float | None = None  # time step in contact [s]; None: chosen from `tol`
    max_contacts: int = MAX_CONTACTS  # number of touches at which the run stops
    max_steps: int = MAX_STEPS  # number of attempted steps at which it stops

    def __post_init__(self) -> None:
        checks.choice("method", self.method, METHODS)
        checks.store(
            self,
            tol=checks.tolerance(self.tol),
            max_contacts=checks.whole("max_contacts", self.max_contacts),
            max_steps=checks.whole("max_steps", self.max_steps),
        )

    def for_proof(self) -> Settings:
        """These options with the fine time steps that proved bounds need."""
        return replace(self, tol=min(self.tol, PROOF_TOL))
