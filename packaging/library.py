"""Compile the C library into the Python package: `python packaging/library.py`.

The compiler is $CC, else cc, gcc or clang, else zig's of the package `ziglang`. With
$ANTIOSC_TARGET, one of TARGETS, zig compiles for another platform. With `--fmu` zig compiles for
all of them into the folder `binaries`, from where exported FMUs take their libraries. With
`--page` clang with lld, or zig, compiles the engine of live reports for WebAssembly; the repository
keeps that file, so that no user needs a compiler for it.
"""

from __future__ import annotations

import ctypes
import hashlib
import importlib.util
import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SOURCE, PACKAGE = ROOT / "csrc", ROOT / "src" / "antiosc"
UNITS = ("antiosc_march.c", "export/antiosc_model.c", "export/fmu.c", "fem/antiosc_fem.c")
# zig's target: the wheel's platform
TARGETS = {
    "x86_64-linux-gnu.2.17": "manylinux_2_17_x86_64",
    "aarch64-linux-gnu.2.17": "manylinux_2_17_aarch64",
    "x86_64-macos.11.0": "macosx_11_0_x86_64",
    "aarch64-macos.11.0": "macosx_11_0_arm64",
    "x86_64-windows-gnu": "win_amd64",
}
FLAGS = ["-std=c99", "-O3", "-fvisibility=hidden", "-shared"]
# systems as zig and as FMI 3 name them, and where the libraries of FMUs stand
SYSTEMS = {"linux": "linux", "macos": "darwin", "windows": "windows"}
BINARIES = PACKAGE / "binaries"
SUFFIXES = {"win": ".dll", "macos": ".dylib"}
ENGINE = ROOT / "src" / "antiosc_app" / "page" / "engine.wasm"
WARNINGS = ["-Wall", "-Wextra", "-pedantic", "-Wconversion"]


def source_hash() -> str:
    """What `antiosc.engine.library.source_hash` gives."""
    text = hashlib.sha256()
    for path in sorted(SOURCE.rglob("*.[ch]")):
        text.update(path.read_bytes().replace(b"\r\n", b"\n"))
    return text.hexdigest()[:16]


def compiler() -> list[str]:
    """The command of a C compiler; empty if there is none."""
    if os.environ.get("ANTIOSC_TARGET"):
        return [*_zig(), "-target", os.environ["ANTIOSC_TARGET"]]
    if os.environ.get("CC"):
        return shlex.split(os.environ["CC"])
    for name in ("cc", "gcc", "clang"):
        if shutil.which(name):
            return [name]
    return _zig() if importlib.util.find_spec("ziglang") else []


def _zig() -> list[str]:
    return [sys.executable, "-m", "ziglang", "cc"]


def platform_tag() -> str:
    """The wheel's platform where zig compiles for another one than this; else empty."""
    return TARGETS.get(os.environ.get("ANTIOSC_TARGET", ""), "")


def suffix(platform: str = "") -> str:
    """Of the library, by the wheel's platform, or that which is compiled for."""
    platform = platform or platform_tag() or sysconfig.get_platform()
    return next((end for sign, end in SUFFIXES.items() if platform.startswith(sign)), ".so")


def build() -> Path:
    """Compile the library; returns where it stands."""
    command = compiler()
    if not command:
        raise SystemExit("antiosc: no C compiler; install gcc, or `pip install ziglang`.")
    return _compiled(command, PACKAGE / f"libantiosc_march{suffix()}")


def build_unless_present() -> Path:
    """The library; compiled unless that of the present sources stands there, as after `make`."""
    made = PACKAGE / f"libantiosc_march{suffix()}"
    if os.environ.keys().isdisjoint({"ANTIOSC_TARGET", "CC"}) and made.is_file():
        try:
            built = ctypes.CDLL(str(made)).aom_source_hash
        except (OSError, AttributeError):  # damaged, or of another machine
            return build()
        built.restype = ctypes.c_char_p
        if built() == source_hash().encode():
            return made
    return build()


def build_for_fmus() -> list[Path]:
    """Compile the libraries of all platforms of TARGETS; returns where they stand."""
    if not importlib.util.find_spec("ziglang"):
        raise SystemExit("antiosc: no compiler for other platforms; `pip install ziglang`.")
    BINARIES.mkdir(exist_ok=True)
    found = []
    for target, platform in TARGETS.items():
        machine, system = target.split(".")[0].split("-")[:2]
        out = BINARIES / f"{machine}-{SYSTEMS[system]}{suffix(platform)}"
        found.append(_compiled([*_zig(), "-target", target, "-s"], out))
    return found


def build_for_page() -> Path:
    """Compile the engine of live reports; returns where it stands."""
    if shutil.which("clang") and shutil.which("wasm-ld"):
        command, undefined = ["clang", "--target=wasm32"], "--allow-undefined"
    elif importlib.util.find_spec("ziglang"):
        command, undefined = [*_zig(), "-target", "wasm32-freestanding"], "--import-symbols"
    else:
        raise SystemExit("antiosc: no compiler for WebAssembly; install clang and lld, or ziglang.")
    flags = ["-std=c99", "-Os", "-ffreestanding", "-nostdlib", "-mbulk-memory", "-DAOM_API="]
    flags += ["-nostdlibinc", "-isystem", str(SOURCE / "page" / "include"), *WARNINGS[:2]]
    flags += [f'-DAOM_SOURCE_HASH="{source_hash()}"']
    linked = ["--no-entry", "--gc-sections", undefined, "--strip-all"]
    flags += [f"-Wl,{each}" for each in (*linked, "-z,stack-size=65536")]
    made = ENGINE.with_suffix(".part")
    subprocess.run([*command, *flags, "-o", made, str(SOURCE / "page" / "engine.c")], check=True)
    made.chmod(0o644)  # the linker makes it a program
    made.replace(ENGINE)
    return ENGINE


def _compiled(command: list[str], out: Path) -> Path:
    made = out.with_suffix(".part")
    command = [*command, *FLAGS, *WARNINGS, f'-DAOM_SOURCE_HASH="{source_hash()}"']
    command += ["-o", str(made), *(str(SOURCE / unit) for unit in UNITS)]
    if out.suffix != ".dll":  # there all code can be moved, and mathematics is in C's library
        command += ["-fPIC", "-lm"]
    subprocess.run(command, check=True)
    made.replace(out)  # a process that has loaded the old one keeps it
    for rest in [*out.parent.glob("*.pdb"), *out.parent.glob("*.lib")]:
        rest.unlink()
    return out


if __name__ == "__main__":
    if sys.argv[1:] == ["--fmu"]:
        print(*build_for_fmus(), sep="\n")
    elif sys.argv[1:] == ["--page"]:
        print(build_for_page())
    else:
        print(build())
