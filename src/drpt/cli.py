"""The command line: flags to calls, nothing else.

A subcommand is a function in `_COMMANDS` that adds its flags, and one that runs it.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, NoReturn, TypeAlias

import drpt
from drpt import doctor
from drpt.crosscheck.check import Verdict, check
from drpt.crosscheck.estimate import PASSES, check_spp
from drpt.crosscheck.maps import save_maps
from drpt.crosscheck.references import (
    BOUNCES,
    MITSUBA,
    SPP,
    Reference,
    render_reference,
    stored_reference,
)
from drpt.kernel import backend
from drpt.output import SUFFIXES, check_target
from drpt.render import SAMPLERS, Mode, Rendering
from drpt.scene import Scene, load_scene
from drpt.scene.builtin import builtin_descriptions

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from drpt.render import Result

    _Commands: TypeAlias = "argparse._SubParsersAction[_Parser]"

FAILED = 1
BAD_INPUT = 2
INTERRUPTED = 130

ALL = "all"
"""All modes, in place of one."""
MAX_THREADS = 1024
"""More than the cores of a machine; the system refuses to start very many more."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run `drpt` and return its exit status.

    Raises
    ------
    SystemExit
        With status 2 on bad usage or a bad scene, with 0 after ``--help`` and ``--version``.
    """
    program, unread = "drpt", 0
    try:
        args = _parse(argv)
        program, unread = args.parser.prog, getattr(args, "unread", 0)
        status: int = args.run(args)
        print(end="", flush=True)
    except KeyboardInterrupt:
        _say(f"{program}: interrupted")
        return INTERRUPTED
    except BrokenPipeError:
        _drop_stdout()
        return unread
    except (OSError, MemoryError, backend.BackendError) as error:
        _say(f"{program}: error: {error}")
        return FAILED
    return status


def render_main(argv: Sequence[str] | None = None) -> int:
    """Run `drpt-render`, which is `drpt render`, and return its exit status."""
    return main(["render", *(sys.argv[1:] if argv is None else argv)])


def _parse(argv: Sequence[str] | None) -> argparse.Namespace:
    args, unknown = _parser().parse_known_args(argv)
    if unknown:
        args.parser.error(f"unknown arguments: {' '.join(unknown)}")
    return args


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are one line, and whose flags are written in full."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(
            allow_abbrev=False, formatter_class=argparse.RawDescriptionHelpFormatter, **settings
        )

    def error(self, message: str) -> NoReturn:
        _say(f"{self.prog}: error: {message.removeprefix('argument ')}")
        sys.exit(BAD_INPUT)

    def _print_message(self, message: str, file: Any = None) -> None:
        print(message, end="", file=file, flush=True)  # argparse would swallow an OSError


def _parser() -> _Parser:
    parser = _Parser(
        prog="drpt",
        description="A small, fast, exact path tracer.",
        epilog="""first steps:
  drpt scenes                               scenes to choose from
  drpt render cornell-box -o cornell.png    a picture
  drpt render --help                        all that can be set""",
    )
    _add_version(parser)
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    for add in _COMMANDS:
        add(commands)
    return parser


def _add_render(commands: _Commands) -> None:
    parser = commands.add_parser(
        "render",
        prog="drpt-render",
        help="render a scene into pictures (also: drpt-render)",
        description="Render a scene into pictures.",
        epilog="""examples:
  drpt-render cornell-box
  drpt-render cornell-box --spp 256 --bounces 2 --mode explicit -o box.exr -o box.png
  drpt-render my.toml --width 512 --height 512 --spp 16 -o preview.png --exposure 1.5

