"""The signals of a blow: an impact on the struck place, and what the sensors see of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from antiosc.base._types import Array
from antiosc.contact import ContactLaw, Linear
from antiosc.models.body import InModes
from antiosc.models.modal import ModalBody
from antiosc.simulation.bodies.impactors import RigidMass
from antiosc.simulation.histories.history import History
from antiosc.simulation.integrators.comparison import Settings
from antiosc.simulation.problem.impacts import Impact
from antiosc.simulation.simulate import impact
from antiosc.studies.find.recording import Recording
from antiosc.studies.find.surface import Chart, Surface

#: Steps of an impact over its contact time, or the shortest time between two samples.
STEPS = 150
#: Most contacts of a blow.
CONTACTS = 1000


@dataclass(frozen=True, eq=False)
class Blow:
    """One candidate: a place beside a site, and the logarithms of what is unknown of the blow.

    Attributes
    ----------
    place : (3,) [m]; site : the next of the map.
    mass, velocity, stiffness : [kg], [m/s], [of the law].
    start : time of the first touch after the first sample [s].
    E : factor of the stiffness of the whole structure.
    lasting : expected contact time [s].
    frequency : (J,) relative changes of the natural frequencies.
    share : (m, J) relative changes of the modes' shares in the signals.
    """

    place: Array
    site: int
    mass: float
    velocity: float
    stiffness: float
    start: float
    lasting: float
    frequency: Array
    share: Array
    E: float = 1.0


@dataclass(frozen=True, eq=False)
class Seen:
    """What the sensors see of a blow, in the band and over their noise.

    Attributes
    ----------
    parts : (n', m, J) of each mode, without `Blow.share`.
    signals : (n', m); hit : the impact.
    """

    parts: Array
    signals: Array
    hit: History


@dataclass(frozen=True, eq=False)
class Struck:
    """The model: free modes, sites, sensors.

    Attributes
    ----------
    omega, decay : (J,) frequencies [rad/s] and decay constants [1/s].
    rows, orders : (m, J), (m,) of the sensors.
    table : (P, J + 2) b, residual compliance and local compliance of the sites.
    """

    data: Recording
    surface: Surface
    omega: Array
    decay: Array
    rows: Array
    orders: Array
    table: Array
    radius: Array
    law: ContactLaw

    @property
    def exponent(self) -> float:
        """Of the force over the indentation; 1.5 where the law has none."""
        if isinstance(self.law, Linear):
            return 1.0
        return float(getattr(self.law, "exponent", 1.5))

    def modes_at(self, chart: Chart, x: Array) -> Array:
        """(J + 2,) b, residual and local compliance at local coordinates x of a chart."""
        return np.asarray(chart.weights(x) @ self.table[chart.near])

    def hit(self, blow: Blow, seen: Array) -> History:
        """The impact on the place with `seen` (J + 2,)."""
        omega = self.omega * np.sqrt(blow.E) * (1 + blow.frequency)
        b, (r, local) = seen[:-2], np.maximum(seen[-2:], 0.0) / blow.E
        modes = ModalBody(omega, b, r=float(r), decay=self.decay)
        radius = float(self.radius[blow.site])
        body = InModes(modes, float(local), None if np.isnan(radius) else radius)
        law = self.law
        if hasattr(law, "stiffness"):
            law = replace(law, stiffness=blow.stiffness)  # type: ignore[type-var]
        end = len(self.data.values) * self.data.dt - blow.start
        step = min(blow.lasting / STEPS, end / 20)
        scene = Impact(body, RigidMass(blow.mass, blow.velocity), law, end)
        return impact(scene, Settings(1e-4, step=step, max_contacts=CONTACTS))[0]

    def seen(self, blow: Blow, at: Array) -> Seen:
        """What the sensors see of a blow on the place with `at` (J + 2,)."""
        hit = self.hit(blow, at)
        t = self.data.time - blow.start
        on = np.flatnonzero((t >= 0) & (t <= hit.run.time[-1]))
        J = len(self.omega)
        omega = self.omega * np.sqrt(blow.E) * (1 + blow.frequency)
        q, v = (x[:, :J] for x in hit.states(t[on]))
        a = hit.force_at(t[on])[:, None] * at[:J] - omega**2 * q - 2 * self.decay * v
        keep = self.data.filter[:, on]
        motions = {order: keep @ (q, v, a)[order] for order in set(self.orders.tolist())}
        rows = self.rows / self.data.sigma[:, None]
        parts = np.stack([motions[k] * row for k, row in zip(self.orders, rows, strict=True)], 1)
        return Seen(parts, np.sum(parts * (1 + blow.share), axis=2), hit)
