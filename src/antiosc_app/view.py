"""A part on a page in the browser: `antiosc open PART`, and `view` for a notebook."""

from __future__ import annotations

import contextlib
import os
import tempfile
import time
import webbrowser
from collections.abc import Iterator
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from antiosc.base import checks
from antiosc.base.errors import InputError, finite_element_packages
from antiosc.base.progress import print_text
from antiosc_app import live
from antiosc_app.inspecting import check_size
from antiosc_app.report import rendered_template
from antiosc_app.scene_file.run import communicator
from antiosc_app.server import PageServer

with finite_element_packages():
    from antiosc import read_mesh  # noqa: F401 (the page reads a part as soon as it is open)
    from antiosc_app.opened import OpenPart

if TYPE_CHECKING:
    from antiosc import Site, Structure

#: Sources that may show the page in a frame: none, or notebooks of this machine.
NO_FRAMES = "'none'"
NOTEBOOK_FRAMES = "'self' http://127.0.0.1:* http://localhost:*"
#: Height of the frame in a notebook [pixels].
FRAME_HEIGHT = 900


class View:
    """The page of a part, served on this machine until `close`; its `address` grants access."""

    def __init__(self, opened: OpenPart, title: str, frames: str) -> None:
        self._opened = opened
        program = live.page_script(live.OPEN_SCRIPT)
        html = rendered_template(
            live.PAGE_FOLDER / "open.html",
            title=title,
            style=live.page_style(),
            script=program,
            drawn="",
        )
        directives = (
            f"connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors {frames}"
        )
        page = html, f"{live.content_policy(program)}; {directives}"
        self._server = PageServer(page, opened.calls, opened.reports)
        self._server.start()
        self.address = self._server.address

    @property
    def site(self) -> Site | None:
        """The site that was last struck on the page; None before the first impact."""
        return self._opened.site

    def close(self) -> None:
        """Stop the server."""
        self._server.close()
        self._opened.close()

    def __repr__(self) -> str:
        return f"View at {self.address}"

    def _repr_html_(self) -> str:
        return (
            f'<iframe src="{escape(self.address)}" width="100%" height="{FRAME_HEIGHT}"'
            ' style="border: 0"></iframe>'
        )


def view(part: Structure | str | os.PathLike[str]) -> View:
    """Open a part on a page on which it can be struck, in a notebook below the cell, else at the
    page's address.

    A click sets the site; the page shows it as `Site(…)` to copy, and the returned object has it as
    `site`. The page is for browsers on this machine only.

    Parameters
    ----------
    part : Structure or path
        A structure with a mesh, which keeps its material and supports; or a file, as for
        `antiosc open`.

    Returns
    -------
    View
        With `address`, `site` and `close()`. It is served as long as the program runs.

    Raises
    ------
    InputError
        No file, a structure without a mesh, or a run on several MPI ranks.
    """
    if not isinstance(part, str | os.PathLike):
        from antiosc import Structure
        from antiosc.fem.structure.structure import with_parts

        checks.instance("part", part, Structure, "a Structure or the path of a file")
        with_parts(part)
        # scenes name a file that exists; the structure takes its place
        return _open_page(Path(__file__), part, NOTEBOOK_FRAMES)
    return _open_page(_part_file(part), None, NOTEBOOK_FRAMES)


def serve_until_interrupted(path: str, browser: bool, **options: Any) -> None:
    """Serve the page of a part's file until Ctrl-C; `browser`: whether to open it in one."""
    page = _open_page(_part_file(path), None, NO_FRAMES, **options)
    print_text(f"{path} is open at {page.address}\nit is for this machine alone; Ctrl-C ends it.")
    try:
        with _redirecting_page(page.address) as entrance:
            if browser:
                webbrowser.open(entrance.as_uri())
            while True:  # libraries let a longer wait go on after a signal
                time.sleep(1)
    except KeyboardInterrupt:
        print_text("closed.")
    finally:
        page.close()


@contextlib.contextmanager
def _redirecting_page(address: str) -> Iterator[Path]:
    """Context with a temporary page, readable only by this user, that leads to `address`.

    Other users can read the command line of the browser, and thus an address in it.
    """
    handle, name = tempfile.mkstemp(prefix="antiosc-", suffix=".html")  # of mode 0600
    path = Path(name)
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as stream:
            stream.write(f'<meta http-equiv="refresh" content="0; url={escape(address)}">\n')
        yield path
    finally:
        path.unlink(missing_ok=True)


def _part_file(part: str | os.PathLike[str]) -> Path:
    """The path of a part's file; InputError if it does not exist or is too large."""
    path = checks.path("the part", part)
    if not path.is_file():
        raise InputError(f"there is no file {checks.shown(str(path))} to open.")
    if not path.name.isprintable():
        raise InputError(f"the name {checks.shown(path.name)} has control characters: rename it.")
    check_size(path)
    return path


def _open_page(
    path: Path,
    structure: Structure | None,
    frames: str,
    unit: str | None = None,
    size: float | None = None,
    piece: int | None = None,
    contact: str | None = None,
) -> View:
    """Serve the page of a part's file, or of `structure` if it is given.

    `frames`: sources that may show the page in a frame; the others as for `inspect_part`.
    """
    comm = communicator()
    if comm is not None and comm.size > 1:
        raise InputError(f"a page is served by one process, not by {comm.size} MPI ranks.")
    if unit is not None:
        from antiosc.io.neutral import UnitSystem

        UnitSystem.of(unit)
    if size is not None:
        checks.positive("--size", size, "m")
    if piece is not None:
        checks.whole("--piece", piece)

    title = path.name if structure is None else "A part"
    return View(OpenPart(path, structure, unit, size, piece, contact), title, frames)
