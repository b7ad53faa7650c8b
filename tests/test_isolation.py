"""Importing antiosc and extracting a model leave the process as it was for the application."""

from __future__ import annotations

import json
import logging
import os
import subprocess
import sys
import textwrap
import warnings
from pathlib import Path

import pytest

from antiosc.base.packages import restored
from paths import MESHES

#: What a process can see of itself; the packages' own loggers are theirs.
STATE = """
    import gc, importlib, io, json, locale, logging, os, resource, signal, sys, threading, warnings
    import numpy, scipy.special, scipy.sparse.linalg
    from mpi4py import MPI  # which catches crashes to show where they come from

    def signals():  # as the kernel knows them, where it can be asked
        try:
            lines = open("/proc/self/status").read().splitlines()
        except OSError:
            return []
        return [line for line in lines if line.startswith(("SigCgt", "SigIgn", "SigBlk"))]

    def state():
        root = logging.getLogger()
        mask = os.umask(0)
        os.umask(mask)
        # Packages filter categories of their own; those that Cython made repeat NumPy's filters.
        builtin = sorted(repr(f) for f in warnings.filters if f[2].__module__ == "builtins")
        found = {
            "handlers": [(h, h.level, h.filters, h.formatter) for h in root.handlers],
            "root": (root.level, root.filters, root.disabled, root.manager.disable),
            "last resort": logging.lastResort,
            "names of levels": dict(logging._levelToName),
            "showwarning": warnings.showwarning,
            "formatwarning": warnings.formatwarning,
            "filters": builtin,
            "environment": dict(os.environ),
            "signals": [signal.getsignal(s) for s in sorted(signal.valid_signals())],
            "handlers of signals": signals(),
            "floating point": (numpy.geterr(), numpy.geterrcall(), numpy.float64(5e-324) / 1),
            "printing": numpy.get_printoptions(),
            "random numbers": numpy.random.get_state()[1].tolist(),
            "special functions": scipy.special.geterr(),
            "folder": os.getcwd(),
            "path": sys.path,
            "arguments": sys.argv,
            "loader": sys.getdlopenflags(),
            "hooks": (sys.excepthook, sys.displayhook, sys.unraisablehook, threading.excepthook),
            "streams": (sys.stdin, sys.stdout, sys.stderr),
            "recursion": sys.getrecursionlimit(),
            "garbage": (gc.isenabled(), gc.get_threshold()),
            "umask": mask,
            "locale": locale.setlocale(locale.LC_ALL),
            "limits": [resource.getrlimit(k) for k in range(resource.RLIMIT_NOFILE + 1)],
        }
        return {key: repr(value) for key, value in found.items()}

    def changed(before):
        after = state()
        return {key: (before[key], after[key]) for key in after if after[key] != before[key]}
"""
EXTRACT = """
    import antiosc as ao
    from dolfinx.mesh import CellType, create_box

    ends = [[0, 0, 0], [0.1, 0.02, 0.01]]
    box = create_box(MPI.COMM_SELF, ends, [20, 4, 2], CellType.tetrahedron)
    part = ao.Structure(
        ao.read_mesh(box),
        ao.Solid(E=70e9, nu=0.33, rho=2700),
        supports=[ao.Support(lambda x: x[0] < 1e-9)],
    )
    site = ao.Site(point=(0.05, 0.01, 0.01), direction=(0, 0, -1), radius=8e-3)
    model = ao.extract(part, site, n=5)
    hit = ao.simulate(model, ao.RigidMass(0.01, 1.0), ao.Hertz(1e9), duration=5e-3)
    ao.probe(part, hit, point=(0.1, 0, 0))
"""


def child(
    *parts: str, folder: Path | None = None, **environment: str
) -> subprocess.CompletedProcess[str]:
    """A fresh Python that runs the parts, with an empty cache of compiled forms."""
    code = "\n".join(textwrap.dedent(part) for part in parts)
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, **({"XDG_CACHE_HOME": str(folder)} if folder else {}), **environment},
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, done.stderr
    return done


def differences(done: subprocess.CompletedProcess[str]) -> list[dict[str, list[str]]]:
    return [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]


APPLICATIONS = {
    "with logging": """
        import io, logging
        log = io.StringIO()
        logging.basicConfig(level=logging.INFO, stream=log)
        logging.captureWarnings(True)
    """,
    "with its own warnings": """
        import warnings
        warnings.showwarning = lambda *arguments: None
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", module="(cffi|pkg_resources|setuptools|ffcx)")
        warnings.filterwarnings("ignore", category=ImportWarning)
        warnings.filterwarnings("ignore", category=ResourceWarning)
        warnings.filterwarnings("ignore", category=DeprecationWarning)
    """,
}


@pytest.mark.fem
@pytest.mark.slow
@pytest.mark.parametrize("application", APPLICATIONS)
def test_import_and_extraction_leave_no_trace(application, tmp_path):
    done = child(
        APPLICATIONS[application],
        STATE,
        """
        start = state()
        import antiosc.fem
        print(json.dumps(changed(start)))
        """,
        EXTRACT,
        f"""
        ao.read_mesh({str(MESHES / "beam.msh")!r})
        print(json.dumps(changed(start)))
        from petsc4py import PETSc
        print(json.dumps({{k: v for k, v in PETSc.Options().getAll().items() if "antiosc" in k}}))
        logging.getLogger("mine").info("still here")
        print(globals().get("log", io.StringIO()).getvalue())
        """,
        folder=tmp_path,
    )
    assert differences(done) == [{}, {}, {}]
    assert list((tmp_path / "antiosc").glob("*/*.so"))  # something was compiled
    assert done.stderr == ""
    names = {line.split(":")[1] for line in done.stdout.splitlines() if line.startswith("INFO:")}
    assert ("mine" in names) == (application == "with logging")
    assert all(name == "mine" or name.startswith("antiosc.") for name in names), names


