"""Random masses on springs that rub: the engine's errors beside those that it claims.

    python benchmarks/friction_scenes.py [TOL] [NUMBER]

The truth is that of `tests/support/sliding.py`.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests" / "support"))

from sliding import Truth, errors, random_scene, run_scene

SCENES = 161


def main(tol: float = 1e-3, number: int = SCENES) -> None:
    """Print each scene's errors beside the claimed ones, and how many keep them."""
    forces, kept, claims = 0, 0, 0
    for seed in range(number):
        scene = random_scene(seed)
        found = run_scene(scene, tol)
        error = errors(Truth(scene), found)
        worst = max(error.force, error.peak)
        within = max(worst, error.way) <= tol
        holds = (error.force <= found.force) + (worst <= found.peak)
        forces += worst <= tol
        kept += within
        claims += holds
        print(
            f"{seed:4d} force {error.force:8.1e} claimed {found.force:8.1e}  peak {error.peak:8.1e}"
            f" claimed {found.peak:8.1e}  displacement {error.way:8.1e}  steps {found.run.steps}"
            f" attempts {found.run.attempts}{'' if within else '  BEYOND TOL'}"
            f"{'' if holds == 2 else '  CLAIM'}",
            flush=True,
        )
    print(
        f"tol {tol:g}: of {number}, forces of {forces} within tol, and displacements of {kept};"
        f" {claims} of {2 * number} claims hold"
    )


if __name__ == "__main__":
    given = sys.argv[1:]
    main(*([float(given[0])] if given else []), *([int(given[1])] if len(given) > 1 else []))
