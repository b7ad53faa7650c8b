"""The page of `antiosc open`: CPU seconds of its answers, and its picture.

The answers are those of the server, in the order of a session: skin, first blow, picture, verdict,
then clicks once the free modes are known: of the file, and of a structure of steel with elements of
a given size. The picture needs chromium and chromium-driver.

    .venv/bin/python benchmarks/opened_part.py --help
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

import options

import antiosc as ao
from antiosc_app.opened import Opened
from antiosc_app.view import NOBODY, View

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests" / "support"))
from webdriver import Browser  # noqa: E402

#: Seconds that a page may take.
PATIENCE = 600
#: Show the stress at a third of the run.
STRESS = """
const kind = document.getElementById("kind");
kind.value = "stress";
kind.dispatchEvent(new Event("change"));
page.frame = 20;
page.picture();
"""


def main(
    part: Path = ROOT / "meshes/bracket.step",
    clicks: int = 5,
    size: float = 0.005,
    picture: Path | None = None,
) -> None:
    """Print the tables of the file and of a structure, and draw the picture.

    Parameters
    ----------
    part : file of CAD that is opened
    clicks : how many, each a little beside the one before
    size : of the elements of the structure [m]
    picture : file to draw, as pictures/opened_part.png
    """
    print(part.name)
    measured(Opened(part), clicks)
    mesh = ao.read_mesh(part, size=size)
    structure = ao.Structure(mesh, ao.material("steel S235"), [ao.Support("face 1")])
    print(f"{part.name}, elements of {size} m")
    measured(Opened(part, structure), clicks)
    if picture is not None:
        drawn(View(Opened(part), part.name, NOBODY), picture)


def measured(opened: Opened, clicks: int) -> None:
    """Print what each answer costs."""
    setup = json.loads(json.dumps(timed("skin", opened, "look", {})["setup"]))
    values: dict[str, Any] = {"tab": "one", "turn": 1, "setup": setup}
    print(f"dofs {timed('first blow', opened, 'blow', values)['dofs']}")
    for name in ("fields", "verdict", "speeds"):
        timed(name, opened, name, values)
    while not opened.warm:
        time.sleep(0.1)
    for _ in range(clicks):
        setup["point"][0] += 1e-4
        timed("click", opened, "blow", values)
    timed("settled", opened, "settle", values)
    opened.close()


def timed(label: str, opened: Opened, name: str, values: dict[str, Any]) -> Any:
    """The answer of a call, whose CPU seconds are printed."""
    began = time.process_time()
    found = opened.calls[name](values)
    print(f"{label:12}{time.process_time() - began:8.3f} s", flush=True)
    return found


def drawn(shown: View, picture: Path) -> None:
    """Draw the page with the stress of its first blow."""
    try:
        with Browser() as browser:
            browser.address(shown.address, 1300, 900)
            for _ in range(10 * PATIENCE):
                if browser.run("return document.documentElement.dataset.complete"):
                    break
                time.sleep(0.1)
            browser.run(STRESS)
            browser.picture(picture)
            print(picture, browser.said())
    finally:
        shown.close()


if __name__ == "__main__":
    options.command(main)
