"""The live report: bytes of its pages, time to the first picture, answers to the sliders.

Three pages: the bracket with its stress, the same with 100 000 dofs, and a map of the bracket. Each
is opened several times in a headless Chromium (whose OpenGL is software), and every slider is moved
over its range; the least times are told, for other processes only add to them. Needs chromium and
chromium-driver.

    .venv/bin/python benchmarks/live_report.py --help
"""

from __future__ import annotations

import re
import statistics
import sys
import time
import warnings
from pathlib import Path
from typing import Any

import options

import antiosc as ao

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests" / "support"))
from webdriver import Browser  # noqa: E402

ALUMINIUM = {"E": 70e9, "nu": 0.33, "rho": 2700.0}
STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
POINT, STRIKE = (0.020, 0.040, 0.075), (-0.2, -0.6, -0.8)
#: Milliseconds of `change` at each place of each slider.
SLIDE = """
const took = [];
for (const input of document.querySelectorAll("#sliders input")) {
  for (let place = 0; place <= 200; place += 10) {
    input.value = place;
    input.dispatchEvent(new Event("input"));
    took.push(Number(document.documentElement.dataset.took));
  }
  document.getElementById("back").click();
}
return took;
"""


def main(
    sizes: tuple[float, ...] = (6e-3, 4.5e-3, 3e-3), repeats: int = 5, out: Path = ROOT / "out"
) -> None:
    """Write the pages and print a table.

    Parameters
    ----------
    sizes : largest elements of the brackets, m; the first is that of the map
    repeats : how often each page is opened
    out : folder of the pages
    """
    out.mkdir(parents=True, exist_ok=True)
    pages = dict(impact(size, out) for size in sizes) | dict([mapped(sizes[0], out)])
    print(f"{'page':24}{'kB':>7}{'data':>7}{'pictures':>9}{'first picture':>15}{'a slider':>20}")
    with Browser() as browser:
        for name, page in pages.items():
            kb = {kind: size / 1e3 for kind, size in parts(page).items()}
            row = f"{name:24}{kb['page']:7.0f}{kb['data']:7.0f}{kb['pictures']:9.0f}"
            ready, took = opened(browser, page, repeats)
            median = f"{statistics.median(took):.1f}, at most {max(took):.1f} ms"
            print(f"{row}{ready:12.0f} ms{median:>24}", flush=True)


def impact(size: float, out: Path) -> tuple[str, Path]:
    """Name and report of an impact."""
    part, striker, contact = bracket(size)
    model = ao.extract(part, ao.Site(POINT, STRIKE, radius=2e-3, snap=True), n=20)
    hit = ao.simulate(model, striker, contact, 1e-3)
    return f"impact, {part.dofs} dofs", ao.write_report(hit, out / f"live_{part.dofs}.html", part)


def mapped(size: float, out: Path) -> tuple[str, Path]:
    """Name and report of a map with stresses."""
    part, striker, contact = bracket(size)
    warnings.simplefilter("ignore", ao.AccuracyWarning)  # of patches on coarse facets
    found = ao.impact_map(
        part, ["eye", "front"], striker, contact, 3e-4, radius=2e-3, n=20, modes=40, stress=True
    )
    print(f"stresses of {len(found)} sites: {found.info['seconds']['stresses']:.1f} s")
    return f"map, {len(found)} sites", ao.write_report(found, out / "live_map.html", part)


def bracket(size: float) -> tuple[ao.Structure, ao.Sphere, ao.Hertz]:
    """The bracket, the sphere that strikes it, and their contact."""
    mesh = ao.read_mesh(ROOT / "meshes/bracket.geo", size=size, refine=[(POINT, 2e-3)])
    material = ao.Solid(**ALUMINIUM, yield_strength=240e6)
    striker = ao.Sphere(radius=10e-3, **STEEL, velocity=2.0)
    contact = striker.hertz(ALUMINIUM["E"], ALUMINIUM["nu"], radii=(18e-3, float("inf")))
    return ao.Structure(mesh, material, [ao.Support("clamp")]), striker, contact


def parts(page: Path) -> dict[str, int]:
    """Bytes of a page, of its data and of its pictures."""
    text = page.read_text("utf-8")
    data = re.search(r'id="data">(.*?)</script>', text, re.DOTALL)
    assert data
    pictures = sum(map(len, re.findall(r'src="(data:[^"]*)"', text)))
    return {"page": len(text.encode()), "data": len(data[1]), "pictures": pictures}


def opened(browser: Browser, page: Path, repeats: int) -> tuple[float, list[float]]:
    """Least milliseconds until the first picture, and to answer each slider."""
    ready, took = [], []
    for _ in range(repeats):
        browser.open(page, 1300)
        ready.append(drawn(browser))
        took.append(browser.run(SLIDE))
    return min(ready), [min(each) for each in zip(*took, strict=True)]


def drawn(browser: Any) -> float:
    """Milliseconds from the start of loading until the page has drawn its first picture."""
    for _ in range(600):
        told = browser.run("return document.documentElement.dataset.ready")
        if told:
            return float(told)
        time.sleep(0.05)
    raise SystemExit(f"the page does not start: {browser.said()}")


if __name__ == "__main__":
    options.command(main)
