"""Archives of arrays (.npz) and FMUs: written completely or not at all, read up to a size limit."""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.lib import format as npy

from antiosc.base import files
from antiosc.base._types import NDArray
from antiosc.base.errors import InputError

if TYPE_CHECKING:
    import zipfile

#: Most members of an archive.
_MAX_MEMBERS = 100

Arrays: TypeAlias = dict[str, NDArray[Any]]


@contextmanager
def atomic_archive(path: str | os.PathLike[str], what: str) -> Iterator[zipfile.ZipFile]:
    """Context manager: an archive that is written completely or not at all, as `atomic_file`."""
    import zipfile  # takes long to load

    with files.atomic_file(path, what) as part, zipfile.ZipFile(part, "w") as archive:
        yield archive


def write_arrays(path: str | os.PathLike[str], arrays: Arrays, what: str) -> None:
    """Write arrays as `numpy.savez` does, completely or not at all."""
    with atomic_archive(path, what) as archive:
        for name, values in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                npy.write_array(member, np.asanyarray(values), allow_pickle=False)


def read_arrays(path: Path, max_bytes: int, what: str, dtype_kinds: str = "fiuU") -> Arrays:
    """The arrays of an .npz file by name; InputError above `max_bytes` and for other dtypes."""
    import zipfile  # takes long to load

    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
            size = sum(member.file_size for member in members)
            if len(members) <= _MAX_MEMBERS and size <= max_bytes:
                return {
                    m.filename.removesuffix(".npy"): _read_array(archive, m, dtype_kinds)
                    for m in members
                }
    except Exception:  # NumPy and zipfile raise what they like on foreign bytes
        raise InputError(f"{path} is not {what}, or it is damaged.") from None

    raise InputError(
        f"{path} holds {len(members)} arrays of {size} bytes; {what} has at most {_MAX_MEMBERS},"
        f" and {max_bytes} bytes."
    )


def _read_array(
    archive: zipfile.ZipFile, member: zipfile.ZipInfo, dtype_kinds: str
) -> NDArray[Any]:
    """One array; ValueError if its dtype is not allowed, or header and size disagree."""
    with archive.open(member) as stream:
        content = io.BytesIO(stream.read(member.file_size))  # no more, whatever is compressed
    array = np.asarray(npy.read_array(content, allow_pickle=False))
    if array.dtype.kind not in dtype_kinds or content.read(1):
        raise ValueError(f"{member.filename} holds {array.dtype} of shape {array.shape}, and more")
    return array
