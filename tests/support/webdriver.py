"""A headless Chromium for tests, driven by the W3C WebDriver protocol of chromedriver."""

from __future__ import annotations

import base64
import json
import re
import shutil
import subprocess
import urllib.request
from pathlib import Path
from typing import Any

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
#: Why there is none, or "".
MISSING = "" if CHROMIUM and DRIVER else "no browser: apt install chromium chromium-driver"
OPTIONS = [
    *("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--hide-scrollbars"),
    *("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
]
HTTP = urllib.request.build_opener(urllib.request.ProxyHandler({}))  # nothing leaves the machine


class Browser:
    """One page of a browser; a context manager."""

    def __init__(self, *options: str) -> None:
        assert DRIVER is not None
        self._driver = subprocess.Popen(
            [DRIVER, "--port=0"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        self._at = ""
        for line in self._driver.stdout or ():
            if found := re.search(r"started successfully on port (\d+)", line):
                self._at = f"http://127.0.0.1:{found[1]}/session"
                break
        asked = {"binary": CHROMIUM, "args": [*OPTIONS, *options]}
        wanted = {
            "goog:chromeOptions": asked,
            "goog:loggingPrefs": {"browser": "ALL", "performance": "ALL"},
        }
        made = self._call("POST", "", capabilities={"alwaysMatch": wanted})
        self._at += "/" + made["sessionId"]

    def _call(self, method: str, path: str, **content: Any) -> Any:
        data = json.dumps(content).encode() if method == "POST" else None
        request = urllib.request.Request(self._at + path, data, method=method)
        with HTTP.open(request, timeout=120) as answer:
            return json.load(answer)["value"]

    def open(self, page: Path, width: int, height: int = 1000) -> None:
        """Open a file in a page of this width."""
        self.address(page.resolve().as_uri(), width, height)

    def address(self, url: str, width: int, height: int = 1000) -> None:
        """Open an address in a page of this width."""
        self.resize(width, height)
        self._call("POST", "/url", url=url)

    def resize(self, width: int, height: int = 1000) -> None:
        """Give the page another width."""
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.command("Emulation.setDeviceMetricsOverride", **metrics)

    def command(self, name: str, **parameters: Any) -> Any:
        """A command of Chromium's DevTools."""
        return self._call("POST", "/goog/cdp/execute", cmd=name, params=parameters)

    def run(self, script: str, *arguments: Any) -> Any:
        """What a script returns."""
        return self._call("POST", "/execute/sync", script=script, args=list(arguments))

    def said(self) -> list[str]:
        """Errors and warnings of the page so far."""
        return [one["message"] for one in self._call("POST", "/se/log", type="browser")]

    def requested(self) -> list[str]:
        """Addresses that the page has asked for so far."""
        events = [
            json.loads(e["message"])["message"]
            for e in self._call("POST", "/se/log", type="performance")
        ]
        return [
            e["params"]["request"]["url"]
            for e in events
            if e["method"] == "Network.requestWillBeSent"
        ]

    def picture(self, path: Path) -> None:
        """Write what is seen as PNG."""
        path.write_bytes(base64.b64decode(self._call("GET", "/screenshot")))

    def __enter__(self) -> Browser:
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self._call("DELETE", "")
        finally:
            self._driver.terminate()
            self._driver.communicate(timeout=30)