@pytest.mark.fem
@pytest.mark.slow
def test_signals_stay_and_the_form_compiler_is_patched_only_while_it_compiles(tmp_path):
    done = child(
        """
        import os, signal, time
        import ffcx.ir.elementtables as tables
        plain = tables.get_ffcx_table_values
        import antiosc.fem
        from antiosc.fem.platform.compiled_forms import FFCX_VERSION, quiet_compiler
        assert tables.get_ffcx_table_values is plain
        with quiet_compiler():
            with quiet_compiler():
                assert (tables.get_ffcx_table_values is plain) == (FFCX_VERSION >= (0, 6))
            assert (tables.get_ffcx_table_values is plain) == (FFCX_VERSION >= (0, 6))
        assert tables.get_ffcx_table_values is plain
        ends = os.pipe()
        os.close(ends[0])
        try:
            os.write(ends[1], b"nobody reads this")
        except BrokenPipeError:
            print("pipe")
        try:
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(10)
        except KeyboardInterrupt:
            print("interrupt")
        """,
        folder=tmp_path,
    )
    assert (done.stdout, done.stderr) == ("pipe\ninterrupt\n", "")


@pytest.mark.fem
@pytest.mark.slow
def test_a_user_without_a_home(tmp_path, monkeypatch):
    """In a container: neither HOME nor an entry in the list of users."""
    for name in ("HOME", "XDG_CACHE_HOME", "XDG_CONFIG_HOME", "MPLCONFIGDIR"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    done = child(
        """
        import os, pwd
        def nobody(uid):
            raise KeyError(uid)
        pwd.getpwuid = nobody
        import antiosc.fem
        from mpi4py import MPI
        """,
        EXTRACT,
        f"""
        hit.plot({str(tmp_path / "hit.svg")!r})
        home = os.environ["HOME"]
        assert os.stat(home).st_mode & 0o777 == 0o700
        assert os.path.dirname(home) == {str(tmp_path)!r}
        print(os.listdir(home))
        """,
    )
    assert ".cache" in done.stdout
    assert not list(tmp_path.glob("antiosc*"))
    assert (tmp_path / "hit.svg").is_file()


def test_what_others_change_is_put_back(monkeypatch):
    monkeypatch.setenv("HOME", "/as-it-was")
    monkeypatch.delenv("PLAT", raising=False)
    vendored = "/lib/setuptools/_vendor"
    root, show, flags = logging.getLogger(), warnings.showwarning, sys.getdlopenflags()
    handlers, level = list(root.handlers), root.level

    def disturb() -> None:
        with restored():
            root.handlers = [logging.StreamHandler()]
            root.setLevel(1)
            logging.captureWarnings(True)
            os.environ["PLAT"] = "1"
            os.environ["HOME"] = "/otherwise"
            sys.path.append(vendored)
            sys.setdlopenflags(flags ^ os.RTLD_GLOBAL)
            raise KeyError("also after an error")

    with pytest.raises(KeyError):
        disturb()
    assert root.handlers == handlers
    assert root.level == level
    assert warnings.showwarning is show
    assert "PLAT" not in os.environ
    assert os.environ["HOME"] == "/as-it-was"
    assert sys.getdlopenflags() == flags
    assert vendored not in sys.path
    with restored():
        assert vendored in sys.path
    assert vendored not in sys.path


#: Modules that take long to load, and that a first impact by a given law does not need.
NOT_FOR_ONE_IMPACT = {
    *("difflib", "locale", "logging", "numpy.typing", "platform", "scipy", "shutil", "tempfile"),
    *("tomllib", "zipfile", "antiosc.base.materials", "antiosc.engine.contact.choice"),
    *("antiosc.engine.first_order", "antiosc.impact.enclosure", "antiosc.impact.error_budget"),
    *("antiosc.impact.reference", "antiosc.impact.stretching", "antiosc.impact.truncation"),
    *("antiosc.models.recurrence", "antiosc.plot.charts"),
}


def test_a_first_impact_loads_what_it_uses():
    code = f"""
        import sys
        import numpy
        before = set(sys.modules)
        import antiosc as ao
        model = ao.AntiOscillators(m0=0.01, k0=1e6, m=[1e-3, 1e-3], omega=[1e4, 2e4])
        hit = ao.simulate(model, ao.RigidMass(0.03, velocity=1.0), ao.Hertz(1e9), duration=1e-3)
        assert hit.peak_force > 0
        print(*sorted((set(sys.modules) - before) & {NOT_FOR_ONE_IMPACT}))
        """
    given = [sys.executable, "-c", textwrap.dedent(code)]
    done = subprocess.run(given, capture_output=True, text=True, timeout=600)
    assert (done.returncode, done.stdout.split()) == (0, []), done.stderr
