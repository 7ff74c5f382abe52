"""Files: read only if they are regular and not too large, written whole or not at all."""

from drpt.files.reading import check_regular, open_regular, read_bytes
from drpt.files.writing import check_file, replacing

__all__ = [
    "check_file",
    "check_regular",
    "open_regular",
    "read_bytes",
    "replacing",
]
