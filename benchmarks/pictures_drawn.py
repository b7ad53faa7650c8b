"""The pictures of demos, drawn anew by their scripts; which inputs each picture was drawn from.

    python benchmarks/pictures_drawn.py [NAME …]

draws the pictures of the demos named, or of those whose inputs have changed. The pictures of pages
are drawn by `benchmarks/page_outputs.py`. A test compares the inputs with those of the file DRAWN.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pages

#: Name of a demo or a page -> hash of the inputs that its pictures were drawn from.
DRAWN = pages.ROOT / "docs/pictures/drawn.json"
MESH = re.compile(r"meshes/[\w.]+")


def digest(program: str) -> str:
    """Hash of a program and of the mesh files that it names."""
    files = [pages.ROOT / name for name in sorted(set(MESH.findall(program)))]
    parts = [program.encode(), *(file.read_bytes() for file in files if file.is_file())]
    return hashlib.sha256(b"\n".join(parts)).hexdigest()[:16]


def of_demo(name: str) -> str:
    """Hash of the inputs of a demo, what it shares with others among them."""
    text = (pages.ROOT / f"{name}.py").read_text(encoding="utf-8")
    if "import compared" in text:
        text += (pages.ROOT / "demos/compared.py").read_text(encoding="utf-8")
    return digest(text)


def of_page(name: str) -> str:
    """Hash of the programs of a page."""
    return digest("\n".join(pages.blocks_of(pages.pages()[name])))


def stored() -> dict[str, str]:
    """The hashes of the pictures as they are."""
    found: dict[str, str] = json.loads(DRAWN.read_text(encoding="utf-8"))
    return found


def store(name: str, inputs: str) -> None:
    """Keep the hash of the inputs of pictures that were just drawn."""
    rows = dict(sorted({**stored(), name: inputs}.items()))
    DRAWN.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


def on_page(name: str) -> dict[str, Path]:
    """Picture that the programs of a page draw -> where the repository keeps it."""
    text = pages.pages()[name].read_text(encoding="utf-8")
    own = re.findall(rf"\]\((?:\.\./)*pictures/{name.replace('/', '_')}_(\w+\.png)\)", text)
    return {one: DRAWN.parent / f"{name.replace('/', '_')}_{one}" for one in own}


def of_demos() -> dict[str, list[str]]:
    """Name of each demo -> its pictures."""
    sys.path.insert(0, str(pages.ROOT / "docs"))
    import generated

    return {f"demos/{name}": pictures for name, pictures in generated.PICTURES["demos"].items()}


def draw(name: str) -> None:
    """Run a demo as it stands and keep its pictures."""
    inputs, script = of_demo(name), str(pages.ROOT / f"{name}.py")
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([sys.executable, script, "--out", folder], check=True)
        for picture in of_demos()[name]:
            shutil.copyfile(Path(folder) / picture, pages.ROOT / "demos/pictures" / picture)
    store(name, inputs)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="demos/drop, …")
    chosen = parser.parse_args().names
    for demo in of_demos():
        if demo in chosen or (not chosen and stored().get(demo) != of_demo(demo)):
            draw(demo)
