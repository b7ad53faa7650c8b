"""Model files: NumPy's `.npz` with a self-describing header in JSON.

A model file is untrusted data: it is read without pickles, and no array is larger than the bytes
that are stored of it.
"""

from __future__ import annotations

import io
import json
import os
import stat
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from antiosc.base import checks, files
from antiosc.base.errors import InputError

FORMAT = "antiosc-model"
#: the newest version that is read
VERSION = 2

#: Largest member of an archive in bytes. A model of a million anti-oscillators takes 8 MB.
_LARGEST = 2**26
#: Most members of an archive.
_MEMBERS = 100

Arrays = dict[str, NDArray[Any]]


def write(path: str | os.PathLike[str], header: Mapping[str, object], arrays: Arrays) -> None:
    """Write header and arrays, completely or not at all."""
    try:
        text = json.dumps(header)
    except (TypeError, ValueError, RecursionError) as error:
        raise InputError(f"model.info must hold JSON values only: {error}.") from None
    with files.complete(path, "the model") as part, part.open("wb") as stream:
        np.savez(stream, **{"header": np.array(text), **arrays})  # type: ignore[arg-type]


def read(
    path: str | os.PathLike[str],
    needed: set[str],
    expected: str = FORMAT,
    largest: int = _LARGEST,
) -> tuple[dict[str, Any], Arrays]:
    """(header, arrays) of a file of a format that holds the arrays `needed`.

    InputError for another file, or one with arrays of more than `largest` bytes.
    """
    source = checks.path("path", path)
    _check_regular(source)
    try:
        with zipfile.ZipFile(source) as archive:
            members = archive.infolist()
            if len(members) > _MEMBERS:
                raise ValueError(f"{len(members)} members")
            arrays = {
                m.filename.removesuffix(".npy"): _member(archive, m, largest) for m in members
            }
        header = json.loads(str(arrays.pop("header")))
        version = header["version"] if header.get("format") == expected else VERSION
        newer = bool(version > VERSION)
    except Exception:  # NumPy, zipfile and JSON raise what they like on foreign bytes
        raise InputError(f"{path} is not an {expected} file, or it is damaged.") from None
    if header.get("format") != expected:
        raise InputError(
            f"{path} has format {checks.shown(header.get('format'))}, expected {expected!r}."
        )
    if newer:
        raise InputError(f"{path} has version {version}; this antiosc reads up to {VERSION}.")
    missing = needed - arrays.keys()
    if missing:
        raise InputError(f"{path} lacks {', '.join(sorted(missing))}; write it again.")
    return header, arrays


def _check_regular(path: Path) -> None:
    """InputError unless `path` is a regular file: opening a pipe could block."""
    try:
        mode = path.stat().st_mode
    except OSError as error:
        reason = "" if isinstance(error, FileNotFoundError) else f" ({error.strerror})"
        raise InputError(f"there is no model file {path}{reason}.") from None
    if not stat.S_ISREG(mode):
        raise InputError(f"there is no model file {path}: it is a folder or a device.")


def _member(archive: zipfile.ZipFile, member: zipfile.ZipInfo, largest: int) -> NDArray[Any]:
    """One array of numbers or text; ValueError for others, and if its header and size disagree."""
    if member.file_size > largest:
        raise ValueError(f"{member.filename} has {member.file_size} bytes")
    with archive.open(member) as stream:
        content = io.BytesIO(stream.read())  # no more than that, whatever is compressed
    array = np.asarray(npy.read_array(content, allow_pickle=False))
    if array.dtype.kind not in "fiuU" or content.read(1):
        raise ValueError(f"{member.filename} holds {array.dtype} of shape {array.shape}, and more")
    return array
