"""Files: only regular ones of limited size are read, and each is written whole or not at all."""

from drpt.files.archives import read_npy, read_npz
from drpt.files.locking import PathLock
from drpt.files.reading import check_regular, open_regular, read_bytes
from drpt.files.writing import check_file, replacing, write_file

__all__ = [
    "PathLock",
    "check_file",
    "check_regular",
    "open_regular",
    "read_bytes",
    "read_npy",
    "read_npz",
    "replacing",
    "write_file",
]
