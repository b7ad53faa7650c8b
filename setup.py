"""The C library of the march, built with the package; a wheel is for one platform, any Python."""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

from setuptools import Distribution, __version__ as setuptools_version, setup
from setuptools.command.build_py import build_py

try:
    from setuptools.command.bdist_wheel import bdist_wheel
except ImportError:  # before setuptools 70.1
    from wheel.bdist_wheel import bdist_wheel

sys.path.insert(0, str(Path(__file__).resolve().parent / "packaging"))
import library

ROOT = Path(__file__).resolve().parent


class BuildWithLibrary(build_py):
    def run(self) -> None:
        name = library.build_unless_present().name
        self.package_data.setdefault("antiosc", []).extend([name, "binaries/*"])
        self.__dict__.pop("data_files", None)  # found before the library was there
        super().run()
        if not self.editable_mode:  # `export` takes the sources along
            for file in sorted(library.SOURCE.rglob("*.[ch]")):
                out = Path(self.build_lib, "antiosc", "csrc", file.relative_to(library.SOURCE))
                self.mkpath(str(out.parent))
                self.copy_file(str(file), str(out))


class PlatformWheel(bdist_wheel):
    def get_tag(self) -> tuple[str, str, str]:
        return "py3", "none", library.platform_tag() or super().get_tag()[2]


class OfOnePlatform(Distribution):
    def has_ext_modules(self) -> bool:
        return True


def whole_links(text: str) -> str:
    """README as the package index shows it: links and pictures lead to the tagged sources."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    source, tag = project["urls"]["Source"], f"v{project['version']}"
    text = re.sub(r"!\[([^]]*)\]\((?!https?:)", rf"![\1]({source}/raw/{tag}/", text)
    return re.sub(r"(?<!!)\[([^]]*)\]\((?!https?:)", rf"[\1]({source}/blob/{tag}/", text)


# the SPDX expression, which setuptools knows since version 77; Debian 12 has 66
LICENSE = "license" if int(setuptools_version.split(".")[0]) < 77 else "license_expression"
COMMANDS = {"build_py": BuildWithLibrary, "bdist_wheel": PlatformWheel}
setup(
    distclass=OfOnePlatform,
    cmdclass=COMMANDS,
    long_description=whole_links((ROOT / "README.md").read_text(encoding="utf-8")),
    long_description_content_type="text/markdown",
    **{LICENSE: "BSD-3-Clause"},
)
