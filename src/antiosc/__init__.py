"""antiosc: impacts on structures by anti-oscillators, from a mesh to a force history.

Everything public is importable from here. Models, contact laws and `simulate` need NumPy and SciPy
alone; what reads meshes and extracts models needs the FE stack and is loaded when first used.
"""

from typing import Any

from antiosc.advise import Advice, advise
from antiosc.band import impact_band
from antiosc.batch import Batch, simulate_many, sweep
from antiosc.contact import (
    ContactLaw,
    Flores,
    Gonthier,
    Hertz,
    HuntCrossley,
    LankaraniNikravesh,
    Linear,
    Power,
    Stronge,
    Tabulated,
    TanSun,
    Thornton,
    YangSun,
)
from antiosc.errors import (
    AccuracyError,
    AccuracyWarning,
    AntioscError,
    AntioscWarning,
    InputError,
    MeshError,
    MissingDependencyError,
    NotConvergedError,
    OutOfMemoryError,
)
from antiosc.free_modes import from_free_modes
from antiosc.history import Energy, History
from antiosc.impact import simulate
from antiosc.impactor import Impactor, Obstacle, RigidMass, Sphere
from antiosc.modal import Damping, LinearBody, ModalBody
from antiosc.model import AntiOscillators
from antiosc.motion import Inertia, Motion
from antiosc.simulation import (
    Base,
    BodyHistory,
    Contact,
    ContactHistory,
    Load,
    RigidBody,
    Scene,
    SceneHistory,
    SiteModes,
)
from antiosc.truncation import choose_n, truncation_error

__version__ = "0.1.0"

_FEM = (
    "Beam",
    "ImpactMap",
    "Laminate",
    "Layer",
    "Mesh",
    "PointMass",
    "Section",
    "Shell",
    "Site",
    "Solid",
    "Spring",
    "Structure",
    "Support",
    "extract",
    "full",
    "impact_map",
    "probe",
    "read_mesh",
    "superposition",
    "write_series",
)

__all__ = [
    "AccuracyError",
    "AccuracyWarning",
    "Advice",
    "AntiOscillators",
    "AntioscError",
    "AntioscWarning",
    "Base",
    "Batch",
    "Beam",
    "BodyHistory",
    "Contact",
    "ContactHistory",
    "ContactLaw",
    "Damping",
    "Energy",
    "Flores",
    "Gonthier",
    "Hertz",
    "History",
    "HuntCrossley",
    "ImpactMap",
    "Impactor",
    "Inertia",
    "InputError",
    "Laminate",
    "LankaraniNikravesh",
    "Layer",
    "Linear",
    "LinearBody",
    "Load",
    "Mesh",
    "MeshError",
    "MissingDependencyError",
    "ModalBody",
    "Motion",
    "NotConvergedError",
    "Obstacle",
    "OutOfMemoryError",
    "PointMass",
    "Power",
    "RigidBody",
    "RigidMass",
    "Scene",
    "SceneHistory",
    "Section",
    "Shell",
    "Site",
    "SiteModes",
    "Solid",
    "Sphere",
    "Spring",
    "Stronge",
    "Structure",
    "Support",
    "Tabulated",
    "TanSun",
    "Thornton",
    "YangSun",
    "advise",
    "choose_n",
    "extract",
    "from_free_modes",
    "full",
    "impact_band",
    "impact_map",
    "probe",
    "read_mesh",
    "simulate",
    "simulate_many",
    "superposition",
    "sweep",
    "truncation_error",
    "write_series",
]


def __getattr__(name: str) -> Any:
    if name in _FEM:
        from antiosc import fem

        return getattr(fem, name)
    raise AttributeError(f"module 'antiosc' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *_FEM])
