"""Damaged copies of files: cut off, with NaN and huge numbers, in other encodings, shuffled.

`python benchmarks/damaged_files.py FOLDER OUT` writes 26 copies of each file of FOLDER; then
`python benchmarks/foreign_files.py OUT --only new` tells what becomes of them: "clean" or "told",
never "aborted" (a signal, a traceback) and never "wrong" (longer than the limit).
"""

from __future__ import annotations

import argparse
import random
import re
from collections.abc import Callable
from pathlib import Path

from foreign_files import files

REAL = re.compile(rb"(?<![\w.])-?\d+\.\d*(?:[eE][-+]?\d+)?")
WHOLE = re.compile(rb"(?<![\w.])\d+(?![\w.])")
#: Bytes of a file of noise; lines that are lost at most.
NOISE, LOST = 5000, 30


class Damage:
    """Ways to damage the content of a file, by their names."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)

    def ways(self) -> dict[str, Callable[[bytes], bytes]]:
        """Name -> the damaged content."""
        cuts = {f"cut{share}": self._cut(share) for share in (5, 50, 90, 99)}
        real = {"nan": (b"nan", 1), "nans": (b"NaN", 50), "inf": (b"1e999", 1)}
        whole = {"many": (b"99999999999", 3), "beyond": (b"9223372036854775808", 1)}
        whole |= {"negative": (b"-5", 5), "zero": (b"0", 5)}
        return {
            **cuts,
            **{name: self._put(REAL, *how) for name, how in real.items()},
            "huge": self._put(REAL, b"1e300", 20),
            **{name: self._put(WHOLE, *how) for name, how in whole.items()},
            "utf16": lambda b: b.decode("latin-1").encode("utf-16"),
            "bom": lambda b: b"\xef\xbb\xbf" + b,
            "latin": lambda b: b"** \xe9\xff\xfe\n" + b,
            "crlf": lambda b: b.replace(b"\n", b"\r\n"),
            "cr": lambda b: b.replace(b"\n", b"\r"),
            "null": lambda b: b.replace(b" ", b"\0", 40),
            "flips": self._flipped,
            "repeated": self._repeated,
            "lost": self._lost,
            "shuffled": self._shuffled,
            "alike": self._alike,
            "empty": lambda b: b"",
            "noise": lambda b: self._random.randbytes(NOISE),
            "twice": lambda b: b + b,
        }

    def _cut(self, percent: int) -> Callable[[bytes], bytes]:
        return lambda b: b[: len(b) * percent // 100]

    def _put(self, what: re.Pattern[bytes], by: bytes, count: int) -> Callable[[bytes], bytes]:
        """Some numbers replaced."""

        def damaged(b: bytes) -> bytes:
            spans = [found.span() for found in what.finditer(b)]
            some = self._random.sample(spans, min(count, len(spans)))
            for start, end in sorted(some, reverse=True):
                b = b[:start] + by + b[end:]
            return b

        return damaged

    def _flipped(self, b: bytes) -> bytes:
        content = bytearray(b)
        for _ in range(min(100, len(b))):
            content[self._random.randrange(len(b))] = self._random.randrange(256)
        return bytes(content)

    def _repeated(self, b: bytes) -> bytes:
        lines = b.split(b"\n")
        k = self._random.randrange(len(lines))
        return b"\n".join([*lines[:k], *[lines[k]] * 3, *lines[k:]])

    def _lost(self, b: bytes) -> bytes:
        lines = b.split(b"\n")
        k = self._random.randrange(len(lines))
        return b"\n".join(lines[:k] + lines[k + self._random.randrange(1, LOST) :])

    def _shuffled(self, b: bytes) -> bytes:
        lines = b.split(b"\n")
        self._random.shuffle(lines)
        return b"\n".join(lines)

    def _alike(self, b: bytes) -> bytes:
        """A third of the rows of numbers are the first one: nodes that coincide, equal elements."""
        lines = b.split(b"\n")
        rows = [k for k, line in enumerate(lines) if re.fullmatch(rb"[\s\d.,eE+-]+", line)]
        for k in self._random.sample(rows, len(rows) // 3):
            lines[k] = lines[rows[0]]
        return b"\n".join(lines)


def main() -> None:
    """Write the copies, and print their number."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("out", type=Path)
    asked = parser.parse_args()
    asked.out.mkdir()
    count = 0
    for number, file in enumerate(files(asked.folder)):
        content = file.read_bytes()
        for name, damaged in Damage(number).ways().items():
            copy = asked.out / f"{number:02d}_{file.stem}_{name}{file.suffix}"
            copy.write_bytes(damaged(content))
            count += 1
    print(f"{count} damaged files in {asked.out}")


if __name__ == "__main__":
    main()
