"""`drpt check`."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from drpt.cli.parser import add_sampling, add_scene, add_size, add_transport
from drpt.cli.status import FAILED, bad_input
from drpt.crosscheck.check import Verdict, check
from drpt.crosscheck.estimate import PASSES, check_spp
from drpt.crosscheck.references import (
    BOUNCES,
    MITSUBA,
    SPP,
    Reference,
    render_reference,
    stored_reference,
)
from drpt.kernel import backend
from drpt.render import Mode, Rendering
from drpt.scene import Scene, load_scene

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable, Iterator

    from drpt.cli.parser import Commands

ALL = "all"
"""All modes, in place of one."""


def add(commands: Commands) -> None:
    """Declare the flags."""
    parser = commands.add_parser(
        "check",
        help="hold pictures against Mitsuba 3",
        description="""Render a scene with drpt and with Mitsuba 3, or take a reference from a file,
and test whether both pictures have the same expectation: the mean of the image,
and blocks of pixels of all sizes. Each of the two tests fails by chance once in
1000 times.""",
        epilog="""examples:
  drpt check cornell-box
  drpt check veach --mode all --bounces 2
  drpt check my.toml --width 128 --height 128 --spp 4096 -o maps
  drpt check cornell-box --mode implicit --against reference/cornell-box-3.exr

exit status: 0; 1 if a picture differs, with --strict also if a check cannot tell, or the run
failed; 2 for bad input; 130 after Ctrl-C""",
    )
    add_scene(parser)
    parser.add_argument(
        "--against",
        metavar="REF",
        default=MITSUBA.lower(),
        help="mitsuba, or an .exr of the same view whose layer 'standard_error' or 'variance' "
        "tells its noise (default: %(default)s)",
    )
    parser.add_argument(
        "--strict",
        action="store_true",
        help="end with status 1 also where a check cannot tell",
    )
    parser.add_argument(
        "-o",
        "--output",
        metavar="FOLDER",
        type=Path,
        help="write image, reference, error and p-values there as pictures "
        "(default: only those that differ, to SCENE-check)",
    )
    add_size(parser)
    add_transport(parser.add_argument_group("light"), modes=(*Mode, ALL))
    add_sampling(parser.add_argument_group("samples"), spp=SPP)
    parser.set_defaults(parser=parser, run=run, bounces=None, unread=FAILED)


def run(args: argparse.Namespace) -> int:
    """Check each mode, and print the reports."""
    modes = list(Mode) if args.mode == ALL else [args.mode]
    bounces = BOUNCES if args.bounces is None else args.bounces
    folder: Path = args.output or Path(f"{Path(args.scene).stem}-check")
    reference = None
    with bad_input(args.parser):
        scene = load_scene(args.scene).resized(args.width, args.height)
        for mode in modes:
            settings = {"sampler": args.sampler, "seed": args.seed}
            Rendering(scene, check_spp(args.spp), bounces, mode, **settings)
        if args.against != MITSUBA.lower():
            reference = _stored(args, scene)
        if folder.exists() and not folder.is_dir():
            raise NotADirectoryError(f"{folder}: this is a file, and maps need a folder")
        if args.output:
            folder.mkdir(parents=True, exist_ok=True)
        backend.load()
    if reference is None:
        with _pass_bar(MITSUBA) as on_pass:
            reference = render_reference(scene, args.spp, bounces, args.seed, on_pass=on_pass)
    print(reference, flush=True)
    passed = [_checked(args, reference, mode, folder) for mode in modes]
    return 0 if all(passed) else FAILED


def _stored(args: argparse.Namespace, scene: Scene) -> Reference:
    """Read the reference; a size that was asked for must be its."""
    reference = stored_reference(scene, args.against, args.bounces)
    camera = reference.scene.camera
    for name, asked, size in (
        ("width", args.width, camera.width),
        ("height", args.height, camera.height),
    ):
        if asked not in (None, size):
            raise ValueError(
                f"{name}: {asked} is not allowed; it must be {size}, as in {args.against}"
            )
    return reference


def _checked(args: argparse.Namespace, reference: Reference, mode: str, folder: Path) -> bool:
    """Check one mode, print the report and write the maps; return whether the verdict will do."""
    with _pass_bar(mode) as on_pass:
        report = check(
            reference, mode, args.spp, sampler=args.sampler, seed=args.seed, on_pass=on_pass
        )
    print(f"\n{report}", flush=True)
    if args.output or report.verdict == Verdict.DIFFERS:
        print("  maps", *report.save(folder), sep="\n    ", flush=True)
    return report.verdict == Verdict.AGREES or (
        report.verdict == Verdict.CANNOT_TELL and not args.strict
    )


@contextmanager
def _pass_bar(name: str) -> Iterator[Callable[[int], None]]:
    """Draw a bar on a terminal while passes run; gives what is to be called after each."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn(name), BarColumn(), TimeRemainingColumn())
    console = Console(stderr=True)
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task("", total=PASSES)
        yield lambda passes: bar.update(task, completed=passes)
