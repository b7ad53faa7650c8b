"""PEP 517: setuptools, which needs zig's compiler where there is no other."""

from __future__ import annotations

from typing import Any

import library
from setuptools import build_meta
from setuptools.build_meta import *  # noqa: F403  the other hooks are setuptools' own


def get_requires_for_build_wheel(config_settings: Any = None) -> list[str]:
    needed = build_meta.get_requires_for_build_wheel(config_settings)
    return [*needed, *([] if library.compiler() else ["ziglang"])]


get_requires_for_build_editable = get_requires_for_build_wheel
