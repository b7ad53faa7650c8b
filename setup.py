"""The C library of the march, built with the package; a wheel is for one platform, any Python."""

from __future__ import annotations

import sys
from pathlib import Path

from setuptools import Distribution, setup
from setuptools.command.build_py import build_py

try:
    from setuptools.command.bdist_wheel import bdist_wheel
except ImportError:  # before setuptools 70.1
    from wheel.bdist_wheel import bdist_wheel

sys.path.insert(0, str(Path(__file__).resolve().parent / "packaging"))
import library


class BuildWithLibrary(build_py):
    def run(self) -> None:
        name = library.build().name
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


COMMANDS = {"build_py": BuildWithLibrary, "bdist_wheel": PlatformWheel}
setup(distclass=OfOnePlatform, cmdclass=COMMANDS)
