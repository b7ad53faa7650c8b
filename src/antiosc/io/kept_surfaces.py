"""Surfaces that were made anew, beside the other caches of the user, since each took minutes."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import json
import os
import zipfile
from pathlib import Path

import numpy as np

from antiosc.io.neutral import FileMesh, packed, unpacked

#: Number of surfaces that are kept, the last ones that were used.
MOST_KEPT = 30
#: Part of the name of each file, which changes with what it holds.
VERSION = "4"
#: The code that makes surfaces, and writes the sentences that are kept with them.
CODE = Path(__file__).parent


@functools.cache
def _version_of(folder: Path) -> str:
    """Digest of the code in a folder: other code makes other surfaces, or words."""
    files = sorted(folder.glob("*.py"))
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()


def key_of(path: Path, *options: object) -> str:
    """The key of a file by its content, of the options of reading it, and of the code."""
    key = hashlib.sha256(repr((VERSION, _version_of(CODE), *options)).encode())
    with contextlib.suppress(OSError):
        if path.is_file():  # a pipe would wait, and a device has no end
            with open(path, "rb") as file:
                key.update(hashlib.file_digest(file, "sha256").digest())
    return key.hexdigest()[:32]


def load(key: str) -> tuple[FileMesh, str] | None:
    """The surface, and why it was made anew; None if there is none."""
    file = _folder() / f"{key}.npz"
    try:
        with np.load(file, allow_pickle=False) as content:
            header = json.loads(str(content["header"]))
            arrays = [content[f"array{k}"] for k in range(header["arrays"])]
            mesh = unpacked(header["mesh"], arrays)
        os.utime(file)
    except (OSError, EOFError, ValueError, KeyError, TypeError, zipfile.BadZipFile):  # or damaged
        return None
    return mesh, header["reason"]


def save(key: str, surface: FileMesh, reason: str) -> None:
    """Keep a surface, unless it is kept; a folder that cannot be written leaves it out."""
    folder = _folder()
    if (folder / f"{key}.npz").exists():
        return
    head, arrays = packed(surface)
    header = json.dumps({"mesh": head, "reason": reason, "arrays": len(arrays)})
    named = {f"array{k}": array for k, array in enumerate(arrays)}
    unfinished = folder / f"{key}.{os.getpid()}.npz"
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        np.savez_compressed(unfinished, header=np.array(header), **named)  # type: ignore[arg-type]
        unfinished.replace(folder / f"{key}.npz")
        files = sorted(folder.glob("*.npz"), key=lambda file: -file.stat().st_mtime)
        for file in files[MOST_KEPT:]:
            file.unlink()


def _folder() -> Path:
    cache_home = os.environ.get("XDG_CACHE_HOME", "")
    users = Path(cache_home) if os.path.isabs(cache_home) else Path.home() / ".cache"
    return users / "antiosc" / "surfaces"
