"""Files are written completely or not at all: a reader never sees a partial file.

The content is written to a temporary file in the same folder, flushed to the disk, and then renamed
in one step. An interrupted run, a full disk or an error leaves the previous file unchanged. Only a
process that is killed leaves its temporary file behind.
"""

from __future__ import annotations

import contextlib
import os
import secrets
import stat
from collections.abc import Iterator
from pathlib import Path

from antiosc.base import checks
from antiosc.base.errors import InputError

#: Prefix of the name of a temporary file or folder.
TEMPORARY_PREFIX = ".antiosc-"
#: First characters of formulas in spreadsheets; some programs accept wide characters too.
FORMULA_STARTS = tuple("=+-@\uff1d\uff0b\uff0d\uff20")
#: Largest table or measurement that is read whole, bytes.
MAX_READ_BYTES = 100_000_000
#: Longest suffix that the temporary file keeps: programs choose a format by it.
_MAX_SUFFIX_LENGTH = 20


@contextlib.contextmanager
def atomic_file(path: str | os.PathLike[str], what: str = "the file") -> Iterator[Path]:
    """Context manager: a temporary file with the suffix of `path`, renamed to `path` at the end.

    An existing file keeps its permissions and its owner. If `path` is a symbolic link, its target
    is written. If the block raises, nothing changes. `what` names the content for messages.
    InputError if `path` cannot be a file, or the system refuses to write there (also in the block).
    """
    try:
        target = Path(os.path.realpath(checks.path("path", path)))
        old_status = _regular_status(target, path, what)
        part = _temporary_file(target, old_status)

        try:
            yield part
            _sync(part)
            os.replace(part, target)
            _sync(target.parent)
        except BaseException:
            part.unlink(missing_ok=True)
            raise
    except (OSError, UnicodeEncodeError) as error:
        raise write_error(what, path, error) from error


def check_readable(path: Path, what: str) -> None:
    """InputError unless `path` is a regular file of 1 to 100 MB; `what` names its content."""
    try:
        if not path.is_file():
            raise InputError(f"there is no regular file {checks.shown(os.fspath(path))}.")
        size = path.stat().st_size
    except OSError as error:
        raise InputError(f"cannot read {path.name}: {error.strerror or error}.") from error

    if not 0 < size <= MAX_READ_BYTES:
        raise InputError(
            f"{path.name} has {size} bytes; {what} has 1 to {MAX_READ_BYTES:g}: leave out what is"
            " not needed."
        )


def write_text(path: str | os.PathLike[str], text: str, what: str = "the text") -> None:
    """Write a text in UTF-8, completely or not at all; InputError as `atomic_file`."""
    with atomic_file(path, what) as part:
        part.write_text(text, encoding="utf-8")


def table_text(text: str) -> str:
    """`text` for a CSV cell, preceded by a quote if a spreadsheet would read it as a formula."""
    if text.lstrip()[:1] in FORMULA_STARTS:
        return f"'{text}"
    return text


def write_error(what: str, path: str | os.PathLike[str], error: Exception) -> InputError:
    """The error for a file that the system refuses to write, with the reason."""
    reason = getattr(error, "strerror", None) or str(error)
    return InputError(f"cannot write {what} to {os.fspath(path)!r}: {reason.rstrip('.')}.")


def _regular_status(target: Path, path: str | os.PathLike[str], what: str) -> os.stat_result | None:
    """The status of the file at `target`; None if there is none."""
    try:
        old_status = target.lstat()  # links are resolved: a remaining one is circular
    except FileNotFoundError:
        return None

    if not stat.S_ISREG(old_status.st_mode):
        kind = "a folder" if stat.S_ISDIR(old_status.st_mode) else "not a regular file"
        raise InputError(
            f"cannot write {what} to {os.fspath(path)!r}: it is {kind}; choose another name."
        )
    if not os.access(target, os.W_OK):
        raise InputError(f"cannot write {what} to {os.fspath(path)!r}: it is write-protected.")

    return old_status


def _temporary_file(target: Path, old_status: os.stat_result | None) -> Path:
    """An empty file in the folder of `target`, with the permissions of the file to be written."""
    suffix = target.suffix if len(target.suffix) <= _MAX_SUFFIX_LENGTH else ""
    part = target.with_name(f"{TEMPORARY_PREFIX}{secrets.token_hex(10)}{suffix}")
    flags = os.O_CREAT | os.O_EXCL | os.O_WRONLY | getattr(os, "O_CLOEXEC", 0)
    handle = os.open(part, flags, 0o666 if old_status is None else 0o600)

    try:
        if old_status is not None and hasattr(os, "fchown"):  # not on Windows
            with contextlib.suppress(PermissionError):  # root alone may give files away
                os.fchown(handle, old_status.st_uid, old_status.st_gid)
            os.fchmod(handle, stat.S_IMODE(old_status.st_mode))
    finally:
        os.close(handle)

    return part


def _sync(path: Path) -> None:
    """Wait until the file, or the list of names in a folder, is on the disk."""
    if os.name == "nt":  # Windows has no such call for folders, nor for files open to be read
        return
    handle = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
