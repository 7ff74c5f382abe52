from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import pytest

from drpt import SceneError
from drpt.crosscheck.parse import from_mitsuba
from drpt.crosscheck.xml_checks import MAX_DEPTH, MAX_INCLUDES, MAX_PARAMETERS

if TYPE_CHECKING:
    from pathlib import Path

    from drpt import Scene

SENSOR = '<sensor type="perspective"/>'
BALL = '<shape type="sphere"><bsdf type="twosided"><bsdf type="diffuse"/></bsdf></shape>'


def scene(*parts: str, root: str = "scene") -> str:
    return f'<{root} version="3.0.0">' + "\n".join(parts) + f"</{root}>"


def load(tmp_path: Path, *parts: str, **files: str) -> Scene:
    for name, content in files.items():
        (tmp_path / f"{name}.xml").write_text(content)
    (tmp_path / "scene.xml").write_text(scene(SENSOR, *parts))
    return from_mitsuba(tmp_path / "scene.xml")


def nested(depth: int, name: str = "bsdf") -> str:
    return f'<{name} type="twosided">' * depth + f"</{name}>" * depth


@pytest.mark.parametrize(
    "text",
    [
        nested(100_000),
        nested(MAX_DEPTH),
        nested(100_000, "foo"),
        "<bsdf>" * 100_000,
        "<!-- x -- > -->" + nested(100_000),
        "<![CDATA[ <a> ]]>" + nested(100_000),
        '<string name="a" value="<!--"/>' + nested(100_000),
        "<bsdf type='>' a='/'>" * 1000,
        '<bsdf type="/>">' * 1000,
    ],
)
def test_deep_files_are_refused(mi: Any, tmp_path: Path, text: str) -> None:
    with pytest.raises(SceneError) as caught:
        load(tmp_path, text)
    assert str(caught.value).startswith(f"{tmp_path / 'scene.xml'}:2: <")
    assert str(caught.value).endswith(f">: elements stand in elements, more than {MAX_DEPTH} deep")


@pytest.mark.parametrize(
    "text",
    [
        "<!-- a -- b <c> -->",
        f"<!-- {nested(1000)} -->",
        "<?xml-like <a> ?>",
        '<default name="a" value="&lt;a&gt; > \' "/>' * 3,
        "\n".join(f'<default name="a{i}" value="/"/>' for i in range(MAX_PARAMETERS)),
    ],
)
def test_what_mitsuba_takes_is_let_through(mi: Any, tmp_path: Path, text: str) -> None:
    assert len(load(tmp_path, text, BALL).shapes) == 1


@pytest.mark.parametrize("quantity", [1, 4])
def test_comments_and_strings_that_do_not_end_take_no_time(tmp_path: Path, quantity: int) -> None:
    for text in ("<!--", '<a b="', "<?", "<![CDATA[", "<a ", "</", "<", "a='"):
        with pytest.raises(SceneError, match=r"scene\.xml"):
            load(tmp_path, text * 10_000 * quantity)


def test_files_that_include_themselves_are_refused(mi: Any, tmp_path: Path) -> None:
    include = '<include filename="{}.xml"/>'
    with pytest.raises(SceneError, match=r"scene\.xml:2: <include>: .*scene\.xml includes itself"):
        load(tmp_path, include.format("scene"))
    with pytest.raises(SceneError, match=r"b\.xml:1: <include>: .*a\.xml includes itself"):
        load(
            tmp_path,
            include.format("a"),
            a=scene(include.format("b")),
            b=scene(include.format("a")),
        )


def test_files_that_are_included_too_often_are_refused(mi: Any, tmp_path: Path) -> None:
    ten = {f"f{i}": scene(*[f'<include filename="f{i + 1}.xml"/>'] * 10) for i in range(8)}
    with pytest.raises(SceneError, match=rf"more than {MAX_INCLUDES} files are included"):
        load(tmp_path, '<include filename="f0.xml"/>', **ten, f8=scene())


@pytest.mark.parametrize(
    "element", ['<include filename="{}"/>', '<spectrum name="a" filename="{}"/>']
)
def test_pipes_devices_and_folders_are_refused(mi: Any, tmp_path: Path, element: str) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    for name in ("pipe", "folder", "/dev/zero", "$kind"):
        with pytest.raises(
            SceneError, match=r"scene\.xml:3: <(include|spectrum)>: .* cannot be read"
        ):
            load(
                tmp_path,
                '<default name="kind" value="pipe"/>',
                element.format(name),
            )


def test_parameters_and_paths_lead_to_files(mi: Any, tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "a&b.xml").write_text(scene(nested(MAX_DEPTH)))
    parts = '<path value="parts"/>', '<default name="n" value="a&amp;$m"/>'
    with pytest.raises(SceneError, match=r"parts/a&b\.xml:1: .* more than"):
        load(tmp_path, '<default name="m" value="b"/>', *parts, '<include filename="$n.xml"/>')


def test_values_that_grow_are_refused(mi: Any, tmp_path: Path) -> None:
    grow = [f'<default name="x{i}" value="{f"$x{i - 1}" * 10}"/>' for i in range(1, 40)]
    with pytest.raises(SceneError, match=r"scene\.xml:6: <default>: a value would have more than"):
        load(tmp_path, '<default name="x0" value="xx"/>', *grow)
    many = [f'<default name="x{i}" value=""/>' for i in range(MAX_PARAMETERS + 1)]
    with pytest.raises(SceneError, match=f"more than {MAX_PARAMETERS} parameters"):
        load(tmp_path, *many)


def test_null_characters_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_bytes(scene(SENSOR, BALL).encode("utf-16"))
    with pytest.raises(SceneError, match=r"a\.xml: it holds a null character"):
        from_mitsuba(tmp_path / "a.xml")


@pytest.mark.parametrize("text", ['<shape type="\xff"/>', '<string name="\xff" value="1"/>'])
def test_texts_that_are_not_utf_8_are_refused(mi: Any, tmp_path: Path, text: str) -> None:
    (tmp_path / "a.xml").write_bytes(scene(SENSOR, text).encode("latin-1"))
    with pytest.raises(SceneError, match=r"a\.xml"):
        from_mitsuba(tmp_path / "a.xml")


def test_dicts_in_dicts_are_refused() -> None:
    table: dict[str, Any] = {"type": "scene"}
    table["me"] = table
    with pytest.raises(SceneError, match="there are dicts in dicts"):
        from_mitsuba(table)
    deep: dict[str, Any] = {"type": "scene"}
    for _ in range(100_000):
        deep = {"type": "twosided", "a": deep}
    with pytest.raises(SceneError, match="there are dicts in dicts"):
        from_mitsuba(deep)


def test_many_shapes_are_named_once(mi: Any, tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match=r"and 92 more shapes: it is black from behind"):
        assert len(load(tmp_path, '<shape type="sphere"/>\n' * 100).shapes) == 100
