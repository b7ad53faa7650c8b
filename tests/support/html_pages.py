"""What a reader of the built pages meets: links, pictures, the width of a telephone."""

from __future__ import annotations

import contextlib
import functools
import html
import http.server
import json
import re
import shutil
import subprocess
import threading
import time
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import quote, unquote, urldefrag

from webdriver import Browser

TELEPHONE = 390  # width in pixels


class Page(HTMLParser):
    """Anchors, links and pictures of a page."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.pictures: list[str] = []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value for name, value in attrs if value is not None}
        self.anchors |= {given[name] for name in ("id", "name") if name in given}
        if tag in ("a", "link") and "href" in given:
            self.links.append(given["href"])
        if tag in ("img", "script") and "src" in given:
            self.pictures.append(given["src"])


def faults(folder: Path) -> list[str]:
    """Dead links, missing pictures and anchors, and what is loaded from elsewhere, of all pages."""
    pages = {path.resolve(): Page(path) for path in sorted(folder.rglob("*.html"))}
    found = []
    for path, page in pages.items():
        found += [f"{path.name}: {one} is elsewhere" for one in page.pictures if "://" in one]
        for link in [*page.links, *page.pictures]:
            if re.match(r"[a-z]+:", link) or link == "#":
                continue
            place, anchor = urldefrag(unquote(link))
            target = (path.parent / place.split("?")[0]).resolve() if place else path
            if not target.exists():
                found.append(f"{path.name}: {link} does not exist")
            elif anchor and target in pages and anchor not in pages[target].anchors:
                found.append(f"{path.name}: {link} has no such place")
    return found


def loaded(folder: Path) -> dict[str, dict[str, int]] | None:
    """Every page in a headless browser as wide as a telephone, or None where there is no browser.

    Page -> its width ("width"), pictures that did not load ("missing"), letters ("text").
    """
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    if browser is None:
        return None
    pages = [path.relative_to(folder) for path in folder.rglob("*.html")]
    names = sorted(str(page) for page in pages if page.parts[0] != "_static")  # no page: a report
    (folder / "probe.html").write_text(PROBE.replace("NAMES", json.dumps(names)), encoding="utf-8")
    with served(folder) as address:
        command = [
            *(browser, "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"),
            *("--virtual-time-budget=600000", "--timeout=600000", "--window-size=1200,900"),
            f"--user-data-dir={folder.parent / 'browser'}",
            *("--dump-dom", f"{address}/probe.html"),
        ]
        said = subprocess.run(command, capture_output=True, text=True, timeout=600, check=False)
    (folder / "probe.html").unlink()
    result = re.search(r"<pre[^>]*>(.*?)</pre>", said.stdout, re.DOTALL)
    assert result, said.stderr[-2000:]
    found = json.loads(html.unescape(result[1]))
    assert sorted(found) == names
    return found


@contextlib.contextmanager
def served(folder: Path) -> Iterator[str]:
    """The address of a server of the folder: a search fetches pages, which files may not."""
    handler = functools.partial(Quiet, directory=str(folder))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield f"http://127.0.0.1:{server.server_port}"
        finally:
            server.shutdown()


class Quiet(http.server.SimpleHTTPRequestHandler):
    """A server that does not print its requests."""

    def log_message(self, *_: object) -> None:
        pass


def searched(folder: Path, words: list[str]) -> tuple[dict[str, str], list[str], str]:
    """The first page that a search finds for each word, what the console says, and the theme.

    The theme is the one after a click on its button.
    """
    first = {}
    with served(folder) as address, Browser() as browser:
        for word in words:
            browser.address(f"{address}/search.html?q={quote(word)}", 1300)
            for _ in range(200):
                first[word] = browser.run(FIRST)
                if first[word]:
                    break
                time.sleep(0.05)
        said = browser.said()
        for name in ("index.html", "glossary.html", "api/index.html"):
            browser.address(f"{address}/{name}", 1300)
            said += browser.said()
        browser.run("document.querySelector('.content .theme-toggle').click()")
        # pages have no icon; Debian 13's theme has a fault of its own
        said = [one for one in said if "favicon.ico" not in one and "/furo.js" not in one]
        return first, said, browser.run("return document.body.dataset.theme")


FIRST = "return document.querySelector('#search-results li a')?.getAttribute('href') || ''"
PROBE = f"""<!doctype html><body><pre id="out">{{}}</pre><script>
const names = NAMES, found = {{}};
function next() {{
  const name = names.shift();
  if (!name) {{ document.getElementById("out").textContent = JSON.stringify(found); return; }}
  const frame = document.createElement("iframe");
  frame.style.width = "{TELEPHONE}px"; frame.style.height = "800px";
  frame.onload = () => {{
    const page = frame.contentDocument;
    const missing = [...page.images].filter((one) => !one.complete || !one.naturalWidth).length;
    found[name] = {{width: page.documentElement.scrollWidth, missing: missing,
                    text: page.body.innerText.length}};
    frame.remove(); next();
  }};
  frame.src = name; document.body.appendChild(frame);
}}
next();
</script></body>"""
