"""Material and shape of a surface, by which a contact law is chosen."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from math import inf, isinf
from typing import Any

from antiosc.base import checks
from antiosc.base.errors import InputError
from antiosc.engine.contact.curvature import CURVED, PLANE

#: Largest Young's modulus [Pa] and least Poisson's ratio of a rubber; the softest plastics that
#: yield, polyethylenes of low density, have 100 MPa and more.
RUBBER_E, RUBBER_NU = 60e6, 0.45


@dataclass(frozen=True)
class Matter:
    """The material of a surface in contact, SI units."""

    #: E, nu: Young's modulus [Pa], inf if rigid; Poisson's ratio
    E: float
    nu: float = 0.3
    yield_strength: float | None = None  # [Pa]; None: not known, or the material is `brittle`
    #: lowest and highest yield strength [Pa]; None: it is exact
    yield_range: tuple[float, float] | None = None
    #: D [1/s] and q of Cowper and Symonds, or None; a third number is the strength [Pa] that grows
    #: with the rate, in place of the yield strength
    rate: tuple[float, ...] | None = None
    brittle: bool = False  # whether it cracks, crushes or stretches before it yields
    loss: float = 0.0  # loss factor
    #: indentation from which a laminate is damaged [m]; None: no laminate
    critical: float | None = None
    name: str = ""  # name of the material; "" if its constants were given
    #: least and largest strength in tension [Pa] of a brittle material; None: not known
    tensile: tuple[float, float] | None = None

    @property
    def rigid(self) -> bool:
        """Whether the material is rigid."""
        return isinf(self.E)

    @property
    def known(self) -> bool:
        """Whether the onset of yield is known, or known not to occur."""
        return self.rigid or self.brittle or self.rubbery or self.yield_strength is not None

    @property
    def rubbery(self) -> bool:
        """Whether the elastic constants are typical of rubber, which does not yield."""
        return self.E <= RUBBER_E and self.nu >= RUBBER_NU and self.yield_strength is None

    def strengths_at(self, strain_rate: float) -> tuple[float, float]:
        """(lowest, highest) yield strength [Pa] between slow tests and a strain rate [1/s]."""
        slow_strength = self.yield_strength or 0.0
        low, high = self.yield_range or (slow_strength, slow_strength)
        if self.rate is None:
            return low, high

        from antiosc.base import materials  # loaded where it is used

        return low, max(high, materials.strength_at(self.rate, slow_strength, strain_rate))


RIGID_MATTER = Matter(inf)


def crack_note(sides: Iterable[Matter]) -> str:
    """Sentence: cracks of brittle sides of a contact are not computed; "" if no side is brittle."""
    names = dict.fromkeys(m.name or "the brittle side" for m in sides if m.tensile is not None)
    if not names:
        return ""
    return f"Whether {' or '.join(names)} cracks beside the contact is not computed."


@dataclass(frozen=True)
class Surface:
    """The surface of a body at a contact."""

    matter: Matter  # its material
    #: principal curvatures [1/m], ascending; < 0: hollow; for an edge or a corner those of the
    #: assumed radius
    curvatures: tuple[float, float] = (0.0, 0.0)
    error: float = 0.0  # bound on the error of the curvatures [1/m]
    kind: str = PLANE  # "plane", "line", "curved", "edge" or "corner", as of a `Curvature`
    #: (3,) unit vector of the first principal direction; None: not known, or none
    along: tuple[float, float, float] | None = None
    radius: float | None = None  # radius of the patch of the contact [m]; None: a point
    #: largest radius [m] of a ball that touches the body only at the contact; inf: no limit
    largest_ball: float = inf
    #: (3,) point [m] where a larger ball would also touch the body; None if there is no limit
    meets: tuple[float, float, float] | None = None

    def as_dict(self) -> dict[str, Any]:
        """The surface as JSON values."""
        table = asdict(self)
        table["matter"] = {key: v for key, v in table["matter"].items() if v is not None}
        return {key: value for key, value in table.items() if value is not None}

    @classmethod
    def of(cls, table: Mapping[str, Any]) -> Surface:
        """The surface from a table of `as_dict`; InputError for other tables."""
        try:
            values = {key: _tuple(value) for key, value in table.items()}
            material_values = {key: _tuple(value) for key, value in table["matter"].items()}
            surface = cls(**values | {"matter": Matter(**material_values)})
            checks.floats("curvatures", surface.curvatures, (2,))
            checks.nonnegative("error", surface.error)
            if not surface.largest_ball > 0:
                raise InputError(f"largest_ball must be > 0, got {surface.largest_ball}")
            return replace(surface, matter=_checked(surface.matter))
        except (InputError, KeyError, TypeError, AttributeError) as error:
            raise InputError(f"the surface of a site is damaged: {error}.") from None


def ball(matter: Matter, radius: float) -> Surface:
    """The surface of a ball of this radius [m]."""
    return Surface(matter, (1 / radius, 1 / radius), kind=CURVED)


def matter_of(
    material: object,
    E: float | None = None,
    nu: float | None = None,
    yield_strength: float | None = None,
) -> Matter | None:
    """The properties of a material (name or object); constants other than None replace them."""
    if material is None:
        if E is None:
            return None
        matter = Matter(E, 0.3 if nu is None else nu)
    elif isinstance(material, Matter):
        matter = material
    else:
        own = _by_name(material) if isinstance(material, str) else isotropic(material)
        if own is None:
            material_name = getattr(material, "name", "") or checks.shown(material)
            raise InputError(
                "material must be the name of a material without directions, or one of "
                f"E, nu and rho, as a Solid; got {material_name}."
            )
        matter = own

    overrides: dict[str, Any] = {}
    if E is not None:
        overrides["E"] = E
    if nu is not None:
        overrides["nu"] = nu

    if yield_strength is not None:
        strength = checks.positive("yield_strength", yield_strength, "Pa")
        if strength != matter.yield_strength:
            overrides |= {"yield_strength": strength, "yield_range": None, "brittle": False}
            overrides["tensile"] = None
            overrides["rate"] = matter.rate and matter.rate[:2]

    return replace(matter, **overrides) if overrides else matter


def density_of(material: object) -> float:
    """Density [kg/m^3] of a material: a name, or an object with `rho`."""
    if isinstance(material, str):
        from antiosc.base import materials  # loaded where it is used

        return materials.record(material).rho

    rho = getattr(material, "rho", None)
    if rho is None:
        raise InputError(f"the density of {checks.shown(material)} is not known: give rho or mass.")
    return checks.positive("rho", rho, "kg/m^3")


@lru_cache(maxsize=64)
def _by_name(name: str) -> Matter | None:
    from antiosc.base import materials  # loaded where it is used

    return isotropic(materials.record(name))


def isotropic(material: object) -> Matter | None:
    """The constants of a `Solid`, `Shell`, `Beam` or record; None if it is anisotropic."""
    E = getattr(material, "E", None)
    nu = getattr(material, "nu", None)
    if not isinstance(E, int | float) or not isinstance(nu, int | float):
        return None

    names = ("yield_strength", "yield_range", "rate", "brittle", "loss", "name", "tensile")
    return Matter(E, nu, **{name: getattr(material, name) for name in names})


def _checked(matter: Matter) -> Matter:
    """Check the properties of a material that were read from a file."""
    checks.poisson(matter.nu)

    for name in ("E", "yield_strength", "critical"):
        value = getattr(matter, name)
        if value is not None and not checks.is_rigid(value):
            checks.positive(name, value)

    for name in ("yield_range", "tensile"):
        if getattr(matter, name) is not None:
            checks.floats(name, getattr(matter, name), (2,))

    return matter


def _tuple(value: Any) -> Any:
    if isinstance(value, list):
        return tuple(value)
    return value
