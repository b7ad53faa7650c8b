"""The floor of a fall, and the law of its contact with a part, from curvature and materials."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import pi, sqrt
from typing import Any

import numpy as np

from antiosc import ContactLaw, ElasticPlastic, Gonthier, Power
from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.base.texts import FieldsRepr
from antiosc.engine.contact.choice import Choice, choose_law
from antiosc.engine.contact.curvature import CURVED
from antiosc.engine.contact.surfaces import RIGID_MATTER, Surface, matter_of
from antiosc_studies.drops.crushed import corner_law
from antiosc_studies.drops.free_body import FreeBody, State

#: Largest loss factor.
LARGEST_LOSS = 1.0


@dataclass(frozen=True)
class SoftLayer(FieldsRepr):
    """A soft sheet on a rigid floor, thin compared with the contact, for parts that are round where
    they land (`drop` refuses other parts).

    Parameters
    ----------
    thickness : float
        Thickness [m].
    E : float
        Modulus across the sheet [Pa]: Young's modulus for foam or felt; for rubber that cannot move
        sideways the larger modulus of confined compression.
    loss : float
        Loss factor: energy dissipated in a cycle over 2 pi times the stored energy. A bounce leaves
        exp(-pi loss) of the energy, like half a cycle of a spring with this loss factor.
    """

    thickness: float
    E: float
    loss: float = 0.0

    def __post_init__(self) -> None:
        checks.store(
            self,
            thickness=checks.positive("thickness", self.thickness, "m"),
            E=checks.positive("E", self.E, "Pa"),
            loss=checks.nonnegative("loss", self.loss),
        )
        if self.loss > LARGEST_LOSS:
            raise InputError(f"loss is a loss factor of at most {LARGEST_LOSS:g}; got {self.loss}.")


def layer_law(layer: SoftLayer, stiffness: float, exponent: float) -> ContactLaw:
    """The law F = stiffness delta^exponent with the energy loss of a layer."""
    if layer.loss == 0.0:
        return Power(stiffness, exponent)
    # half a cycle with the loss factor eta leaves exp(-pi eta) = e^2 of the energy
    return Gonthier(stiffness, float(np.exp(-pi * layer.loss / 2)), exponent)


@dataclass(frozen=True, eq=False)
class Floor(FieldsRepr):
    """The floor of a fall: the plane z = 0, the surface of a half-space or a rigid ground.

    For an impact on an elastic floor, such as a plate, use a `Scene` with models of both.

    Parameters
    ----------
    material : Solid or str, optional
        Material of the half-space, or its name; None: rigid.
    friction : float
        Coulomb's coefficient.
    restitution : float, optional
        Coefficient of restitution of the contact only, as between rigid bodies (Gonthier's law);
        None: elastic. Energy of vibrations of the part is lost in addition.
    layer : SoftLayer, optional
        A soft sheet on top, instead of the half-space.
    law : ContactLaw, optional
        Law of every contact, instead of the law from curvatures and materials.
    """

    material: Any = None
    friction: float = 0.0
    restitution: float | None = None
    layer: SoftLayer | None = None
    law: ContactLaw | None = None

    def __post_init__(self) -> None:
        matter_of(self.material)
        if hasattr(self.material, "section"):
            raise InputError(
                "a floor of a material is a half-space, without a thickness or a section: give "
                "a Solid; got "
                f"{checks.shown(self.material)}."
            )

        checks.store(self, friction=checks.nonnegative("friction", self.friction))
        if self.restitution is not None:
            e = checks.positive("restitution", self.restitution)
            if e > 1:
                raise InputError(f"restitution must lie in 0 < e <= 1; got {e:g}.")
            checks.store(self, restitution=e)

        if self.layer is not None:
            checks.instance("layer", self.layer, SoftLayer, "a SoftLayer(thickness, E)")
        if self.law is not None:
            checks.instance("law", self.law, ContactLaw, "a ContactLaw such as Hertz")

        kinds = [n for n in ("material", "layer", "law") if getattr(self, n) is not None]
        if len(kinds) > 1:
            raise InputError(f"a floor takes one of material, layer and law; got {kinds}.")
        if self.law is not None and self.restitution is not None:
            raise InputError("a floor with its own law takes no restitution: the law has it.")
        if self.layer is not None and self.restitution is not None:
            raise InputError(
                "a floor with a layer takes no restitution: give the layer a loss, which leaves "
                "the restitution exp(-pi loss/2)."
            )

    @property
    def rigid(self) -> bool:
        """Whether the floor is rigid: without material, layer and law."""
        return all(x is None for x in (self.material, self.layer, self.law))

    @cached_property
    def face(self) -> Surface:
        """The flat face of the floor's material."""
        return Surface(matter_of(self.material) or RIGID_MATTER)


def as_floor(floor: object) -> Floor:
    """The argument `floor` as a Floor (None: rigid); InputError, with an example, if invalid."""
    if isinstance(floor, Floor):
        return floor
    if floor is None:
        return Floor()

    example = "a Floor of a Solid"
    if callable(getattr(floor, "constants", None)):
        example = "a Floor of this material"
    elif isinstance(floor, SoftLayer):
        example = "a Floor with this layer"
    elif isinstance(floor, ContactLaw):
        example = "a Floor with this law"
    elif callable(getattr(floor, "modal", None)):
        example = "a Scene of the part and this model"

    raise InputError(f"floor must be a Floor; write {example}; got {checks.shown(floor)}.")


@dataclass(frozen=True, eq=False)
class Setting:
    """The conditions of a fall."""

    floor: Floor
    gravity: float  # [m/s^2]
    height: float  # of the lowest point at the start [m]
    impacts: float  # the fall ends at this number of them at the latest
    duration: float  # or at this time [s]
    tol: float  # relative error of the contact forces


def contact_law(floor: Floor, surface: Surface) -> ContactLaw:
    """The contact law of a surface with a floor."""
    if floor.law is not None:
        return floor.law
    if floor.layer is not None:
        # F = pi E sqrt(R1 R2) delta^2/thickness, the elastic foundation (Johnson 1985, 4.3)
        first, second = surface.curvatures
        curvature = sqrt(first * second)
        if curvature == 0.0:
            raise InputError("a line or a plane on a layer has no law of its own: give a radius.")
        return layer_law(floor.layer, pi * floor.layer.E / (curvature * floor.layer.thickness), 2.0)

    return law_choice(floor, surface).law


def law_choice(floor: Floor, surface: Surface) -> Choice:
    """The choice of a law for a surface and the material of the floor, with its reasons."""
    if surface.matter.rigid and floor.face.matter.rigid:
        raise InputError(
            "a rigid part on a rigid floor has no law of contact: give the floor a material, a "
            "layer or a law."
        )

    return choose_law(surface, floor.face, floor.restitution)


def surface_at(body: FreeBody, index: int) -> Surface:
    """The surface of a body at its point `index`."""
    low, high = np.sort(1 / body.radii[index]).tolist()
    return Surface(body.materials[index], (low, high), kind=CURVED)


def law_at(body: FreeBody, floor: Floor, index: int) -> ContactLaw:
    """The contact law of a floor with the point `index` of a body."""
    return contact_law(floor, surface_at(body, index))


def touch_law(body: FreeBody, start: State, floor: Floor, index: int, r: Array) -> ContactLaw:
    """The contact law of a point that touches in a state; `corner_law` for a sharp corner.

    r : position (3,) of the point relative to the centre of mass [m].
    """
    ball = law_at(body, floor, index)
    edges = body.facets.get(index)
    if edges is None or not isinstance(ball, ElasticPlastic):
        return ball

    return corner_law(ball, edges, body, start, r)
