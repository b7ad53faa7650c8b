"""Every public callable with sound arguments, and values that no argument or only some may be.

What is public is enumerated, so that a new function or method is tried by itself; a parameter whose
name is not known here asks for a sound value.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import importlib.util
import inspect
import math
import os
import signal
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

import antiosc as ao
from antiosc import closed_form, plotting
from antiosc.base import lazily
from paths import DECKS

MODULES = {
    "": (ao, [*ao._MODULES]),
    "closed_form.": (closed_form, closed_form.__all__),
    "plotting.": (plotting, [name for name in vars(plotting) if name.startswith("plot_")]),
}

#: Steps of the march and of the assembly: they are called with what antiosc itself has checked,
#: a contact law's methods a million times a run.
INNER = {
    *(
        "force",
        "tangent",
        "energy",
        "energies",
        "forces_at_rest",
        "touch",
        "advance",
        "origin",
        "lost",
        "damping",
    ),
    "potential",
    *(
        "implicit",
        "out_of_range",
        "enough_radius",
        "without",
        "loading_work",
        "permanent",
        "parameters",
    ),
    *("weak_form", "half_space_compliance", "shear_stiffness"),
    *("rotary_inertia", "dimensions", "bar_speed", "constants"),
    *("worst", "animate"),  # of a fall: need a mesh, and a second
    *("node", "numbered", "close"),  # `Site(node=)` and `Support(nodes=)` check them; a view
    *("prepare", "constraints", "elastic", "label", "placed", "own", "components", "selected"),
}
#: What functions return: antiosc alone makes them.
RESULTS = {
    *("Advice", "Energy", "History", "ImpactMap"),
    *("BodyHistory", "ContactHistory", "SceneHistory", "StructureModes"),
    *("ShockSpectrum", "PeakField", "Reactions", "BodyEnergy"),
    *("NamedImpactor", "SavedHistory", "ContactStress", "Fall", "Many"),
    *("ForceComparison", "FoundImpact", "Gradient", "Margin", "DesignMap"),
    *("Quantile", "Peak", "View", "Dent", "Enclosure"),
    "Hysteretic",  # a base of laws
}
#: Where NaN stands for "no such number", as the documentation says.
NONE_IS_NAN = {"restitution", "error", "dents"}

#: Seconds of the processor after which a call counts as hanging.
PATIENCE = 20.0


class Unprintable:
    """An object that is of no use and cannot even be shown."""

    def __repr__(self) -> str:
        raise RuntimeError("no repr")


class Rude:
    """An object that refuses to be an array, a number or a sequence."""

    def __array__(self, *args: Any, **kwargs: Any) -> Any:
        raise RuntimeError("no array")

    def __float__(self) -> float:
        raise RuntimeError("no float")

    def __len__(self) -> int:
        raise RuntimeError("no len")

    def __iter__(self) -> Iterator[Any]:
        raise RuntimeError("no iter")


TYPES: list[Any] = [
    *(None, True, False, "", "1e9", "x" * 300, "a\0b", b"12", 3, 0, -1, 2.0, 1.5, object(), float),
    *(1j, 1 + 1e-9j, np.complex128(2), np.bool_(True), np.array(2.0), np.array("1"), np.float32(1)),
    *([], (), {}, set(), [None], ["a"], [[]], [[1.0], [1.0, 2.0]], [1.0, 1.0], [1.0, 1.0, 1.0]),
    *((0.0, 0.0), (1.0, 2.0, 3.0, 4.0), {"a": 1.0}, [1.0, True], [1.0, "2"], [1.0, None]),
    *(np.zeros(0), np.zeros((0, 3)), np.ones(3), np.ones((3, 3)), np.ones(2, dtype=complex)),
    *(np.array([1, "a"], dtype=object), np.ma.array([1.0, 2.0], mask=[0, 1]), np.ma.masked),
    *(np.ones(3, dtype=bool), np.datetime64(0, "s"), range(3), Unprintable(), Rude(), slice(None)),
    *(Ellipsis, NotImplemented, np.dtype(float), min, lambda *args: args),
]
EXTREMES: list[Any] = [
    *(float("nan"), math.inf, -math.inf, 10**400, -(10**400), 2**53, 2**63, -(2**31)),
    *(1e300, -1e300, 1e-300, 5e-324, -5e-324, 1e60, 1e-60, -1e60, 1e30, 1e-30, 1e15, 1e-15, -1e-15),
    *([1e300, 1e-300], [math.nan, 1.0], [math.inf, 1.0, 1.0], [1e60, 1e-60, 0.0], np.full(3, 1e30)),
]


class Hang(BaseException):
    """A call that takes too long."""


@contextmanager
def patience(seconds: float = PATIENCE) -> Iterator[None]:
    """Hang where the block does not end."""

    def ring(*_: Any) -> None:
        raise Hang(f"longer than {seconds:g} s")

    before = signal.signal(signal.SIGPROF, ring)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def public() -> dict[str, Callable[..., Any]]:
    """Name -> function, constructor or method; a method takes its object as `self`."""
    found: dict[str, Callable[..., Any]] = {}
    for prefix, (module, names) in MODULES.items():
        for name in names:
            if name in SHOWN or (is_fem(name) and importlib.util.find_spec("dolfinx") is None):
                continue
            thing = getattr(module, name)
            if thing in (getattr(ao, n, None) for n in [*ao._MODULES]) and prefix:
                continue
            if inspect.isfunction(thing):
                found[prefix + name] = thing
            elif inspect.isclass(thing) and not issubclass(thing, (BaseException, tuple)):
                found |= {prefix + key: value for key, value in _of_class(thing).items()}
    return found


#: They open a browser; tests/page/test_open.py gives them what is no part.
SHOWN = {"view"}


def is_fem(name: str) -> bool:
    """Whether the function, or the class of the method, needs the finite-element packages."""
    module = ao._MODULES.get(name.partition(".")[0], "")
    return module.startswith(lazily.MESHED)


def _of_class(kind: type) -> dict[str, Callable[..., Any]]:
    found: dict[str, Callable[..., Any]] = {}
    made = not inspect.isabstract(kind) and not getattr(kind, "_is_protocol", False)
    if made and kind.__name__ not in RESULTS:
        found[kind.__name__] = kind
    for key, value in inspect.getmembers(kind):
        inner = key.startswith("_") or key in INNER
        if inner or not callable(value) or getattr(object, key, None) is value:
            continue
        if inspect.isclass(value) or not getattr(value, "__module__", "").startswith("antiosc"):
            continue
        if made or inspect.ismethod(value):
            found[f"{kind.__name__}.{key}"] = value
    return found


def parameters(call: Callable[..., Any]) -> dict[str, inspect.Parameter]:
    """Those that a caller gives; without *args and **kwargs."""
    given = inspect.signature(call).parameters
    many = (inspect.Parameter.VAR_KEYWORD, inspect.Parameter.VAR_POSITIONAL)
    return {name: p for name, p in given.items() if p.kind not in many}


@functools.cache
def model() -> ao.AntiOscillators:
    return ao.AntiOscillators(
        m0=0.1, k0=1e6, m=[0.3, 0.1], omega=[2e3, 9e3], participation=[0.2, 0.3, 0.1],
        shapes=np.arange(12.0).reshape(4, 3), strain_error=1e4 * np.eye(3),
    )  # fmt: skip


@functools.cache
def beam() -> Any:
    return closed_form.UniformBeam.timoshenko(
        E=70e9, nu=0.3, rho=2700, area=2e-4, inertia=3e-9, length=1.0
    )


@functools.cache
def struck() -> Any:
    return closed_form.pinned_pinned(beam(), 0.3)


@functools.cache
def history() -> ao.History:
    return ao.simulate(model(), sphere(), ao.Hertz(1e9), 1e-3)


def sphere() -> ao.Sphere:
    return ao.Sphere(0.01, 210e9, 0.3, 7850.0, 1.0)


def run(each: Any, tol: float) -> ao.History:
    return ao.simulate(each, sphere(), ao.Hertz(1e9), 1e-3, tol=tol)


@functools.cache
def mesh() -> Any:
    import dolfinx
    from mpi4py import MPI

    box = dolfinx.mesh.create_box(MPI.COMM_WORLD, [[0, 0, 0], [0.1, 0.1, 0.02]], [2, 2, 1])
    return ao.read_mesh(box)


@functools.cache
def part() -> Any:
    alloy = ao.Solid(70e9, 0.3, 2700.0, yield_strength=2e8)
    return ao.Structure(mesh(), alloy, [ao.Support(lambda x: x[0] < 1e-9)])


@functools.cache
def loaded_part() -> Any:
    held = [ao.Support(lambda x: x[0] < 1e-9)]
    loads = ao.Prestress(gravity=(0, 0, -9.81))
    return ao.Structure(mesh(), ao.Solid(70e9, 0.3, 2700.0), held, prestress=loads)


def frf_values() -> Any:
    iw = 2j * np.pi * np.arange(1.0, 41.0)
    return 1 / (1e4 + 4.0 * iw + iw**2)


@functools.cache
def frf() -> Any:
    return ao.FRF(np.arange(1.0, 41.0), frf_values(), "receptance")


@functools.cache
def frf_file() -> str:
    path = os.path.join(tempfile.mkdtemp(prefix="antiosc-nasty-"), "sound.csv")
    H = frf_values()
    rows = np.column_stack([np.arange(1.0, 41.0), H.real, H.imag])
    np.savetxt(path, rows, delimiter=",", header="frequency (Hz),real,imag", comments="")
    return path


def inertia() -> Any:
    return ao.Inertia((0, 0, 0), np.eye(6), np.ones((3, 6)))


def fall(**more: Any) -> Any:
    floor = ao.Floor(law=ao.HuntCrossley(1e8, 0.3))
    return ao.drop(sphere(), 0.01, floor=floor, until=1, tol=1e-2, **more)


def square(x: float) -> float:
    return x * x


def spread() -> Any:
    return ao.monte_carlo(square, {"x": ao.normal(0.0, 1.0)}, 60)


def scene() -> Any:
    block = ao.RigidBody(0.1, np.full(3, 1e-4), {"foot": ((0, 0, 0.01), (0, 0, -1))})
    return ao.Scene(
        {"part": block, "ball": sphere()}, [ao.Contact("part:foot", "ball", ao.Linear(1e6))]
    )


@functools.cache
def scene_history() -> Any:
    return scene().run(1e-3)


@functools.cache
def matrix_file() -> str:
    path = os.path.join(tempfile.mkdtemp(prefix="antiosc-nasty-"), "sound.mtx")
    return str(model().to_matrices().save(path)[0])


@functools.cache
def saved() -> str:
    path = os.path.join(tempfile.mkdtemp(prefix="antiosc-nasty-"), "sound.npz")
    model().save(path)
    return path


@functools.cache
def saved_history() -> str:
    path = os.path.join(tempfile.mkdtemp(prefix="antiosc-nasty-"), "sound.npz")
    return str(history().save(path))


def place() -> Any:
    return ao.Site((0.1, 0.1, 0.02), (0, 0, -1), radius=0.05)


@functools.cache
def struck_part() -> ao.History:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ao.AntioscWarning)
        return ao.simulate(ao.extract(part(), place(), 3), sphere(), ao.Linear(1e6), 1e-3)


@functools.cache
def design() -> Any:
    return ao.design_map(part(), struck_part(), "impulse", "rho")


@functools.cache
def surface_map() -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ao.AntioscWarning)
        at = [(0.1, 0.1, 0.02), (0.1, 0.0, 0.02)]
        return ao.impact_map(part(), at, direction=(0, 0, -1), radius=0.05, n=2, modes=4)


@functools.cache
def found_blow() -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ao.AntioscWarning)
        return ao.find_impact(part(), **{k: arguments(v) for k, v in OWN["find_impact"].items()})


def arguments(value: Any) -> Any:
    return value() if callable(value) else value


def two_sites() -> Any:
    """A model of two sites with one anti-oscillator, and its shapes."""
    return ao.AntiOscillators(
        m0=0.1 * np.eye(2), k0=1e6 * np.eye(2), P=[[0.2], [0.3]], omega=[1e3],
        sites=["foot", "tip"], shapes=np.eye(3),
    )  # fmt: skip


@functools.cache
def struck_at_two_sites() -> Any:
    contact = ao.Contact("part:foot", "ball", ao.Linear(1e6))
    return ao.Scene({"part": two_sites(), "ball": sphere()}, [contact]).run(1e-4)


def matrices() -> tuple[Any, Any]:
    K = np.diag([2e6, 2e6, 1e6]) - np.diag([1e6, 1e6], 1) - np.diag([1e6, 1e6], -1)
    return K, np.eye(3)


def pushed(x: Any) -> tuple[Any, ...]:
    """Arguments of `simulate` for a mass and a speed."""
    return model(), ao.RigidMass(x[0], x[1]), ao.Linear(1e6), 3e-3


CARBON = {"E1": 140e9, "E2": 9e9, "nu12": 0.3, "G12": 5e9, "G13": 5e9, "G23": 3e9}
PLY = ao.Layer(**CARBON, rho=1600.0, thickness=1e-3)
DIAGONAL = np.diag([2e8, 2e8, 8e7])

#: name of a parameter -> a value that is right wherever no entry of OWN says otherwise
COMMON: dict[str, Any] = {
    **CARBON, "E": 70e9, "nu": 0.3, "rho": 2700.0, "thickness": 5e-3, "mass": 0.1, "velocity": 1.0,
    "stiffness": 1e8, "exponent": 1.5, "restitution": 0.8, "radius": 0.01, "critical": 1e-5,
    "yield_indentation": 1e-5, "E_star": 1e11, "yield_pressure": 1e9, "compliance": 1e-9,
    "radii1": 0.01, "E1": 210e9, "nu1": 0.3, "indentation": [0.0, 1e-5, 3e-5],
    "force": [0.0, 1.0, 5.0], "E2": 9e9, "duration": 1e-3, "omega": [1e3, 5e3], "b": [0.5, 0.4],
    "m0": 0.1, "k0": 1e6, "m": [0.2, 0.3], "n": 2, "t": 1e-4, "d": 0.7, "A": 1e-4, "I": 1e-9,
    "width": 0.01, "height": 0.02, "axis": (1.0, 0.0, 0.0), "point": (0.1, 0.1, 0.02),
    "direction": (0.0, 0.0, -1.0), "angle": 30.0, "length": 1.0, "EI": 200.0, "rhoA": 0.5,
    "area": 2e-4, "inertia": 3e-9, "site": 0.3, "left": "pinned", "right": "free", "x": 0.02,
    "momenta": np.ones((2, 6)),
    "y": 0.03, "tol": 1e-3, "lam": 0.5, "D": 100.0, "surface_density": 10.0, "omega2": 1e6,
    "stress": 1e6 * np.eye(3), "tensor": 1e-3 * np.eye(3), "X": 1e9, "Y": 4e7, "S": 7e7,
    "where": (0.1, 0.1, 0.02), "a": 0.3, "path": "out.file", "i": 0, "q": [0.1, 0.2, 0.3],
}  # fmt: skip

BY_MAKER: dict[str, Callable[[], Any]] = {
    "beam": beam, "impactor": sphere, "body": model, "contact": lambda: ao.Hertz(1e9),
    "section": lambda: ao.Section(1e-4, 1e-9), "layers": lambda: [PLY, PLY.rotated(90)],
    "mesh": mesh, "material": lambda: ao.Solid(70e9, 0.3, 2700.0), "structure": part,
    "history": struck_part, "run": lambda: run, "model": model, "hits": history,
    "models": model, "impactors": sphere, "contacts": lambda: ao.Hertz(1e9),
    "source": lambda: mesh().dolfinx,
    "K": lambda: matrices()[0], "M": lambda: matrices()[1], "make": lambda: ao.RigidMass,
}  # fmt: skip

WOOD = {"E": (12e9, 9e8, 5e8), "nu": (0.4, 0.4, 0.4), "G": (8e8, 7e8, 7e7), "rho": 500.0}
STRENGTHS = {"X_t": 1.5e9, "X_c": 1.2e9, "Y_t": 4e7, "Y_c": 2e8, "S": 7e7}
ENDS = {"a": ("part", (0.1, 0.1, 0.02)), "b": "hub"}

OWN: dict[str, dict[str, Any]] = {
    "assemble": {"parts": lambda: {"part": part()}}, "Placement": {},
    "box_mesh": {"lengths": (0.1, 0.05), "size": 0.05},
    "AnisotropicSolid": {"stiffness": 1e9 * np.eye(6)}, "AnisotropicSolid.orthotropic": WOOD,
    "Spin": {"axis": (0.0, 0.0, 1.0), "omega": 100.0},
    "Prestress": {}, "PrestressedState": {"structure": lambda: loaded_part()},
    "Tie": {"a": "part:top", "b": "other:low"}, "Rigid": {"group": "part:top"},
    "Mean": {"group": "part:top", "point": "hub"},
    "Weld": ENDS, "Ball": ENDS, "Hinge": ENDS, "Slider": ENDS,
    "Bolt": {**ENDS, "beam": lambda: ao.Beam(70e9, 0.3, 2700.0, ao.Section.circle(0.01))},
    "Bushing": {**ENDS, "stiffness": {"z": 1e5}}, "Equation": {"terms": [("hub", "z", 1.0)]},
    "strike": {
        "source": mesh, "site": place, "tol": 0.5, "limit": 0.1,
        "contact": lambda: ao.Hertz(1e9), "duration": 1e-4,
        "material": lambda: ao.Solid(70e9, 0.3, 2700.0),
        "supports": lambda: [ao.Support(lambda x: x[0] < 1e-9)],
    },
    "tradeoff": {
        "source": mesh, "site": place, "tol": 0.5, "limit": 0.1,
        "contact": lambda: ao.Hertz(1e9), "duration": 1e-4,
        "material": lambda: ao.Solid(70e9, 0.3, 2700.0),
        "supports": lambda: [ao.Support(lambda x: x[0] < 1e-9)],
    },
    "advise": {"part": (0.3, 0.2, 0.01), "E": 70e9, "rho": 2700.0},
    "extract": {"site": place}, "full": {"site": place}, "superposition": {"site": place},
    "impact_map": {
        "where": [(0.1, 0.1, 0.02)], "direction": (0, 0, -1), "radius": 0.05, "n": 2, "modes": 4,
    },
    "Sensor": {"point": (0.1, 0.0, 0.02), "direction": (0, 0, 1)},
    "find_impact": {
        "sensors": lambda: [ao.Sensor((0.1, 0.0, 0.02), (0, 0, 1))], "rate": 2e4,
        "signals": np.sin(np.arange(40.0))[:, None], "where": [(0.1, 0.1, 0.02)], "modes": 4,
        "unknown": ("velocity",), "direction": (0, 0, -1), "radius": 0.05,
        "impactor": lambda: ao.RigidMass(0.1, 1.0), "contact": lambda: ao.Linear(1e6),
    },
    "Site": {"point": (0.1, 0.1, 0.02), "direction": (0, 0, -1), "radius": 0.05},
    "Strengths": STRENGTHS,
    "contact_stress": {"force": 10.0}, "delamination_load": {"D": 10.0, "G": 800.0},
    "named_impactor": {"name": "steel ball", "velocity": 1.0, "diameter": 0.05},
    "FRF": {
        "frequency": np.arange(1.0, 41.0), "values": frf_values, "quantity": "receptance",
    },
    "FRF.within": {"band": (5.0, 35.0)}, "FRF.without_sensor": {"mass": 1e-3},
    "from_frf": {"frf": frf, "damping": "viscous"},
    "read_frf": {"path": frf_file, "quantity": "receptance"},
    "compare": {"hit": history, "measured": lambda: (history().time + 0.1, history().force)},
    "ForceComparison.plot": {"path": "over.png"}, "ShockSpectrum.plot": {"path": "srs.png"},
    "RigidMass.hertz": {"self": lambda: ao.RigidMass(0.1, tip_radius=0.01, E=1e9, nu=0.3)},
    "Sphere": {"rho": 7850.0, "E": 210e9, "nu": 0.3}, "probe": {"point": (0.1, 0.1, 0.02)},
    "probe_error": {"point": (0.1, 0.1, 0.02)}, "Structure.factorize_at": {"shift": 1e6},
    "resolved_frequency": {
        "source": lambda: ao.AntiOscillators(
            m0=0.1, k0=1e6, m=[0.3], omega=[2e3], info={"converged": 1}
        )
    },
    "reactions": {"site": place}, "body_energy": {"body": "impactor"},
    "srs": {"t": [0.0, 1e-3, 2e-3], "a": [0.0, 1.0, 0.0], "frequencies": [1e2, 1e3]},
    "strain_gauge": {"point": (0.05, 0.05, 0.02), "direction": (1, 0, 0), "length": 0.01},
    "design_map": {"part": part, "hit": struck_part, "goal": "impulse", "by": "rho"},
    "DesignMap.plot": {"self": design, "path": "design.png"},
    "gradient": {
        "part": lambda: lambda x: model(), "x": [1.0],
        "hit": history, "goal": "impulse", "contact": ("structure", "impactor"),
    },
    "simulate": {
        "contact": lambda: ao.Hertz(1e9), "duration": 1e-3,
        "max_contacts": 50, "max_steps": 20_000,
    },
    "simulate_many": {
        "contacts": lambda: ao.Hertz(1e9), "duration": 1e-3,
        "max_contacts": 50, "max_steps": 20_000,
    },
    "AntiOscillators": {"m": [0.2, 0.3], "omega": [1e3, 5e3]},
    "AntiOscillators.site_modes": {"self": two_sites},
    "AntiOscillators.field": {"coordinates": [0.1, 0.2, 0.3]}, "History.of": {"body": "impactor"},
    "History.at": {"times": [0.0, 1e-5]}, "History.name_of": {"body": "impactor"},
    "Inertia": {"point": (0, 0, 0), "matrix": np.eye(6), "momentum": np.ones((2, 6))},
    "Inertia.along": {"momentum": np.ones((2, 6))}, "Inertia.moved": {"about": (0, 0, 1)},
    "Inertia.rotation": {"amplitudes": np.ones((2, 3))},
    "Motion.at": {"inertia": inertia},
    "Base": {"times": [0.0, 1e-3], "accelerations": [0.0, 1.0]},
    "Load": {"end": "part", "times": [0.0, 1e-3], "forces": [0.0, 1.0]},
    "Contact": {"a": "part", "b": "ball", "law": lambda: ao.Linear(1e6)},
    "Scene": {
        "bodies": lambda: {"part": model(), "ball": sphere()},
        "contacts": lambda: [ao.Contact("part", "ball", ao.Linear(1e6))],
    },
    "Scene.run": {"max_steps": 20_000},
    "drop": {
        "part": sphere, "height": 0.01, "until": 1, "tol": 1e-2, "n": 2,
        "floor": lambda: ao.Floor(law=ao.HuntCrossley(1e8, 0.3)),
    },
    "contact_between": {"part": part, "at": (0.05, 0.05, 0.02), "radius": 0.01},
    "material": {"name": "steel S235"},
    "Tilts": {"sigma": 2.0},
    "cfc_filter": {"step": 1e-5, "signal": [0.0, 1.0, 0.0], "name": "CFC180"},
    "monte_carlo": {"run": lambda: square, "inputs": lambda: {"x": ao.normal(0.0, 1.0)}, "n": 5},
    "normal": {"mean": 0.0, "sigma": 1.0}, "lognormal": {"mean": 1.0, "variation": 0.1},
    "uniform": {"low": 0.0, "high": 1.0}, "Many.finite": {"quantity": "value"},
    "Many.quantile": {"quantity": "value", "q": 0.5},
    "Many.exceedance": {"quantity": "value", "limit": 0.5}, "Many.plot": {"quantity": "value"},
    "Fall.acceleration": {"times": [0.0, 0.01]},
    "Many.worst": {"quantity": "value"}, "Many.largest": {"quantity": "value"},
    "ModalState": {"displacements": [0.0, 1e-6], "velocities": [1.0, 0.0]},
    "RigidBody": {"inertia": np.eye(3), "sites": {"foot": ((0, 0, 0), (0, 0, 1))}},
    "SiteModes": {"b": [[0.5, 0.1], [0.4, 0.2]], "sites": ["foot", "tip"]},
    "SiteModes.coordinates": {"q": [0.1, 0.2, 0.3], "force": [1.0, 2.0]},
    "SiteModes.amplitudes": {"coordinates": [0.1, 0.2, 0.3]},
    "SceneHistory.of": {"body": "ball"}, "SceneHistory.name_of": {"body": "ball"},
    "SceneHistory.coordinates": {"body": "ball"},
    "SceneHistory.field": {"self": struck_at_two_sites},
    "SiteModes.field": {"coordinates": [0.1, 0.2, 0.3]}, "SiteModes.receptance": {"omega": 1e3},
    "BodyHistory.displacement": {"direction": (0, 0, 1)},
    "SceneHistory.at": {"times": [0.0, 1e-5]},
    "Damper": {"damping": {"z": 10.0}},
    "DampingMatrix": {"matrix": np.eye(2), "branches": [(np.eye(2), 1e-3)]},
    "DampingMatrix.stiffness": {"omega": 1e3},
    "Spring": {"stiffness": {"z": 1e5}}, "Support": {"where": "clamp"},
    "Damping": {"ratio": 0.01, "alpha": 1.0, "beta": 1e-6}, "Section.circle": {"d": 0.02},
    "Section.tube": {"d": 0.02, "t": 1e-3}, "sweep": {"mass": [1.0, 2.0]},
    "Structure.uniform_inertia": {"direction": np.array([0.0, 0.0, 1.0])},
    "Mesh": {"dolfinx": lambda: mesh().dolfinx}, "Mesh.group": {"name": "none"},
    "read_model": {"path": str(DECKS / "c3d10.inp")},
    "export": {"path": "out.fmu", "source": model},
    "write_report": {"path": "report.html", "result": history, "structure": None},
    "Structure.from_matrices": {}, 
    "Structure.from_files": {"K": matrix_file, "M": matrix_file},
    "ModalBody": {"r": 1e-9},
    "ModalBody.coordinates": {"force": [1.0]}, "ModalBody.rigid_motion": {"velocity": 0.0},
    "SiteModes.rigid_motion": {"velocity": 0.0},
    "ModalBody.amplitudes": {"coordinates": [0.1, 0.2, 0.3]},
    "ModalBody.field": {"coordinates": [0.1, 0.2, 0.3]},
    "AntiOscillators.load": {"path": saved}, "History.load": {"path": saved_history},
    "SceneHistory.load": {"path": saved_history}, "SavedHistory.load": {"path": saved_history},
    "AntiOscillators.dynamic_stiffness": {"omega": 1e3}, "ModalBody.receptance": {"omega": 1e3},
    "FoundImpact.plot": {"path": "found.png"},
    "ImpactMap.plot": {"quantity": "k0", "path": "map.png"}, "ImpactMap.write": {"path": "map.vtu"},
    "PeakField.write": {"path": "peak.vtu"}, "PeakField.plot": {"path": "peak.png"},
    "PeakField.surface": {"label": "stress", "moved": lambda: 0 * SELVES["PeakField"]().points},
    "save_fields": {"history": struck_part},
    "StructureModes.write": {"path": "modes.vtu"},
    "from_free_modes": {"compliance": 1e-6},
    "plotting.plot_dynamic_stiffness": {"models": model, "omega": [1e3, 2e3]},
    "plotting.plot_deformed": {"history": struck_part, "path": "part.png"},
    
    "ElasticPlastic": {"modulus": 1e10, "radius": 5e-3, "yield_strength": 1e8},
    "ElasticPlastic.error_at": {"depth": 1e-5},
    "plotting.plot_history": {"path": "hit.png"}, "History.plot": {"path": "hit.png"},
    "SceneHistory.plot": {"path": "hit.png"},
    "plotting.plot_model": {"path": "model.png"}, "AntiOscillators.plot": {"path": "model.png"},
    "plotting.plot_map": {"impact_map": surface_map, "quantity": "k0", "path": "map.png"},
    "Power": {"stiffness": 1e6},
}  # fmt: skip

SELVES: dict[str, Callable[[], Any]] = {
    "AntiOscillators": model, "History": history, "ImpactMap": surface_map, "Structure": part,
    "FoundImpact": found_blow,
    "Gradient": lambda: ao.gradient(history(), "peak_force"),
    "DesignMap": lambda: design(),
    "SavedHistory": lambda: ao.History.load(saved_history()),
    "NamedImpactor": lambda: ao.IMPACTORS["tennis ball"],
    "PeakField": lambda: ao.peak_field(part(), struck_part(), times=[0.0, 1e-4]),
    "ShockSpectrum": lambda: ao.srs([0.0, 1e-3, 2e-3], [0.0, 1.0, 0.0]),
    "StructureModes": lambda: part().natural_modes(2),
    "Mesh": mesh, "StruckBeam": struck,
    "UniformBeam": beam, "Sphere": sphere, "RigidMass": lambda: ao.RigidMass(0.1),
    "Obstacle": lambda: ao.Obstacle(), "Impactor": lambda: ao.Impactor(model()),
    "Hertz": lambda: ao.Hertz(1e9), "ElasticPlastic": lambda: ao.ElasticPlastic(1e10, 5e-3, 1e8),
    "ModalBody": lambda: model().modal(), "Damping": lambda: ao.Damping(0.01), "Layer": lambda: PLY,
    "Strengths": lambda: ao.Strengths(**STRENGTHS, interlaminar=6e7),
    "Scene": scene, "SceneHistory": scene_history,
    "BodyHistory": lambda: scene_history().bodies["part"],
    "ContactHistory": lambda: scene_history()["part:foot", "ball"],
    "SiteModes": lambda: two_sites().site_modes(),
    "FRF": frf, "ForceComparison": lambda: ao.compare(
        history(), (history().time, history().force)
    ),
    "DampingMatrix": lambda: ao.DampingMatrix(np.eye(2)),
    "Floor": lambda: ao.Floor(law=ao.Hertz(1e8)), "SoftLayer": lambda: ao.SoftLayer(0.01, 1e6),
    "Fall": fall, "Many": spread,
    "Inertia": inertia, "Motion": lambda: ao.Motion((0, 0, 1.0)),
    "PointMass": lambda: ao.PointMass((0, 0, 0), 1.0),
}  # fmt: skip


def sound(name: str, call: Callable[..., Any]) -> dict[str, Any]:
    """Arguments with which `call` works."""
    makers = type(lambda: 0), type(model)
    given = unmade(name, call)
    return {k: v() if isinstance(v, makers) else v for k, v in given.items()}


def unmade(name: str, call: Callable[..., Any]) -> dict[str, Any]:
    """The same, functions in place of what they make; LookupError for a parameter unknown here."""
    own = OWN.get(name, {})
    values = dict(own)
    for key, parameter in parameters(call).items():
        if key in own:
            continue
        if key == "self":
            owner = name.split(".")[-2]
            if owner not in SELVES:
                raise LookupError(f"{name}: nasty.py needs an object of {owner} in SELVES")
            values[key] = SELVES[owner]
        elif parameter.default is inspect.Parameter.empty:
            if key not in COMMON and key not in BY_MAKER:
                raise LookupError(f"{name}: nasty.py needs a sound value for {key!r}")
            values[key] = COMMON[key] if key in COMMON else BY_MAKER[key]
    return values


def verdict(call: Callable[..., Any], arguments: dict[str, Any]) -> str:
    """What is wrong with the outcome of a call; "" where it works or refuses in one sentence."""
    given = dict(arguments)
    args = [given.pop("self")] if "self" in given else []
    try:
        with patience(), warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", ao.AntioscWarning)
            result = call(*args, **given)
            wrong = _nan(result, "result")
    except ao.AntioscError as error:
        return _unclear(error)
    except Hang as error:
        return f"hangs: {error}"
    except BaseException as error:
        return f"{type(error).__name__}: {error}"[:300]
    return wrong


def _unclear(error: ao.AntioscError) -> str:
    text = str(error)
    if len(text) < 15 or "\n" in text or not text.endswith(".") or len(text) > 600:
        return f"no sentence: {text!r}"
    return ""


def _nan(value: Any, where: str, depth: int = 0) -> str:
    """Where a NaN stands in a result, its public attributes included."""
    if depth > 3 or where.rpartition(".")[2] in NONE_IS_NAN:
        return ""
    if isinstance(value, float | complex | np.number):
        return f"NaN in {where}" if value != value else ""
    if isinstance(value, np.ndarray):
        return f"NaN in {where}" if value.dtype.kind in "fc" and np.isnan(value).any() else ""
    inside: list[tuple[str, Any]] = []
    if isinstance(value, dict):
        inside = [(f"[{key!r}]", one) for key, one in value.items()]
    elif isinstance(value, list | tuple):
        inside = [(f"[{i}]", one) for i, one in enumerate(value)]
    elif str(type(value).__module__).startswith("antiosc") and not isinstance(value, type):
        inside = list(_attributes(value))
    return next(filter(None, (_nan(v, where + name, depth + 1) for name, v in inside)), "")


def _attributes(value: Any) -> Iterator[tuple[str, Any]]:
    """Fields and properties that are not refused."""
    computed = (property, functools.cached_property)
    names = {name for name, v in inspect.getmembers(type(value)) if isinstance(v, computed)}
    if dataclasses.is_dataclass(value):
        names |= {field.name for field in dataclasses.fields(value)}
    for name in sorted(names):
        if not name.startswith("_"):
            with contextlib.suppress(ao.AntioscError):
                yield f".{name}", getattr(value, name)
