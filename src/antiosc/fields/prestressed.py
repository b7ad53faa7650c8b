"""`PrestressedState`: the static state of a structure under its prestress, before an impact."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from antiosc.base._types import Array
from antiosc.base.checks import instance
from antiosc.base.errors import InputError
from antiosc.base.texts import ReprMixin, engineering
from antiosc.fem.platform import collective
from antiosc.fem.prestress import Prestress
from antiosc.fem.structure.structure import Structure
from antiosc.fields.peaks import PeakField, static_stress
from antiosc.fields.pictures import without_unused
from antiosc.recovery import source


class PrestressedState(ReprMixin):
    """The static state of a structure under its `Prestress`; `part.prestress` is one.

    Parameters
    ----------
    structure : Structure
        With a prestress.

    Attributes
    ----------
    loads : Prestress
    reserve : float
        Load factor to buckling: at which the tangent stiffness becomes singular if all loads
        (Ω² of a spin) grow in proportion and the stiffness does too; inf above 100.
    points : (P, 3) nodes of the mesh, m.
    displacement : (P, 3) at the points, m.
    stress : PeakField of the von Mises stress, with `values`, `margin()` and `plot()`.

    All ranks must ask for points, displacement and stress.

    Raises
    ------
    InputError
        A structure without prestress.
    """

    @collective()
    def __init__(self, structure: Structure) -> None:
        part = instance("structure", structure, Structure, "a Structure with prestress=")
        preload = part.matrices.preload
        if preload is None:
            raise InputError("the structure has no prestress: give Structure(…, prestress=…).")
        self._structure = structure
        self._preload = preload

    @property
    def loads(self) -> Prestress:
        return self._preload.loads

    @property
    def reserve(self) -> float:
        return self._preload.reserve

    @cached_property
    def _moved(self) -> tuple[Array, Array]:
        structure = self._structure
        points, cells, displacements = source(structure).at_nodes(
            structure, self._preload.q[:, None]
        )
        used, _ = without_unused(cells)
        points_and_motion: tuple[Array, Array] = structure.comm.bcast(
            (points[used], displacements[used, :, 0]), root=0
        )
        return points_and_motion

    @property
    def points(self) -> Array:
        return self._moved[0]

    @property
    def displacement(self) -> Array:
        return self._moved[1]

    @cached_property
    def stress(self) -> PeakField:
        return static_stress(self._structure)

    def _facts(self) -> list[tuple[str, str]]:
        facts = [("reserve", self._preload.reserve_text)]
        if self._structure.comm.size == 1:
            largest = float(np.linalg.norm(self.displacement, axis=1).max())
            facts += [("displacement", f"up to {engineering(largest, 'm')}")]
        if self.loads.spin is not None:
            facts += [("spin", f"{self.loads.spin.omega:g} rad/s, Coriolis forces left out")]
        return facts
