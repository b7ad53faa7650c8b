"""The files of the page beside this one, and the data in it: one text without anything to fetch."""

from __future__ import annotations

import base64
import hashlib
import json
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

#: What the page reads: numbers, texts, arrays, lists and tables of them.
Data: TypeAlias = dict[str, Any]

FOLDER = Path(__file__).parent
#: In the order in which they need each other.
SCRIPTS = ("units", "engine", "data", "view", "part", "map", "chart", "page")
#: The kinds of arrays on the page; JavaScript's names of them are in data.js.
KINDS = {"<f8": "f8", "<f4": "f4", "<i2": "i2", "<u4": "u4", "|u1": "u1"}


def script() -> str:
    """All of the page's program."""
    text = "\n".join((FOLDER / f"{name}.js").read_text("utf-8") for name in SCRIPTS)
    return f'(() => {{\n"use strict";\n{text}}})();\n'


def style() -> str:
    """The page's style."""
    return (FOLDER / "page.css").read_text("utf-8")


def engine() -> bytes:
    """The march for WebAssembly; packaging/library.py --page makes it."""
    return (FOLDER / "engine.wasm").read_bytes()


def policy(program: str) -> str:
    """The Content-Security-Policy: this program runs, and nothing is fetched."""
    digest = base64.b64encode(hashlib.sha256(program.encode()).digest()).decode("ascii")
    own = f"script-src 'sha256-{digest}' 'wasm-unsafe-eval'"
    return f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; {own}"


def embedded(data: Data) -> str:
    """Data as JSON that may stand in a script element: no text in it can end that."""
    text = json.dumps(_plain(data), allow_nan=False, separators=(",", ":"), ensure_ascii=True)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _plain(value: object) -> object:
    if isinstance(value, dict):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    if isinstance(value, np.ndarray):
        own = np.ascontiguousarray(value)
        kind = KINDS[own.dtype.newbyteorder("<").str]
        packed = own.astype(own.dtype.newbyteorder("<")).tobytes()
        return {"$": kind, "of": base64.b64encode(packed).decode("ascii")}
    if isinstance(value, bytes):
        return {"$": "u1", "of": base64.b64encode(value).decode("ascii")}
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
