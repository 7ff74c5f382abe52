"""The elements of a Mitsuba scene, as Mitsuba's own parser reads them, and where they stand."""

from __future__ import annotations

import os
import re
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from drpt.crosscheck.xml_checks import check_dict, check_xml
from drpt.scene import SceneError, checks

if TYPE_CHECKING:
    from collections.abc import Iterator
    from os import PathLike

    from numpy.typing import NDArray

_Value = TypeVar("_Value")

THROWN_AT = re.compile(r"\[\w+\.cpp:\d+\] (?:Error while loading )?")
"""How Mitsuba's messages begin."""
PLACE = re.compile(r'^(?:dictionary node "(.*?)"|([^"]*?) \(line (\d+), col \d+\))(?=: |$)')
"""A place in a dict or in an XML file, as Mitsuba names it."""


@dataclass(frozen=True)
class Element:
    """One element with a type, such as a shape or a sensor; its references are resolved."""

    mi: Any
    state: Any
    node: Any

    @property
    def kind(self) -> str:
        """What it is: ``"shape"``, ``"bsdf"``, ``"emitter"``, ..."""
        name: str = self.node.type.name
        return name.lower()

    @property
    def type(self) -> str:
        """Which plugin: ``"sphere"``, ``"diffuse"``, ..."""
        name: str = self.node.props.plugin_name()
        return name

    @property
    def place(self) -> str:
        """Where it stands: ``scene.xml:12``, or the keys that lead to it in a dict."""
        return _plain(self.mi.parser.file_location(self.state, self.node))

    @property
    def tag(self) -> str:
        """How it begins in XML; ids that a dict gives are in `place`."""
        name = self.node.props.id()
        in_file = self.node.file_index < len(self.state.files)
        return f'<{self.kind} type="{self.type}"' + (f' id="{name}">' if name and in_file else ">")

    @property
    def name(self) -> str:
        """Its place and its tag, for people."""
        return f"{self.place}: {self.tag}"

    def get(self, name: str, default: Any) -> Any:
        """Return a property, a plain value of Mitsuba's, or `default` if it is not there."""
        return self.node.props.get(name, default)

    def number(self, name: str, default: float) -> float:
        """Return a property that is a number; raise `SceneError` if it is something else."""
        return self._typed(name, default, (int, float), "a number")

    def whole(self, name: str, default: int) -> int:
        """Return a property that is a whole number; raise `SceneError` if it is not."""
        return self._typed(name, default, (int,), "a whole number")

    def flag(self, name: str) -> bool:
        """Return a property that is true or false, which is its default; or raise `SceneError`."""
        return self._typed(name, False, (bool,), "true or false")

    def text(self, name: str, default: str) -> str:
        """Return a property that is a text; raise `SceneError` if it is something else."""
        return self._typed(name, default, (str,), "a text")

    def point(self, name: str) -> tuple[float, float, float]:
        """Return a property that is a point, 0 by default; raise `SceneError` if it is not."""
        value = self.get(name, (0, 0, 0))
        try:
            x, y, z = (float(v) for v in value)
        except (TypeError, ValueError):
            raise self.refuse(f"its {name} is {value!r}; it must be a point") from None
        return x, y, z

    def _typed(self, name: str, default: _Value, kinds: Any, words: str) -> _Value:
        value: _Value = self.get(name, default)
        if not isinstance(value, kinds) or (isinstance(value, bool) and bool not in kinds):
            raise self.refuse(f"its {name} is {value!r}; it must be {words}")
        return value

    def matrix(self) -> NDArray[np.float64]:
        """Return ``to_world`` as a matrix (4, 4)."""
        transform = self.get("to_world", None)
        return np.eye(4) if transform is None else np.array(transform.matrix, np.float64)

    @cached_property
    def children(self) -> dict[str, Any]:
        """Children by name: elements, and Mitsuba's objects where a dict has them."""
        props, types = self.node.props, self.mi.Properties.Type
        nodes = self.state.nodes
        return {
            name: Element(self.mi, self.state, nodes[props[name].index()])
            if props.type(name) == types.ResolvedReference
            else props[name]
            for name in props.keys()  # noqa: SIM118, it is no dict
            if props.type(name) in (types.ResolvedReference, types.Object)
        }

    def elements(self) -> list[Element]:
        """Return the elements that it holds; raise `SceneError` if it holds an object."""
        children = self.children
        for name, child in children.items():
            if not isinstance(child, Element):
                raise self.refuse(f"{name!r} is an object of Mitsuba's; it must be a dict")
        return list(children.values())

    def first(self, kind: str) -> Element | None:
        """Return its first element of a kind."""
        return next(iter(self._of(kind)), None)

    def only(self, kind: str) -> Element | None:
        """Return its element of a kind; raise `SceneError` if there are several."""
        found = self._of(kind)
        if len(found) > 1:
            raise self.refuse(f"it has {len(found)} elements <{kind}>; it must have one")
        return next(iter(found), None)

    def _of(self, kind: str) -> list[Element]:
        children = self.children.values()
        return [child for child in children if isinstance(child, Element) and child.kind == kind]

    def allow(self, *names: str) -> None:
        """Raise `SceneError` if it has a plain property that is not one of `names`."""
        taken = {*names, *self.children}
        unknown = [name for name in self.node.props.keys() if name not in taken]  # noqa: SIM118
        if unknown:
            known = f"; it may have {', '.join(names)}" if names else ""
            raise self.refuse(f"drpt has nothing for its property {unknown[0]!r}{known}")

    def refuse(self, problem: str) -> SceneError:
        """Return the error that names this element."""
        return SceneError(problem, self.tag, self.place)

    @contextmanager
    def blamed(self) -> Iterator[None]:
        """Name this element in the errors of drpt's model and of Mitsuba's plugins."""
        try:
            yield
        except SceneError as error:
            raise error if error.source else error.within(self.tag).in_file(self.place) from None
        except (RuntimeError, UnicodeDecodeError) as error:
            raise self.refuse(_message(error)) from None


