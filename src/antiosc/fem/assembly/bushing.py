"""`Bushing`: springs between two ends."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.sparse

from antiosc._types import Array
from antiosc.checks import coordinates, positive, shown
from antiosc.declared import checked_by
from antiosc.errors import InputError
from antiosc.fem.assembly.ends import End, Motion, end_text, motion
from antiosc.fem.assembly.joint import NAME, Between, Stiffness
from antiosc.fem.assembly.layout import Layout
from antiosc.fem.assembly.pins import COINCIDENT, carried
from antiosc.fem.structure.member import DISPLACEMENTS, ROTATIONS

AXES = (*DISPLACEMENTS, *ROTATIONS, "axial")


def _by_components(what: str, given: Any) -> dict[str, float]:
    """Stiffness or damping by components."""
    if not isinstance(given, Mapping):
        raise InputError(f"the {what} of a Bushing is a dict, as {{'z': 1e6}}; got {shown(given)}.")
    for name in given:
        if not isinstance(name, str) or name not in AXES:
            raise InputError(
                f"a Bushing acts on {', '.join(AXES)}; {shown(name)} is not one of them."
            )
    return {name: positive(f"the {what} of {name}", value) for name, value in given.items()}


@dataclass(frozen=True)
class Bushing(Between):
    """Springs and dampers between two ends (CBUSH).

    Parameters
    ----------
    a, b : ends
        As for `Weld`.
    stiffness : dict
        Component -> stiffness: of "x", "y", "z" (N/m), "rx", "ry", "rz" (N m/rad) in the axes of
        the assembly, and "axial" (N/m) along the line between the ends. It may be empty beside
        dampers.
    point : sequence of floats, optional
        Where the springs of x … rz lie, m; default: at `a`. Ends that lie elsewhere are connected
        to it rigidly.
    name : str, optional
        What messages call the joint.
    damping : dict, optional
        Component -> N s/m or N m s/rad of a damper. Models take dampers as damping ratios of their
        free modes; `extract` refuses those that couple the modes.
    """

    stiffness: Mapping[str, float] = field(
        default_factory=dict, metadata=checked_by(_by_components)
    )
    point: Sequence[float] | None = field(default=None, metadata=checked_by(coordinates))
    name: str | None = field(default=None, metadata=NAME)
    damping: Mapping[str, float] = field(default_factory=dict, metadata=checked_by(_by_components))

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.stiffness and not self.damping:
            raise InputError(
                f"a Bushing needs a stiffness, as {{'z': 1e6}}, or a damping; got "
                f"{shown(self.stiffness)}."
            )

    def elastic(self, layout: Layout, label: str) -> list[Stiffness]:
        """k (b − a)² of each component."""
        a, b = (motion(layout, end, partly=True) for end in (self.a, self.b))
        names = list(dict.fromkeys([*self.stiffness, *self.damping]))
        found = []
        if "axial" in names:
            line = b.point - a.point
            length = float(np.linalg.norm(line))
            if length <= COINCIDENT * layout.size:
                raise InputError(f"{label} has no length: an axial spring needs two places.")
            _check_moves(label, "axial", line / length, (self.a, a), (self.b, b))
            found.append(
                scipy.sparse.csr_matrix(line / length) @ (b.displacements - a.displacements)
            )
        others = [name for name in names if name != "axial"]
        if others:
            x = a.point if self.point is None else np.pad(self.point, (0, 3 - len(self.point)))
            here = [carried(layout, label, e, m, x) for e, m in ((self.a, a), (self.b, b))]
            apart = scipy.sparse.vstack(
                [
                    here[1].displacements - here[0].displacements,
                    here[1].rotations - here[0].rotations,
                ]
            ).tocsr()
            for name in others:
                axis = (DISPLACEMENTS + ROTATIONS).index(name)
                if axis < 3:
                    _check_moves(label, name, np.eye(3)[axis], (self.a, here[0]), (self.b, here[1]))
                else:
                    for end, one in zip((self.a, self.b), here, strict=True):
                        if one.rotation_space[axis - 3, axis - 3] < 1 - 1e-6:
                            raise InputError(
                                f"{label} acts on {name}, a rotation that {end_text(end)} does "
                                "not have."
                            )
                found.append(apart[axis])
        G = scipy.sparse.vstack(found).tocsr()
        if not G.nnz:
            raise InputError(f"{label} joins nothing: none of its components can move.")
        order = (["axial"] if "axial" in names else []) + others
        k, c = (
            np.diag([given.get(name, 0.0) for name in order])
            for given in (self.stiffness, self.damping)
        )
        return [Stiffness(G, k, np.zeros_like(k), c=c if self.damping else None)]


def _check_moves(label: str, name: str, direction: Array, *ends: tuple[End, Motion]) -> None:
    """InputError where an end does not move along the direction of a spring."""
    for end, one in ends:
        if one.displacements.nnz and not one.along(one.displacement_space, direction):
            raise InputError(
                f"{label} acts on {name}, a displacement that {end_text(end)} does not have."
            )