exit status: 0; 1 if the run failed; 2 for bad input; 130 after Ctrl-C""",
    )
    _add_scene(parser)
    _add_pictures(parser.add_argument_group("pictures"))
    _add_transport(parser.add_argument_group("light"))
    samples = parser.add_argument_group("samples")
    _add_sampling(samples)
    samples.add_argument(
        "--no-jitter",
        dest="jitter",
        action="store_false",
        help="send every camera ray through the centre of its pixel",
    )
    run = parser.add_argument_group("run")
    run.add_argument(
        "--threads", metavar="N", type=_thread_count, help="CPU threads (default: one per core)"
    )
    run.add_argument("--quiet", action="store_true", help="print warnings and errors alone")
    _add_version(parser)
    parser.set_defaults(parser=parser, run=_render)


def _add_scene(parser: _Parser) -> None:
    parser.add_argument(
        "scene", metavar="SCENE", help="a built-in scene (drpt scenes lists them) or a scene file"
    )


def _add_pictures(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "-o",
        "--output",
        metavar="OUT",
        type=Path,
        action="append",
        help=f"a picture to write ({', '.join(SUFFIXES)}); may be repeated "
        "(default: SCENE.exr in the current folder)",
    )
    _add_size(group)
    group.add_argument(
        "--exposure",
        metavar="STOPS",
        type=_number,
        default=0.0,
        help="brighten a .png by so many stops (default: 0)",
    )


def _add_size(group: argparse._ActionsContainer) -> None:
    group.add_argument("--width", metavar="N", type=_integer, help="pixels (default: the scene's)")
    group.add_argument("--height", metavar="N", type=_integer, help="pixels (default: the scene's)")


def _add_transport(group: argparse._ActionsContainer, modes: Sequence[str] = tuple(Mode)) -> None:
    group.add_argument(
        "--bounces",
        metavar="N",
        type=_integer,
        default=3,
        help="how often light bounces at most: 0 shows the lights, 1 adds what they light, "
        "2 one indirect bounce, ... (default: 3)",
    )
    group.add_argument(
        "--mode",
        metavar="M",
        default="mis",
        help=f"how light is found: {', '.join(modes)} (default: %(default)s)",
    )


def _add_sampling(group: argparse._ActionsContainer, spp: int = 64) -> None:
    group.add_argument(
        "--spp",
        metavar="N",
        type=_integer,
        default=spp,
        help="samples per pixel; more give less noise (default: %(default)s)",
    )
    group.add_argument(
        "--sampler",
        metavar="S",
        default="sobol",
        help=f"{', '.join(SAMPLERS)} (default: %(default)s)",
    )
    group.add_argument(
        "--seed",
        metavar="N",
        type=_integer,
        default=0,
        help="another number gives other noise (default: %(default)s)",
    )


def _add_check(commands: _Commands) -> None:
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

exit status: 0; 1 if a picture differs or the run failed; 2 for bad input; 130 after Ctrl-C""",
    )
    _add_scene(parser)
    parser.add_argument(
        "--against",
        metavar="REF",
        default=MITSUBA.lower(),
        help="mitsuba, or an .exr of the same view; its layer 'variance' tells its noise "
        "(default: %(default)s)",
    )
    parser.add_argument(
        "-o",
        "--output",
        metavar="FOLDER",
        type=Path,
        help="write image, reference, error and p-values there as pictures "
        "(default: only those that differ, to SCENE-check)",
    )
    _add_size(parser)
    _add_transport(parser.add_argument_group("light"), modes=(*Mode, ALL))
    _add_sampling(parser.add_argument_group("samples"), spp=SPP)
    parser.set_defaults(parser=parser, run=_check, bounces=None, unread=FAILED)


def _add_scenes(commands: _Commands) -> None:
    parser = commands.add_parser(
        "scenes",
        help="list the built-in scenes",
        description="List the built-in scenes: the name that drpt-render takes, and what it shows.",
    )
    parser.set_defaults(parser=parser, run=_scenes)


def _add_explain(commands: _Commands) -> None:
    parser = commands.add_parser(
        "explain",
        help="say what is compiled for a scene",
        description="Say what the kernels compiled for a scene contain, and what they leave out.",
        epilog="""example:
  drpt explain cornell-box --bounces 2 --mode explicit""",
    )
    _add_scene(parser)
    _add_transport(parser.add_argument_group("light"))
    parser.set_defaults(parser=parser, run=_explain)


def _add_doctor(commands: _Commands) -> None:
    parser = commands.add_parser(
        "doctor",
        help="say what was found on this machine",
        description="Say what drpt found on this machine: LLVM, CUDA, folders and versions.",
    )
    parser.set_defaults(parser=parser, run=_doctor)


_COMMANDS = (_add_render, _add_check, _add_scenes, _add_explain, _add_doctor)


def _add_version(parser: _Parser) -> None:
    parser.add_argument(
        "--version",
        action="version",
        version=f"%(prog)s {drpt.__version__}",
        help="say the version",
    )


def _integer(text: str) -> int:
    with suppress(ValueError):  # Python reads no thousands of digits
        if re.fullmatch("[+-]?[0-9]+", text):
            return int(text)
    raise argparse.ArgumentTypeError(f"{text!r} is not an integer")


def _thread_count(text: str) -> int:
    count = _integer(text)
    if not 1 <= count <= MAX_THREADS:
        allowed = f"a whole number from 1 to {MAX_THREADS}"
        raise argparse.ArgumentTypeError(f"{count} is not allowed; it must be {allowed}")
    return count


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number") from None