@contextmanager
def parsed(mi: Any, source: str | PathLike[str] | dict[str, Any]) -> Iterator[Element]:
    """Parse an XML file or a dict; files that it names are found while the context is open.

    Raises `SceneError` if Mitsuba cannot parse it.
    """
    if not isinstance(source, str | os.PathLike | dict):
        raise checks.refuse("", source, "the path of an XML file or a dict")
    previous = mi.file_resolver()
    resolver = mi.FileResolver(previous)
    mi.set_file_resolver(resolver)
    try:
        if isinstance(source, dict):
            check_dict(source)
        else:
            check_xml(mi, Path(source))
            resolver.prepend(str(Path(source).parent))
        yield _root(mi, source)
    except UnicodeDecodeError as error:
        problem = f"a text in it is not UTF-8: {checks.show(error.object)}"
        raise SceneError(problem, source="" if isinstance(source, dict) else str(source)) from None
    finally:
        mi.set_file_resolver(previous)


def _root(mi: Any, source: str | PathLike[str] | dict[str, Any]) -> Element:
    config = mi.parser.ParserConfig(mi.variant())
    try:
        if isinstance(source, dict):
            state = mi.parser.parse_dict(config, source)
        else:
            state = mi.parser.parse_file(config, str(source))
        mi.parser.transform_upgrade(config, state)
        mi.parser.transform_resolve(config, state)
    except (RuntimeError, UnicodeDecodeError) as error:
        message = _message(error)
        source = "" if isinstance(source, dict) or str(source) in message else str(source)
        raise SceneError(message, source=source) from None
    return Element(mi, state, state.root)


def _message(error: RuntimeError | UnicodeDecodeError) -> str:
    """Return one of Mitsuba's messages, which may quote text that is not UTF-8."""
    if isinstance(error, UnicodeDecodeError):
        return _plain(bytes(error.object).decode(errors="replace"))
    return _plain(str(error))


def _plain(message: str) -> str:
    """Return a message of Mitsuba's with its place as drpt names it."""

    def name(place: re.Match[str]) -> str:
        keys, file, line = place.groups()
        return f"{file}:{line}" if keys is None else keys

    return PLACE.sub(name, THROWN_AT.sub("", message))
