"""Checks Mitsuba's scene files before Mitsuba's parser, which trusts them, reads them.

The parser recurses for each level of elements, reads a file as often as it is included, and
substitutes values in other values. So a small file can crash the process or use all memory.
"""

from __future__ import annotations

import html
import re
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from drpt.files import check_regular
from drpt.scene import SceneError
from drpt.scene.reading import read_file

if TYPE_CHECKING:
    from collections.abc import Iterator

MAX_BYTES = 2**30
"""Largest size of a scene file with all included files; a million shapes take about 500 MB."""
MAX_DEPTH = 100
"""Largest depth of nested elements; Mitsuba crashes from some thousand on."""
MAX_INCLUDES = 1000
"""Largest number of includes, with repetitions."""
MAX_PARAMETERS = 1000
"""Largest number of <default> elements with different names; Mitsuba searches every value for each
of them."""
MAX_VALUE = 10_000
"""Longest value, in characters, after the substitution of parameters."""

_TAG = re.compile(
    rb"<!--.*?(?:-->|\Z)|<!\[CDATA\[.*?(?:\]\]>|\Z)|<\?.*?(?:\?>|\Z)"
    rb"|<(?P<end>/?)(?P<name>[A-Za-z_:\x80-\xff][^\s/>]*+)"
    rb"(?P<rest>(?:[^>\"']++|\"[^\"]*+(?:\"|\Z)|'[^']*+(?:'|\Z))*+)(?:>|\Z)",
    re.DOTALL,
)
"""A comment, CDATA, an instruction or a tag; without its end, it extends to the end of the file."""
_ATTRIBUTE = re.compile(rb"([^\s=\"']++)\s*+=\s*+(?:\"([^\"]*+)\"|'([^']*+)')")
_FOLLOWED = (b"default", b"include", b"path", b"spectrum")
"""Elements that name files or parameters."""


def check_xml(mi: Any, path: Path) -> None:
    """Raise `SceneError`, with file and line, if a scene file is unsafe for Mitsuba's parser."""
    _Reader(mi).read(path, mi.file_resolver())


def check_dict(table: dict[str, Any]) -> None:
    """Raise `SceneError` if dicts are nested too deep, or without an end."""
    level: list[Any] = [table]
    for _ in range(MAX_DEPTH):
        inner = {id(x): x for node in level for x in node.values() if isinstance(x, dict)}
        level = [*inner.values()]
        if not level:
            return
    raise SceneError(f"there are dicts in dicts, more than {MAX_DEPTH} deep")


def check_file(resolver: Any, name: str) -> Path:
    """Return the path of a file name in a scene.

    Raises `SceneError` if the path exists and is not a regular file.
    """
    path = Path(str(resolver.resolve(name)))
    try:
        check_regular(path, path.stat())
    except FileNotFoundError:
        pass  # Mitsuba says so
    except (OSError, ValueError) as error:
        raise SceneError(f"{path} cannot be read: {getattr(error, 'strerror', error)}") from None
    return path


@dataclass
class _Reader:
    """Follows a scene file and what it includes, in the order in which Mitsuba reads them."""

    mi: Any
    parameters: dict[str, str] = field(default_factory=dict)
    includes: int = 0
    bytes_left: int = MAX_BYTES
    open_files: list[Path] = field(default_factory=list)

    def read(self, path: Path, resolver: Any) -> None:
        resolver = self.mi.FileResolver(resolver)
        resolver.prepend(str(path.parent))
        self.open_files.append(path)
        try:
            content = read_file(path, self.bytes_left)
            self.bytes_left -= len(content)
            if b"\0" in content:
                raise SceneError("it holds a null character; it must be XML in UTF-8")
            for start, name, rest in _elements(content):
                if name in _FOLLOWED or b"$" in rest:
                    with _blamed(content, start, name):
                        self._follow(name, rest, resolver)
        except SceneError as error:
            if error.source:
                raise
            line, _, tag = error.field.partition(" ")
            raise SceneError(error.problem, tag, f"{path}{line}") from None
        self.open_files.pop()

    def _follow(self, name: bytes, rest: bytes, resolver: Any) -> None:
        """Apply an element's effect on parameters, paths and files."""
        values = {key: self._value(value) for key, value in _attributes(rest)}
        file, value = values.get("filename"), values.get("value", "")
        if name == b"default" and "name" in values:
            self._set(values["name"], value)
        elif name == b"path":
            resolver.prepend(str(resolver.resolve(value)))
        elif name == b"spectrum" and file is not None:
            check_file(resolver, file)
        elif name == b"include" and file is not None:
            self._include(check_file(resolver, file), resolver)

    def _include(self, path: Path, resolver: Any) -> None:
        self.includes += 1
        if self.includes > MAX_INCLUDES:
            raise SceneError(f"more than {MAX_INCLUDES} files are included")
        if path in self.open_files:
            raise SceneError(f"{path} includes itself")
        if path.exists():
            self.read(path, resolver)

    def _set(self, name: str, value: str) -> None:
        """Set a parameter that is not set yet; the longest names come first."""
        if name in self.parameters:
            return
        if len(self.parameters) == MAX_PARAMETERS:
            raise SceneError(f"there are more than {MAX_PARAMETERS} parameters")
        names = sorted({*self.parameters, name}, key=len, reverse=True)
        self.parameters = {n: self.parameters.get(n, value) for n in names}

    def _value(self, text: str) -> str:
        """Return a value with its parameters substituted, as Mitsuba does."""
        for name, value in self.parameters.items() if "$" in text else ():
            if f"${name}" in text:
                parts = re.split(rf"(?<!\\)\${re.escape(name)}", text)
                if sum(map(len, parts)) + len(value) * (len(parts) - 1) > MAX_VALUE:
                    raise SceneError(f"a value would have more than {MAX_VALUE} characters")
                text = value.join(parts)
        return text.replace("\\$", "$")


@contextmanager
def _blamed(content: bytes, start: int, name: bytes) -> Iterator[None]:
    """Add line and tag of an element to the field of an error that does not name a file."""
    try:
        yield
    except SceneError as error:
        if error.source:
            raise
        line = content.count(b"\n", 0, start) + 1
        raise SceneError(error.problem, f":{line} <{name.decode(errors='replace')}>") from None


def _elements(content: bytes) -> Iterator[tuple[int, bytes, bytes]]:
    """Yield the start of each element, its name, and the rest of its tag."""
    depth = 0
    for tag in _TAG.finditer(content):
        if tag["name"] is None:
            continue
        if tag["end"]:
            depth -= 1
            continue
        if depth >= MAX_DEPTH:
            with _blamed(content, tag.start(), tag["name"]):
                raise SceneError(f"elements stand in elements, more than {MAX_DEPTH} deep")
        depth += not tag["rest"].endswith(b"/")
        yield tag.start(), tag["name"], tag["rest"]


def _attributes(rest: bytes) -> Iterator[tuple[str, str]]:
    for name, double, single in _ATTRIBUTE.findall(rest):
        yield (
            name.decode(errors="replace"),
            html.unescape((double or single).decode(errors="replace")),
        )
