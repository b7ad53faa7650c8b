"""Natural modes of a structure on its supports: frequencies, participation, shapes."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from antiosc.base import checks, files
from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError
from antiosc.base.process import one_thread
from antiosc.base.texts import Brief
from antiosc.fem.extraction.eigenmodes import ModeSolver
from antiosc.fem.extraction.oscillators import REPEATED
from antiosc.fem.extraction.self_check import check_modes
from antiosc.fem.extraction.site_shapes import weights_of
from antiosc.fem.fields import source
from antiosc.fem.fields.series import Frames
from antiosc.fem.platform.mpi import collective, on_root
from antiosc.fem.structure.structure import Structure

#: Modes that are searched beyond those asked; of a repeated last one twice as many each time.
BEYOND = 1


@dataclass(frozen=True, eq=False, repr=False)
class StructureModes(Brief):
    """The lowest natural modes of a structure, ascending; rigid-body modes first.

    Attributes
    ----------
    omega : (n,) circular frequencies, rad/s; exactly 0 of rigid-body modes.
    multiplicity : (n,) number of modes that the structure has of each frequency. Frequencies that
        differ by less than 1e-6 are one; the shapes of a repeated one are any basis of their space.
    participation : (n, 3) modal force of a unit acceleration of the supports along x, y, z,
        φᵀMe, kg^1/2; None for given matrices without coordinates.
    mass : total mass, kg; None where it is not known.
    shapes : (rows of this rank, n) of unit modal mass, kg^-1/2.
    structure : the structure.

    The sum of the effective masses over all modes is the mass that moves: the total mass without
    what the supports hold.
    """

    omega: Array
    multiplicity: IntArray
    participation: Array | None
    mass: float | None
    shapes: Array
    structure: Structure = field(repr=False)

    @property
    def n(self) -> int:
        """Number of modes."""
        return len(self.omega)

    @property
    def frequency(self) -> Array:
        """(n,) frequencies, Hz."""
        return self.omega / (2 * np.pi)

    @property
    def effective_mass(self) -> Array | None:
        """(n, 3) effective masses along x, y, z: the squares of the participation, kg."""
        return None if self.participation is None else self.participation**2

    def summary(self) -> str:
        """A table: frequency, multiplicity and effective masses as shares of the total mass."""
        rows = [f"{'mode':>4} {'Hz':>12} {'times':>5}"]
        shares = self.effective_mass
        if shares is not None:
            rows[0] += "".join(f" {'m_eff ' + axis:>9}" for axis in "xyz")
            shares = shares / (self.mass or 1.0)
        for i, f in enumerate(self.frequency):
            row = f"{i + 1:>4} {f:>12.6g} {self.multiplicity[i]:>5}"
            if shares is not None:
                row += "".join(f" {share:>9.2%}" for share in shares[i])
            rows.append(row)
        if shares is not None:
            total = " ".join(f"{share:>9.2%}" for share in shares.sum(axis=0))
            rows.append(f"{'sum':>4} {'':>12} {'':>5} {total}")
        return "\n".join(rows)

    @collective()
    def write(self, path: str | Path) -> Path:
        """Write the shapes to one `.vtu` file, which ParaView opens; a field for each mode.

        The fields are "mode 1" and on, scaled to a largest displacement of 1; warp by one of them.

        Raises
        ------
        InputError
            The file cannot be written; matrices without coordinates.
        """
        target = checks.new_file("path", path)
        if target.suffix.lower() != ".vtu":
            target = target.with_name(f"{target.name}.vtu")
        points, cells, shapes = source(self.structure).at_nodes(self.structure, self.shapes)

        def work() -> None:
            size = np.linalg.norm(shapes, axis=1).max(axis=0)
            scaled = shapes / np.where(size > 0, size, 1.0)
            fields = {f"mode {i + 1}": scaled[:, :, i] for i in range(self.n)}
            with files.complete(target, "the modes") as part:
                part.write_bytes(Frames(points, cells).content(fields))

        on_root(self.structure.comm, work)
        return target


@collective()
@checks.within_range
@one_thread()
def natural_modes(structure: Structure, n: int = 10) -> StructureModes:
    """The n lowest natural modes of a structure on its supports, rigid-body modes included.

    Parameters
    ----------
    structure : Structure
    n : int
        Number of modes; fewer if the structure has fewer.

    Returns
    -------
    StructureModes
        With frequencies, multiplicity, participation, effective masses and shapes.

    Raises
    ------
    InputError
        n above the number of dofs.
    NotConvergedError, AccuracyError
        A solver that failed, or modes that fail their own check.
    """
    checks.instance("structure", structure, Structure, "a Structure")
    n = checks.whole("n", n)
    if n > structure.dofs:
        raise InputError(f"n must be at most the structure's {structure.dofs} dofs; got {n}.")
    rigid = structure.rigid_modes
    elastic = max(0, n - rigid.shape[1])
    omega, shapes = np.zeros(rigid.shape[1]), rigid
    if elastic:
        solver = ModeSolver(structure)
        more = BEYOND
        found = solver.lowest(elastic + more)
        while not found.complete and found.omega[-1] <= (1 + REPEATED) * found.omega[elastic - 1]:
            more *= 2
            found = solver.lowest(len(found.omega) + more)
        check_modes(structure, found)
        omega = np.append(omega, found.omega)
        shapes = np.hstack([rigid, found.phi])
    count = _multiplicity(omega)
    try:
        mass: float | None = structure.mass
    except InputError:
        mass = None
    kept = shapes[:, :n]
    return StructureModes(
        omega=omega[:n],
        multiplicity=count[:n],
        participation=weights_of(structure, kept),
        mass=mass,
        shapes=kept,
        structure=structure,
    )


def _multiplicity(omega: Array) -> IntArray:
    """How many of the ascending frequencies (n,) are equal to each."""
    group = np.cumsum(np.diff(omega, prepend=-1.0) > REPEATED * omega) if omega.size else omega
    _, inverse, count = np.unique(group, return_inverse=True, return_counts=True)
    return np.asarray(count[inverse.ravel()])