def _render(args: argparse.Namespace) -> int:
    name = Path(args.scene).stem
    outputs: list[Path] = args.output or [Path(f"{name}.exr")]
    with _bad_input(args.parser):
        rendering = _rendering(args)
        for path in outputs:
            check_target(path, exposure=args.exposure)
        backend.load()
    if args.threads is not None:
        backend.set_thread_count(args.threads)
    result = _run(rendering, progress=sys.stderr.isatty() and not args.quiet)
    for path in outputs:
        result.save(path, exposure=args.exposure)
    if result.warning:
        _say(f"{args.parser.prog}: warning: {result.warning}")
    if not args.quiet:
        print(_summary(result, name), *outputs, sep="\n")
    return 0


def _check(args: argparse.Namespace) -> int:
    modes = list(Mode) if args.mode == ALL else [args.mode]
    bounces = BOUNCES if args.bounces is None else args.bounces
    folder: Path = args.output or Path(f"{Path(args.scene).stem}-check")
    reference = None
    with _bad_input(args.parser):
        scene = _resized(load_scene(args.scene), args.width, args.height)
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
    """Check one mode, print the report and write the maps; return whether nothing differs."""
    with _pass_bar(mode) as on_pass:
        report = check(
            reference, mode, args.spp, sampler=args.sampler, seed=args.seed, on_pass=on_pass
        )
    print(f"\n{report}", flush=True)
    passed = report.verdict != Verdict.FAIL
    if args.output or not passed:
        prefix = f"{report.mode}-{reference.bounces}-"
        print("  maps", *save_maps(report.comparison, folder, prefix), sep="\n    ", flush=True)
    return passed


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


def _scenes(_: argparse.Namespace) -> int:
    descriptions = builtin_descriptions()
    width = max(map(len, descriptions))
    for name, description in descriptions.items():
        print(f"{name:{width}}  {description}")
    return 0


def _explain(args: argparse.Namespace) -> int:
    with _bad_input(args.parser):
        scene = load_scene(args.scene)
        explanation = drpt.explain(scene, bounces=args.bounces, mode=args.mode)
    print(explanation)
    return 0


def _doctor(_: argparse.Namespace) -> int:
    return doctor.main()


def _rendering(args: argparse.Namespace) -> Rendering:
    return Rendering(
        _resized(load_scene(args.scene), args.width, args.height),
        args.spp,
        args.bounces,
        args.mode,
        sampler=args.sampler,
        seed=args.seed,
        jitter=args.jitter,
    )


def _resized(scene: Scene, width: int | None, height: int | None) -> Scene:
    camera = scene.camera
    width = camera.width if width is None else width
    height = camera.height if height is None else height
    return replace(scene, camera=replace(camera, width=width, height=height))


def _run(rendering: Rendering, *, progress: bool) -> Result:
    passes = rendering.passes()
    for _ in _with_progress(rendering, passes) if progress else passes:
        pass
    return rendering.result()


def _with_progress(rendering: Rendering, passes: Iterator[int]) -> Iterator[int]:
    """Draw a bar on stderr while the passes run; it vanishes after the last."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        BarColumn(),
        TextColumn("{task.completed:.0f}/{task.total:.0f} spp"),
        TextColumn("{task.fields[speed]:.1f} Mpaths/s"),
        TimeRemainingColumn(),
    )
    camera = rendering.scene.camera
    start = perf_counter()
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=rendering.spp, speed=0.0)
        for spp in passes:
            paths = camera.width * camera.height * spp
            bar.update(task, completed=spp, speed=paths / (perf_counter() - start) / 1e6)
            yield spp


def _summary(result: Result, name: str) -> str:
    height, width, _ = result.image.shape
    bounces = f"{result.bounces} bounce{'' if result.bounces == 1 else 's'}"
    size = f"{width}x{height}"
    what = (name, size, f"{result.spp} spp", bounces, result.mode, result.sampler)
    mega = 1e6 * result.seconds
    speed = (
        f"{result.seconds:.2f} s",
        f"{result.paths / mega:.1f} Mpaths/s",
        f"{result.rays / mega:.1f} Mrays/s",
    )
    return "\n".join(("  ".join(what), "  ".join(speed)))


@contextmanager
def _bad_input(parser: _Parser) -> Iterator[None]:
    """Turn what is wrong with the input into the parser's error."""
    try:
        yield
    except OSError as error:
        named = error.filename and error.strerror
        parser.error(f"{error.filename}: {error.strerror}" if named else str(error))
    except ValueError as error:
        parser.error(str(error))


def _say(line: str) -> None:
    print(*line.splitlines(), file=sys.stderr)


def _drop_stdout() -> None:
    """Send what is left in stdout nowhere: its reader has gone, and Python would complain."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
