"""Files: read only if they are regular and not too large, written whole or not at all."""

from drpt.files.reading import check_regular, open_regular, read_bytes
from drpt.files.sizes import in_words
from drpt.files.writing import check_file, replacing

__all__ = [
    "check_file",
    "check_regular",
    "in_words",
    "open_regular",
    "read_bytes",
    "replacing",
]
