"""A headless browser for tests."""

from __future__ import annotations

import shutil
import subprocess

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "chrome"))), None)


def browse(*arguments: str) -> str:
    """What a headless browser prints."""
    options = ["--headless", "--no-sandbox", "--disable-dev-shm-usage"]
    assert BROWSER is not None
    done = subprocess.run(
        [BROWSER, *options, *arguments], capture_output=True, text=True, timeout=300, check=True
    )
    return done.stdout
