"""`drpt render`, which is `drpt-render`."""

from __future__ import annotations

import sys
from contextlib import closing, suppress
from dataclasses import replace
from pathlib import Path
from secrets import token_hex
from tempfile import gettempdir
from typing import TYPE_CHECKING

import numpy as np

from drpt.cli.interrupts import interrupts_noted
from drpt.cli.parser import (
    add_display,
    add_sampling,
    add_scene,
    add_size,
    add_transport,
    add_version,
    number,
    thread_count,
)
from drpt.cli.status import FAILED, STATUSES, TERMINATED, bad_input, drop_stdout, say
from drpt.denoise import load_denoiser
from drpt.distribution import NAME
from drpt.kernel import backend
from drpt.output import SUFFIXES, check_target
from drpt.progress import with_bar
from drpt.render import Rendering, explain
from drpt.scene import load_scene

if TYPE_CHECKING:
    import argparse
    from collections.abc import Generator

    from numpy.typing import NDArray

    from drpt.cli.interrupts import Request
    from drpt.cli.parser import Commands
    from drpt.render import Result
    from drpt.tev import Preview


def add(commands: Commands) -> None:
    """Declare the flags."""
    parser = commands.add_parser(
        "render",
        prog="drpt-render",
        help="render a scene into pictures (also: drpt-render)",
        description="Render a scene into pictures.",
        epilog=f"""examples:
  drpt-render cornell-box
  drpt-render cornell-box --spp 256 --bounces 2 --mode explicit -o box.exr -o box.png
  drpt-render my.toml --width 512 --height 512 --spp 16 -o preview.png --exposure 1.5
  drpt-render veach -o veach.exr -o veach.png --curve filmic
  drpt-render cornell-box --spp 65536 --target-error 1e-4 --checkpoint box.drpt

Ctrl-C and SIGTERM stop after the running pass and write the picture so far.

exit status: {STATUSES}, {TERMINATED} after SIGTERM""",
    )
    add_scene(parser)
    _add_pictures(parser.add_argument_group("pictures"))
    add_transport(parser.add_argument_group("light"))
    samples = parser.add_argument_group("samples")
    add_sampling(samples)
    samples.add_argument(
        "--no-jitter",
        dest="jitter",
        action="store_false",
        help="send every camera ray through the centre of its pixel",
    )
    _add_end(parser.add_argument_group("end"))
    machine = parser.add_argument_group("run")
    machine.add_argument(
        "--tev", metavar="HOST:PORT", help="show the picture in a running tev while it is rendered"
    )
    machine.add_argument(
        "--threads", metavar="N", type=thread_count, help="CPU threads (default: one per core)"
    )
    machine.add_argument("--quiet", action="store_true", help="print warnings and errors alone")
    machine.add_argument(
        "--explain", action="store_true", help="say first what is compiled, what is left out, why"
    )
    add_version(parser)
    parser.set_defaults(parser=parser, run=run)


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
    add_size(group)
    add_display(group)
    group.add_argument(
        "--layers",
        action="store_true",
        help="give an .exr albedo, normal and depth of what the camera sees first",
    )
    group.add_argument(
        "--denoise",
        action="store_true",
        help="denoise the picture by Open Image Denoise, which makes it biased; "
        f"it needs the extra {NAME}[denoise]",
    )


def _add_end(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--target-error",
        metavar="E",
        type=number,
        help="stop as soon as the estimated relMSE of the picture is E; --spp is the most it takes",
    )
    group.add_argument(
        "--time-limit",
        metavar="S",
        type=number,
        help="stop as soon as S seconds are over; --spp is the most it takes",
    )
    group.add_argument(
        "--no-error",
        dest="error",
        action="store_false",
        help="do not estimate the error, which saves memory",
    )
    group.add_argument(
        "--checkpoint",
        metavar="FILE",
        type=Path,
        help="keep the state there; the same command goes on from it, to the same picture",
    )
    group.add_argument(
        "--checkpoint-interval",
        metavar="S",
        type=number,
        default=30.0,
        help="seconds between two states (default: %(default)g)",
    )


