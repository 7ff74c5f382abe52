"""Pictures on disk: EXR, PNG and NPY, each written whole or not at all."""

from drpt.files import check_file, replacing
from drpt.output.display import CURVES, to_display
from drpt.output.exr import read_exr, read_exr_layers
from drpt.output.pictures import READABLE, SUFFIXES, check_target, read, write, write_png

__all__ = [
    "CURVES",
    "READABLE",
    "SUFFIXES",
    "check_file",
    "check_target",
    "read",
    "read_exr",
    "read_exr_layers",
    "replacing",
    "to_display",
    "write",
    "write_png",
]
