"""Matrices of a reduced model, in the form in which another program takes it as a superelement.

With u (p,) the displacements of the sites and η (N,) the amplitudes of the constraint modes of unit
mass (Craig and Bampton, AIAA J. 6 (1968) 1313)

    K = diag(k0, ω_i²),    M = [[m_st, P], [Pᵀ, 1]],    P_i Pᵀ_i = m_i,

so that eliminating η gives Z(ω). One site has P_i = √m_i.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from antiosc.base import checks, files
from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError
from antiosc.base.texts import Given
from antiosc.io.dof_map import component_of
from antiosc.io.matrices import matrix_formats, write_matrix_market

#: Names of K and M in OP4 and DMIG files.
NAMES = ("KAA", "MAA")


@dataclass(frozen=True, eq=False)
class ReducedMatrices(Given):
    """K and M of a reduced model.

    Attributes
    ----------
    K, M : (n, n) N/m and kg, the dofs of the sites first, then one for each anti-oscillator.
    labels : (n, 2) node and dof (1 to 6; 0 for scalar points) of each row.
    """

    K: Array
    M: Array
    labels: IntArray

    def __post_init__(self) -> None:
        size = len(checks.array("K", self.K, (None, None)))
        labels = checks.array("labels", self.labels, (size, 2))
        if (labels != np.floor(labels)).any() or (labels < 0).any() or (labels >= 2**31).any():
            raise InputError("labels must be numbers of nodes and of their dofs.")
        for name in ("K", "M"):
            matrix = checks.array(name, getattr(self, name), (size, size))
            if not np.allclose(matrix, matrix.T, rtol=1e-9, atol=0):
                raise InputError(f"{name} must be symmetric.")
            checks.store(self, **{name: checks.kept(matrix)})
        checks.store(self, labels=checks.kept(labels.astype(np.int64)))

    def save(self, path: str | os.PathLike[str]) -> list[Path]:
        """Write K and M in the format that the ending of `path` names.

        `.op4`: Nastran OUTPUT4, binary, matrices KAA and MAA; `.pch`, `.dmig` or `.bdf`: DMIG cards
        (12 to 15 digits); `.mtx`: Matrix Market, two files `<name>_K.mtx` and `<name>_M.mtx`.
        Beside OP4 and Matrix Market `<name>.map` lists node and dof of each row, which
        `Structure.from_files(K, M, map=…)` reads.

        Returns
        -------
        list of Path
            The files written, each complete or absent.

        Raises
        ------
        InputError
            Another ending, or a file that cannot be written.
        """
        target = checks.path("path", path)
        ending = target.suffix.lower()
        matrices = dict(zip(NAMES, (self.K, self.M), strict=True))
        every = {one: form for form in matrix_formats() for one in form.endings}
        if (form := every.get(ending)) and form.write:
            with files.complete(target, "the matrices") as part:
                form.write(part, matrices, self.labels)
            return [target] if form.labelled else [target, self._map(target)]
        if ending != ".mtx":
            raise InputError(
                f"matrices are written to {', '.join(['.mtx', *every])}; got {target.name!r}."
            )
        written = []
        for letter, matrix in (("K", self.K), ("M", self.M)):
            one = target.with_name(f"{target.stem}_{letter}.mtx")
            with files.complete(one, "the matrices") as part, part.open("w") as out:
                write_matrix_market(out, matrix)
            written.append(one)
        return [*written, self._map(target)]

    def _map(self, target: Path) -> Path:
        path = target.with_suffix(".map")
        rows = "".join(f"{node} {component}\n" for node, component in self.labels)
        files.write_text(path, "# node dof\n" + rows, "the map")
        return path


def reduced_matrices(
    stiffness: Array,
    static_mass: Array,
    P: Array,
    omega: Array,
    slide: Array | None,
    nodes: int | Sequence[int] | None,
    dofs: int | str | Sequence[int | str],
    first: int | None,
) -> ReducedMatrices:
    """The matrices of k0, m_st (p, p), P (p, N) and omega (N,).

    `slide` (p, s) are rigid motions q of unit mass that hardly move the sites: u = u_e + slide q.
    `nodes`, `dofs`, `first`: see `AntiOscillators.to_matrices`.
    """
    count = len(stiffness)
    K = block_diag(stiffness, np.diag(omega**2))
    M = np.block([[static_mass, P], [P.T, np.eye(len(omega))]])
    if slide is not None and slide.size:
        rigid = slide.shape[1]
        K, M = block_diag(K, np.zeros((rigid, rigid))), block_diag(M, np.eye(rigid))
        T = np.eye(len(K))
        T[:count, -rigid:] = -slide
        K, M = T.T @ K @ T, T.T @ M @ T
    return ReducedMatrices(K, M, _labels(count, len(K), nodes, dofs, first))


def _labels(
    sites: int,
    size: int,
    nodes: int | Sequence[int] | None,
    dofs: int | str | Sequence[int | str],
    first: int | None,
) -> IntArray:
    given = list(range(1, sites + 1)) if nodes is None else _listed(nodes)
    numbers = [checks.whole("nodes", node, least=1) for node in given]
    each = _listed(dofs)
    each = each * sites if len(each) == 1 else each
    if len(numbers) != sites or len(each) != sites:
        raise InputError(
            f"nodes and dofs must name the {sites} site dofs; got {len(numbers)} nodes and "
            f"{len(each)} dofs."
        )
    start = max(numbers) + 1 if first is None else checks.whole("first", first, least=1)
    scalars = range(start, start + size - sites)
    if scalars.stop > 2**31:
        raise InputError(f"numbers of nodes must be below 2^31; got {max(numbers)} and {start}.")
    if set(scalars) & set(numbers):
        raise InputError(f"the scalar points from first = {start} on meet the nodes of the sites.")
    rows = [(n, component_of(d)) for n, d in zip(numbers, each, strict=True)]
    labels = np.array([*rows, *((number, 0) for number in scalars)], dtype=np.int64)
    if len(np.unique(labels, axis=0)) < size:
        raise InputError("nodes and dofs name one dof twice.")
    return labels.reshape(-1, 2)


def _listed(value: object) -> list[Any]:
    """The items of a list or tuple; any other value is one item."""
    return list(value) if isinstance(value, list | tuple | range) else [value]
