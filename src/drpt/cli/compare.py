"""`drpt compare`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from drpt.cli.status import bad_input
from drpt.comparison import compare, differing_settings
from drpt.output import READABLE, SUFFIXES, check_target, read

if TYPE_CHECKING:
    import argparse

    from drpt.cli.parser import Commands
    from drpt.comparison import Comparison


def add(commands: Commands) -> None:
    """Declare the flags."""
    parser = commands.add_parser(
        "compare",
        help="say how much two pictures differ",
        description="""Say how much picture A differs from reference B, both of the same size:
  settings  in which of them the pictures differ, by their metadata
  relMSE    mean of (A - B)^2 / (B^2 + 0.01)
  RMSE      root of the mean of (A - B)^2
  FLIP      how different they look as PNG, from 0 to 1
  means     (mean of A - mean of B) / mean of B, for each channel""",
        epilog="""examples:
  drpt compare preview.exr reference.exr
  drpt compare mine.npy reference.exr -o error.png
  drpt compare mine.exr reference.exr -o errors         (error.exr and error.png there)

exit status: 0, however much they differ; 1 if the run failed; 2 for bad input;
130 after Ctrl-C""",
    )
    kinds = " or ".join(READABLE)
    parser.add_argument("image", metavar="A", type=Path, help=f"a picture, {kinds}")
    parser.add_argument("reference", metavar="B", type=Path, help=f"what it should be, {kinds}")
    parser.add_argument(
        "-o",
        "--output",
        metavar="OUT",
        type=Path,
        help="write the error (A - B) / sqrt(B^2 + 0.01): its colours as .png, itself as .exr or "
        ".npy, or a .png and an .exr into a folder",
    )
    parser.set_defaults(parser=parser, run=run)


def run(args: argparse.Namespace) -> int:
    """Print the differences, and write the error."""
    with bad_input(args.parser):
        image, settings = read(args.image)
        reference, other_settings = read(args.reference)
        targets = _targets(args.output)
        comparison = compare(image["RGB"], reference["RGB"])
    height, width, _ = comparison.error.shape
    print(f"{args.image} against {args.reference}, {width}x{height}")
    print(f"  settings    {differing_settings(settings, other_settings)}", comparison, sep="\n")
    for path in targets:
        path.parent.mkdir(parents=True, exist_ok=True)
        comparison.save_error(path)
        print(f"{path}: {_legend(path, comparison)}")
    return 0


def _legend(path: Path, comparison: Comparison) -> str:
    """Say what a picture of the error shows."""
    error = "(A - B) / sqrt(B^2 + 0.01)"
    if path.suffix.lower() != ".png":
        return error
    end = f"{100 * comparison.error_end:.3g} %"
    return f"mean over RGB of {error}, from -{end} (blue) over 0 (white) to +{end} (red)"


def _targets(output: Path | None) -> list[Path]:
    if output is None:
        return []
    if output.suffix and not output.is_dir():
        check_target(output)
        return [output]
    if output.exists() and not output.is_dir():
        kinds = ", ".join(SUFFIXES)
        raise NotADirectoryError(f"{output}: this is a file, and neither a folder nor {kinds}")
    return [output / "error.exr", output / "error.png"]
