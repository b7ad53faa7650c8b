"""Parts under a static load, in equilibrium with it from the start."""

from __future__ import annotations

import antiosc as ao


def held(part: ao.Structure, site: ao.Site, force: float) -> tuple[ao.Structure, ao.SceneHistory]:
    """The part, and a short run of the scene in which a force at the site holds it deformed."""
    scene = ao.Scene(
        {"part": ao.extract(part, site, 3), "far": ao.Obstacle()},
        [ao.Contact("part", "far", ao.Linear(1.0), gap=1.0)],
        loads=[ao.Load("part", [0.0, 1.0], [force, force])],
        preload=True,
    )
    return part, scene.run(1e-6)
