"""Reads untrusted NumPy files: headers are checked before memory is allocated.

The header of a small file can claim any shape, and a few bytes of a compressed archive can unpack
to any size.
"""

from __future__ import annotations

import os
from math import prod
from typing import TYPE_CHECKING, Any
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile

import numpy as np

from drpt.machine import require_memory
from drpt.messages import one_line, shortened, size_in_words

if TYPE_CHECKING:
    from typing import BinaryIO
    from zipfile import ZipInfo

    from numpy.typing import NDArray

RATIOS = {ZIP_STORED: 1, ZIP_DEFLATED: 1032}
"""Largest ratio of the size of an array to that in the archive; DEFLATE's best is 1032."""
MAX_PROBLEM = 200
"""Characters of a library's message that an error shows; it may quote the file."""


def read_npz(stream: BinaryIO) -> dict[str, NDArray[Any]]:
    """Return the arrays of an NPZ archive; raises `ValueError` if it is none, or has pickles."""
    try:
        with ZipFile(stream) as archive:
            members = archive.infolist()
            _check_sizes(members, _size(stream))
            return {
                member.filename.removesuffix(".npy"): _read_member(archive, member)
                for member in members
            }
    except Exception as error:  # zipfile and NumPy raise many kinds
        problem = one_line(shortened(str(error), MAX_PROBLEM))
        raise ValueError(f"it is not an NPZ file of plain arrays: {problem}") from error


def read_npy(stream: BinaryIO) -> NDArray[Any]:
    """Return the array of an NPY file; raises `ValueError` if it is none, or a pickle."""
    try:
        _check_header(stream, _size(stream))
        stream.seek(0)
        return _plain(stream)
    except Exception as error:  # NumPy raises many kinds
        problem = one_line(shortened(str(error), MAX_PROBLEM))
        raise ValueError(f"this is not a readable NPY file ({problem})") from error


def _size(stream: BinaryIO) -> int:
    size = stream.seek(0, os.SEEK_END)
    stream.seek(0)
    return size


def _check_sizes(members: list[ZipInfo], archive_size: int) -> None:
    """Raise `ValueError` if members claim more bytes than the archive or the memory can hold."""
    for member in members:
        name = shortened(member.filename, MAX_PROBLEM // 4)
        ratio = RATIOS.get(member.compress_type)
        if ratio is None:
            raise ValueError(f"{name} is compressed by a method that is not read")
        if member.file_size > ratio * member.compress_size:
            sizes = size_in_words(member.file_size), size_in_words(member.compress_size)
            raise ValueError("{} is said to be {}, which {} cannot hold".format(name, *sizes))
    packed = sum(member.compress_size for member in members)
    if packed > archive_size:
        sizes = size_in_words(packed), size_in_words(archive_size)
        raise ValueError("its arrays are said to be {} of its {}".format(*sizes))
    require_memory(sum(member.file_size for member in members), "it")


def _read_member(archive: ZipFile, member: ZipInfo) -> NDArray[Any]:
    with archive.open(member) as stream:
        _check_header(stream, member.file_size)
    with archive.open(member) as stream:
        return _plain(stream)


def _check_header(stream: Any, size: int) -> None:
    """Raise `ValueError` unless as many bytes follow an array's header as its shape needs."""
    version = np.lib.format.read_magic(stream)
    headers = {
        (1, 0): np.lib.format.read_array_header_1_0,
        (2, 0): np.lib.format.read_array_header_2_0,
    }
    if version not in headers:
        raise ValueError(f"arrays of version {version} are not read")
    shape, _, dtype = headers[version](stream)
    if dtype.hasobject:
        raise ValueError("it holds objects, which are not read")
    told, left = prod(shape) * dtype.itemsize, size - stream.tell()
    if told != left:
        sizes = size_in_words(told), size_in_words(left)
        raise ValueError("its header tells of {}, and {} follow".format(*sizes))


def _plain(stream: Any) -> NDArray[Any]:
    array: NDArray[Any] = np.lib.format.read_array(stream, allow_pickle=False)
    return array
