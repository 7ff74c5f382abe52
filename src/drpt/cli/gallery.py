"""`drpt gallery`."""

from __future__ import annotations

from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from drpt.cli.interrupts import interrupts_noted
from drpt.cli.status import STATUSES, TERMINATED, bad_input
from drpt.files import check_file
from drpt.kernel import backend

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable, Iterator

    from drpt.cli.interrupts import Request
    from drpt.cli.parser import Commands

FOLDER = Path("out/gallery")
SIZE, QUICK_SIZE = 256, 64


def add(commands: Commands) -> None:
    """Declare the flags."""
    parser = commands.add_parser(
        "gallery",
        help="render a rendering course's pictures onto a page",
        description="""Render a rendering course's figures, in about a minute, and write a page with
the pictures side by side, their times and errors, and measured answers to the
course's questions. Ctrl-C and SIGTERM leave a page of what is finished.""",
        epilog=f"""examples:
  drpt gallery
  drpt gallery --quick -o preview

exit status: {STATUSES}, {TERMINATED} after SIGTERM""",
    )
    parser.add_argument(
        "-o",
        "--output",
        metavar="FOLDER",
        type=Path,
        default=FOLDER,
        help="write index.html there, one file that holds all pictures (default: %(default)s)",
    )
    parser.add_argument(
        "--quick",
        action="store_true",
        help=f"pictures of {QUICK_SIZE}x{QUICK_SIZE} pixels instead of {SIZE}x{SIZE}",
    )
    parser.set_defaults(parser=parser, run=run)


def run(args: argparse.Namespace) -> int:
    """Make the gallery, and name its page."""
    from drpt.gallery.figures import course_plan
    from drpt.gallery.making import PAGE, make_gallery, steps

    folder: Path = args.output
    with bad_input(args.parser):
        if folder.exists() and not folder.is_dir():
            raise NotADirectoryError(f"{folder}: this is a file, and the gallery needs a folder")
        folder.mkdir(parents=True, exist_ok=True)
        check_file(folder / PAGE)
        backend.load()
    plan = course_plan(QUICK_SIZE if args.quick else SIZE)
    with (
        interrupts_noted("this picture") as request,
        _step_bar(steps(plan)) as on_step,
        suppress(KeyboardInterrupt),
    ):
        make_gallery(folder, plan, _until(request, on_step))
    print(folder / PAGE)
    return request.status


def _until(request: Request, on_step: Callable[[str], None]) -> Callable[[str], None]:
    """Return what ends the work before the first step after a signal."""

    def step(words: str) -> None:
        if request.signal:
            raise KeyboardInterrupt
        on_step(words)

    return step


@contextmanager
def _step_bar(total: int) -> Iterator[Callable[[str], None]]:
    """Draw a bar on a terminal; gives what is to be called before each step."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.description}", markup=False),
    )
    console = Console(stderr=True)
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task("", total=total, completed=-1)  # the step that has begun is not done

        def step(words: str) -> None:
            bar.update(task, advance=1, description=words)

        yield step
