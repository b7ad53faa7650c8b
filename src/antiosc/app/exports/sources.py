"""The C sources and compiled libraries that exports take along."""

from __future__ import annotations

from pathlib import Path

from antiosc.base import march
from antiosc.base.errors import MissingDependencyError

_PACKAGE = Path(march.__file__).parents[1]
#: platform of FMI 3 -> its folder in FMI 2, the ending of a library there
PLATFORMS = {
    "x86_64-linux": ("linux64", ".so"),
    "aarch64-linux": ("", ".so"),
    "x86_64-windows": ("win64", ".dll"),
    "x86_64-darwin": ("darwin64", ".dylib"),
    "aarch64-darwin": ("", ".dylib"),
}
#: what one compiler call compiles
UNITS = ("antiosc_march.c", "export/antiosc_model.c", "export/fmu.c")


def sources() -> dict[str, str]:
    """Name -> text of the C sources, with folders."""
    for folder in (_PACKAGE / "csrc", march.SOURCE):
        files = sorted([*folder.glob("*.[ch]"), *folder.glob("export/*.[ch]")])
        if files:
            return {f.relative_to(folder).as_posix(): f.read_text("utf-8") for f in files}
    raise MissingDependencyError("the C sources are missing: install antiosc anew.")


def binaries() -> dict[str, bytes]:
    """Platform -> library: the one in use, and those of other platforms that were built.

    `packaging/library.py --fmu` builds the others into the folder `binaries`; those that were built
    of other sources are left out.
    """
    found = {march.platform(): march.FILE.read_bytes()}
    sources = march.library.aom_source_hash()
    for name, (_, ending) in PLATFORMS.items():
        file = _PACKAGE / "binaries" / f"{name}{ending}"
        content = file.read_bytes() if file.is_file() else b""
        if sources in content:
            found.setdefault(name, content)
    return found
