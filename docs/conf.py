"""How Sphinx builds the documentation: ``make docs``."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from drpt.cli import COMMANDS
from drpt.cli.parser import Parser
from drpt.distribution import VERSION

if TYPE_CHECKING:
    from sphinx.application import Sphinx

project = "drpt"
author = copyright = "the drpt authors"
version = release = VERSION

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx-mathjax-offline",
    "sphinx_copybutton",
]
default_role = "py:obj"
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3

add_module_names = False
autodoc_default_options = {"members": True}
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
napoleon_attr_annotations = False  # the signature has them
napoleon_use_ivar = True
napoleon_use_param = False  # keeps "eye, target" together
napoleon_use_rtype = False

html_theme = "furo"
html_title = f"drpt {version}"
html_static_path = ["_static"]
html_css_files = ["pages.css"]
html_show_sphinx = False
copybutton_prompt_text = "$ "
copybutton_only_copy_prompt_lines = True

HELP_COLUMNS = 88


def setup(app: Sphinx) -> None:
    """Let the reference of the commands hold what they say themselves."""
    app.connect("source-read", _add_commands)


def _add_commands(_: Sphinx, page: str, source: list[str]) -> None:
    if page == "reference/commands":
        source[0] += _commands()


def _commands() -> str:
    """Return a section in Markdown for each subcommand."""
    os.environ["COLUMNS"] = str(HELP_COLUMNS)
    commands = Parser(prog="drpt").add_subparsers()
    for command in COMMANDS:
        command.add(commands)
    return "".join(
        f"\n## drpt {name}\n\n```text\n{parser.format_help()}```\n"
        for name, parser in commands.choices.items()
    )
