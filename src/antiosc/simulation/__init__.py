"""Scenes of several bodies and contacts, and the march that integrates them."""

from antiosc.simulation.bodies import RigidBody, SiteModes
from antiosc.simulation.scene import Base, Contact, Load, Scene
from antiosc.simulation.scene_history import BodyHistory, ContactHistory, SceneHistory

__all__ = [
    "Base",
    "BodyHistory",
    "Contact",
    "ContactHistory",
    "Load",
    "RigidBody",
    "Scene",
    "SceneHistory",
    "SiteModes",
]
