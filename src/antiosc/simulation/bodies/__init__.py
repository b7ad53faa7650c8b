"""What takes part in a scene: models, impactors, obstacles, rigid bodies."""
