"""How good error bars of the largest stress of a struck sheet are, against meshes that resolve it.

The isotropic shells of `benchmarks/shell_error_bars.py`, supported, bear the slow blow of a heavy
mass on a patch of one thickness of radius. The reference has cells of half the size, and of half
the radius of the patch at the site. Stresses are compared for the same force; the bars are those of
the mesh alone.

    .venv/bin/python benchmarks/shell_stress_bars.py --help
"""

from __future__ import annotations

import tempfile
import warnings
from pathlib import Path
from typing import NamedTuple

import numpy as np
import options
from shell_error_bars import CURVED, Case, drawn, geometry, site_of, structure

import antiosc as ao

#: Lowest periods of the part in half a period of the blow.
SLOW = 15
#: Errors below this share are those of the reference.
LEAST = 0.01


class Found(NamedTuple):
    """Number and shape, size of the cells over the radius of the patch, relative error of the
    largest stress, and the ends of its bar over itself.
    """

    number: int
    shape: str
    cells: float
    error: float
    low: float
    high: float

    @property
    def holds(self) -> bool:
        """Whether the stress of the reference lies in the bar."""
        true = 1 / (1 + self.error)
        return self.low - LEAST <= true <= self.high + LEAST

    def __str__(self) -> str:
        holds = "holds" if self.holds else "**no**"
        ends = f"{self.low - 1:+.0%} to {self.high - 1:+.0%}"
        return (
            f"| {self.number} {self.shape} | {self.cells:.1f} | {self.error:+.1%} | {ends} |"
            f" {holds} |"
        )


def struck(case: Case, mesh: ao.Mesh) -> tuple[float, ao.results.Margin]:
    """(peak force, worst point) of a shell on a mesh."""
    part = structure(case, mesh)
    model = ao.extract(part, site_of(case), n=2)
    mass = 2 * part.mass
    omega = model.modal().omega[0] / (2 * SLOW)
    blow = ao.RigidMass(mass, 1.0), ao.Linear(mass * omega**2)
    hit = ao.simulate(model, *blow, duration=1.2 * np.pi / omega)
    worst = ao.peak_field(part, hit, "von_mises", sharp_edges=False).worst_point
    assert worst is not None
    return hit.peak_force, worst


def tried(case: Case, path: Path, share: float) -> Found:
    """What is found for a shell with cells of a share of its own size."""
    path.write_text(geometry(case))
    order = 2 if case.shape in CURVED else 1
    at_site = [(tuple(site_of(case).point), case.thickness / 2)]
    mesh = ao.read_mesh(path, size=case.size * share, order=order)
    fine = ao.read_mesh(path, size=case.size / 2, order=order, refine=at_site)
    (force, coarse), (of_fine, true) = (struck(case, each) for each in (mesh, fine))
    error = coarse.stress / force / (true.stress / of_fine) - 1
    low, high = (end / coarse.stress for end in coarse.stresses)
    cells = share * case.size / case.thickness
    return Found(case.number, case.shape, cells, error, low, high)


def main(shells: int = 16, seed: int = 0) -> list[Found]:
    """Try `shells` random shells with two sizes of cells; print a table, and what holds."""
    done = []
    print("| shell | cells over patch | error | bar | |\n|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", ao.AntioscWarning)
        for number in range(shells):
            case = drawn(number, np.random.default_rng([seed, number]))
            case.layered = False
            if case.ends == "free":
                case.ends = "soft"
            for share in (1.0, 0.5):
                done.append(tried(case, Path(folder) / "shell.geo", share))
                print(done[-1], flush=True)
    errors, highs = np.array([(abs(found.error), found.high - 1) for found in done]).T
    print(
        f"\n{sum(found.holds for found in done)} of {len(done)} bars hold; median error"
        f" {np.median(errors):.1%}, median bar +{np.median(highs):.0%}"
    )
    return done


if __name__ == "__main__":
    options.command(main)
