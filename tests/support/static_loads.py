"""Parts under a static load, in equilibrium with it from the start."""

from __future__ import annotations

import antiosc as ao


def quiet(model: ao.AntiOscillators, force: float) -> ao.SceneHistory:
    """A short run of the scene in which a force at its site holds the model deformed."""
    scene = ao.Scene(
        {"part": model, "far": ao.Obstacle()},
        [ao.Contact("part", "far", ao.Linear(1.0), gap=1.0)],
        loads=[ao.Load("part", [0.0, 1.0], [force, force])],
        preload=True,
    )
    return scene.run(1e-6)


def held(part: ao.Structure, site: ao.Site, force: float) -> tuple[ao.Structure, ao.SceneHistory]:
    """The part, and the run in which a force at the site holds it."""
    return part, quiet(ao.extract(part, site, 3), force)