def run(args: argparse.Namespace) -> int:
    """Render the scene, and write and name the pictures."""
    name = Path(args.scene).stem
    outputs: list[Path] = args.output or [Path(f"{name}.exr")]
    with bad_input(args.parser):
        _check_files(args, outputs)
        preview = _preview(args, name)
        if args.denoise:
            load_denoiser()
        rendering = _rendering(args)
        backend.load()
    if args.threads is not None:
        backend.set_thread_count(args.threads)
    if args.explain:
        _print(str(explain(rendering.settings.scene, args.bounces, args.mode)))
    with interrupts_noted() as request:
        first_hits = rendering.first_hits() if args.layers or args.denoise else {}
        _run(rendering, request, preview, progress=_on_terminal() and not args.quiet)
        result = _finished(rendering.final_result(), first_hits, args)
        places = [_save(result, path, args) for path in outputs]
    if result.warning:
        say(f"{args.parser.prog}: warning: {result.warning}")
    if not args.quiet:
        _print(_summary(result, name), *filter(None, places))
    return request.status or (0 if places == outputs else FAILED)


def _check_files(args: argparse.Namespace, outputs: list[Path]) -> None:
    for path in outputs:
        check_target(path, exposure=args.exposure, curve=args.curve)
        if args.checkpoint and args.checkpoint.resolve() == path.resolve():
            allowed = "another file than the pictures"
            raise ValueError(f"checkpoint: {path} is not allowed; it must be {allowed}")


def _rendering(args: argparse.Namespace) -> Rendering:
    return Rendering(
        load_scene(args.scene).resized(args.width, args.height),
        args.spp,
        args.bounces,
        args.mode,
        sampler=args.sampler,
        seed=args.seed,
        jitter=args.jitter,
        error=args.error,
        target_error=args.target_error,
        time_limit=args.time_limit,
        checkpoint=args.checkpoint,
        checkpoint_interval=args.checkpoint_interval,
    )


def _preview(args: argparse.Namespace, name: str) -> Preview | None:
    if args.tev is None:
        return None
    from drpt.tev import Preview

    return Preview(args.tev, name)


def _run(
    rendering: Rendering, request: Request, preview: Preview | None, *, progress: bool
) -> None:
    """Run passes until the last, or until a signal asks for an end."""
    with closing(rendering.passes()) as passes:
        for _ in _with_bar(rendering, passes) if progress else passes:
            if preview:
                preview.update(rendering.result().image)
            if request.signal:
                break


def _with_bar(rendering: Rendering, passes: Generator[int]) -> Generator[int]:
    from rich.console import Console

    return with_bar(rendering, passes, Console(stderr=True))


def _on_terminal() -> bool:
    return sys.stderr is not None and sys.stderr.isatty()  # a service may have closed it


def _finished(
    result: Result, first_hits: dict[str, NDArray[np.float32]], args: argparse.Namespace
) -> Result:
    """The picture, with the layers that are wanted, denoised if that is wanted."""
    guided = replace(result, layers={**result.layers, **first_hits})
    finished = guided.denoise() if args.denoise else guided
    return finished if args.layers else replace(finished, layers=result.layers)


def _save(result: Result, path: Path, args: argparse.Namespace) -> Path | None:
    """Write a picture, or else keep it where there is room; returns where it is."""
    settings = {"exposure": args.exposure, "curve": args.curve}
    try:
        result.save(path, **settings)
    except OSError as error:
        say(f"{args.parser.prog}: error: {error}")
    else:
        return path
    for folder in (Path.cwd, Path.home, gettempdir):
        with suppress(OSError, RuntimeError):  # there may be none of the three
            kept = Path(folder(), f"{path.stem}-{token_hex(4)}{path.suffix}")
            result.save(kept, **settings)
            say(f"{args.parser.prog}: the picture is kept in {kept}")
            return kept
    say(f"{args.parser.prog}: the picture is lost: nothing can be written to other folders, either")
    return None


def _print(*texts: object) -> None:
    """Print texts that nobody may be reading any more: what counts are the pictures."""
    try:
        print(*texts, sep="\n", flush=True)
    except BrokenPipeError:
        drop_stdout()


def _summary(result: Result, name: str) -> str:
    height, width, _ = result.image.shape
    bounces = f"{result.bounces} bounce{'' if result.bounces == 1 else 's'}"
    size = f"{width}x{height}"
    spp = f"{result.spp} spp{' (partial)' if result.partial else ''}"
    what = [name, size, spp, bounces, result.mode, result.sampler]
    if result.denoised:
        what.append("denoised (biased)")
    mega = 1e6 * result.seconds
    speed = (
        f"{result.seconds:.2f} s",
        f"{result.paths / mega:.1f} Mpaths/s",
        f"{result.rays / mega:.1f} Mrays/s",
        f"relMSE about {result.error:.1e}{' (uncertain)' if result.error_uncertain else ''}",
    )
    known = speed if np.isfinite(result.error) else speed[:-1]
    return "\n".join(("  ".join(what), "  ".join(known)))
