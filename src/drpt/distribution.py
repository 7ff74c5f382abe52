"""The distribution that pip installs: its name, its version and its extras.

The distribution is called `NAME`. The import and one of the commands are called ``drpt``. On PyPI,
``drpt`` is another project, so no message may advise to install it.
"""

from __future__ import annotations

import json
import shlex
from contextlib import suppress
from pathlib import Path
from urllib.parse import unquote, urlsplit

NAME = "drpt-render"
"""Name of the distribution, as in ``pyproject.toml``."""
VERSION = "0.1.0"
"""Version of the distribution. The build reads it here; a look-up of metadata would take 20 ms."""
EXTRAS = {
    "denoise": ("mitsuba-oidn",),
    "flip": ("flip-evaluator",),
    "notebook": ("ipywidgets",),
    "view": ("starlette", "uvicorn", "websockets"),
}
"""Extras, and the distributions that each of them installs, as in ``pyproject.toml``."""


def versions(*others: str) -> dict[str, str]:
    """Versions of drpt and of other distributions, by name.

    Raises
    ------
    importlib.metadata.PackageNotFoundError
        One of the others is not installed.
    """
    from importlib.metadata import version

    return {"drpt": VERSION, **{name: version(name) for name in others}}


def install_command(extra: str = "", *options: str) -> str:
    """Return the shell command that installs drpt again, with an extra and options of pip.

    pip records a source other than an index (PEP 610). The command installs from that folder or
    URL, or from the index if there is no such record or the source is gone.
    """
    wanted = f"[{extra}]" if extra else ""
    url, in_place = _source()
    path = Path(unquote(urlsplit(url).path)) if url.startswith("file:") else None
    if path is not None and path.is_dir():
        options += ("--editable",) if in_place else ()
        return f"cd {shlex.quote(str(path))} && {_pip_install(*options, f'.{wanted}')}"
    known = url and (path is None or path.exists())
    return _pip_install(*options, f"{NAME}{wanted} @ {url}" if known else f"{NAME}{wanted}")


def _pip_install(*arguments: str) -> str:
    return f"python -m pip install {shlex.join(arguments)}"


def _source() -> tuple[str, bool]:
    """URL from which drpt was installed, empty for an index, and whether it is editable."""
    from importlib.metadata import PackageNotFoundError, distribution

    record = None
    with suppress(PackageNotFoundError):
        record = distribution(NAME).read_text("direct_url.json")
    if record is None:
        return "", False
    found = json.loads(record)
    url: str = found["url"]
    if "vcs_info" in found:
        url = "{vcs}+{url}@{commit_id}".format(url=url, **found["vcs_info"])
    return url, bool(found.get("dir_info", {}).get("editable"))
