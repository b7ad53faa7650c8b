"""The least driver of a co-simulation FMU, for both versions of the standard, by ctypes."""

from __future__ import annotations

import ctypes
import zipfile
from collections.abc import Callable, Sequence
from ctypes import byref, c_char_p, c_double, c_int, c_size_t, c_uint32, c_void_p
from pathlib import Path
from typing import Any
from weakref import finalize
from xml.etree import ElementTree as ET

from antiosc.engine import library

LOG2 = ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p, c_char_p)
LOG3 = ctypes.CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)
OK, ERROR = 0, 3


class Callbacks(ctypes.Structure):
    """`fmi2CallbackFunctions`"""

    _fields_ = [("logger", LOG2), *((name, c_void_p) for name in ("a", "b", "c", "d"))]


class Fmu:
    """An unpacked FMU: `variables` are the value references by name."""

    def __init__(self, path: Path, folder: Path) -> None:
        with zipfile.ZipFile(path) as archive:
            archive.extractall(folder)
        self.folder = folder
        self.description = ET.parse(folder / "modelDescription.xml").getroot()
        self.version = int(self.description.attrib["fmiVersion"][0])
        self.variables = {
            each.attrib["name"]: int(each.attrib["valueReference"])
            for each in self.description.findall("ModelVariables/*")
        }
        self.variables["time"] = 0  # which version 2 does not list
        place = library.platform() if self.version == 3 else "linux64"
        (binary,) = (folder / "binaries" / place).glob("*.so")
        self.library = ctypes.CDLL(str(binary))
        self.token = self.description.attrib[("guid", "instantiationToken")[self.version - 2]]

    def instance(self, token: str | None = None) -> Instance:
        """A new instance; its `handle` is None where the FMU refuses."""
        return Instance(self, self.token if token is None else token)


class Instance:
    """An instance: calls return the status; `said` is what it logged."""

    def __init__(self, fmu: Fmu, token: str) -> None:
        self.fmu, self.said = fmu, []
        self.two = fmu.version == 2
        resources = str(fmu.folder / "resources")
        if self.two:
            self.log: Any = LOG2(lambda *given: self.said.append(given[-1]))
            self.callbacks = Callbacks(self.log)
            start = self._function("Instantiate", c_void_p)
            given = (b"a", 1, token.encode(), f"file://{resources}".encode())
            self.handle = start(*given, byref(self.callbacks), 0, 0)
        else:
            self.log = LOG3(lambda *given: self.said.append(given[-1]))
            start = self._function("InstantiateCoSimulation", c_void_p)
            given = (b"a", token.encode(), f"{resources}/".encode())
            flags = [ctypes.c_bool(False)] * 4
            self.handle = start(*given, *flags, None, c_size_t(0), None, self.log, None)
        # frees it, once, also without being called
        self.close = finalize(self, self._function("FreeInstance", None), c_void_p(self.handle))

    def _function(self, name: str, result: Any = c_int) -> Callable[..., Any]:
        found = getattr(self.fmu.library, f"fmi{self.fmu.version}{name}")
        found.restype = result
        return found

    def call(self, name: str, *given: Any) -> int:
        """Call a function of the instance that takes nothing but it, or plain arguments."""
        return int(self._function(name)(c_void_p(self.handle), *given))

    def begin(self, start: float = 0.0, **values: float) -> int:
        """Initialise with values by name."""
        if self.two:
            none = c_double(0)
            status = self.call("SetupExperiment", 0, none, c_double(start), 0, none)
            status = max(status, self.call("EnterInitializationMode"))
        else:
            no, none = ctypes.c_bool(False), c_double(0)
            status = self.call("EnterInitializationMode", no, none, c_double(start), no, none)
        for name, value in values.items():
            status = max(status, self.set(name, value))
        return max(status, self.call("ExitInitializationMode"))

    def step(self, at: float, h: float) -> int:
        if self.two:
            return self.call("DoStep", c_double(at), c_double(h), 1)
        flags = [byref(ctypes.c_bool()) for _ in range(3)]
        moment = byref(c_double())
        return self.call("DoStep", c_double(at), c_double(h), ctypes.c_bool(True), *flags, moment)

    def get(self, *names: str) -> list[float]:
        refs = (c_uint32 * len(names))(*(self.fmu.variables[name] for name in names))
        values = (c_double * len(names))()
        count = c_size_t(len(names))
        name = "GetReal" if self.two else "GetFloat64"
        more = () if self.two else (count,)
        assert self.call(name, refs, count, values, *more) == OK
        return list(values)

    def set(self, name: str, value: float) -> int:
        refs, values = (c_uint32 * 1)(self.fmu.variables[name]), (c_double * 1)(value)
        more = () if self.two else (c_size_t(1),)
        call = "SetReal" if self.two else "SetFloat64"
        return self.call(call, refs, c_size_t(1), values, *more)

    def run(self, duration: float, steps: int, names: Sequence[str]) -> list[list[float]]:
        """Values after each of so many equal steps."""
        rows = []
        for k in range(steps):
            at = duration * k / steps
            assert self.step(at, duration * (k + 1) / steps - at) == OK
            rows.append(self.get(*names))
        return rows

    def keep_state(self) -> int:
        return self.call("GetFMUstate" if self.two else "GetFMUState", byref(c_void_p()))
