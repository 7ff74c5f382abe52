"""The view as people use it, in a browser, against a server that renders."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from playwright.sync_api import Page, WebSocketRoute, expect

from tests.view.conftest import PATIENCE_MS, SIDE, WINDOW, Viewer, Watched

if TYPE_CHECKING:
    from collections.abc import Callable

    Open = Callable[..., Page]

pytestmark = pytest.mark.slow
expect.set_options(timeout=PATIENCE_MS)

SHOTS = Path(__file__).parents[2] / "out" / "view"
# Few samples, which are soon there: after that, the picture changes no more by itself.
FEW = "spp=16"
# Numbers on the page have three digits; a path has at most five vertices.
ROUNDED = 5 * 5e-3
LIGHT = 0
# Columns and rows where these are seen.
AT_LIGHT, AT_BACK_WALL, AT_RED_WALL = (32, 16), (45, 26), (6, 32)
SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
CONTRAST = (Path(__file__).parent / "contrast.js").read_text()


def finished(page: Page) -> str:
    """The picture when all of its samples are there."""
    expect(page.locator("[data-part=samples]").last).to_contain_text("done")
    return drawn(page)


def drawn(page: Page) -> str:
    return str(page.evaluate("document.querySelector('#canvas').toDataURL()"))


def await_other(page: Page, before: str) -> None:
    """Wait until another picture is shown."""
    page.wait_for_function(
        "before => document.querySelector('#canvas').toDataURL() !== before", arg=before
    )


def await_url(page: Page, text: str) -> None:
    page.wait_for_function("text => location.hash.slice(1).split('&').includes(text)", arg=text)


def click_at(page: Page, pixel: tuple[int, int]) -> None:
    box = page.locator("#canvas").bounding_box()
    assert box
    x, y = ((number + 0.5) / SIDE for number in pixel)
    page.mouse.click(box["x"] + x * box["width"], box["y"] + y * box["height"])


def enter(page: Page, label: str, value: object) -> None:
    field = page.get_by_role("spinbutton", name=label).locator("visible=true").first
    field.fill(str(value))
    field.press("Enter")


def number(text: str) -> float:
    digits, _, exponent = text.partition("·10")
    return float(digits) * 10.0 ** int(exponent.translate(SUPERSCRIPTS) or 0)


def test_it_refines(open_view: Open) -> None:
    page = open_view("spp=1048576")
    expect(page.locator(".connection")).to_have_text("connected")
    samples, error = (page.locator(f"[data-part={part}]") for part in ("samples", "error"))
    expect(error).to_have_text(re.compile(r"\d"))
    first_samples, first_error = samples.inner_text(), number(error.inner_text())
    page.wait_for_function(
        "first => Number.parseInt(document.querySelector('[data-part=samples]').textContent)"
        " > 8 * Number.parseInt(first)",
        arg=first_samples,
    )
    assert number(error.inner_text()) < first_error
    assert page.locator(".curve.left.error polyline").get_attribute("points")
    assert page.title() == "cornell-box · drpt view"


def test_pause_and_restart(open_view: Open) -> None:
    page = open_view("spp=1048576")
    samples = page.locator("[data-part=samples]")
    expect(samples).to_contain_text("of")
    page.get_by_role("button", name="Pause").click()
    page.wait_for_timeout(1000)
    before, picture = samples.inner_text(), drawn(page)
    page.wait_for_timeout(300)
    assert samples.inner_text() == before
    assert drawn(page) == picture
    page.get_by_role("button", name="Go on").click()
    expect(samples).not_to_have_text(before)
    page.get_by_role("button", name="Restart").click()
    page.wait_for_function(
        "before => Number.parseInt(document.querySelector('[data-part=samples]').textContent)"
        " < Number.parseInt(before)",
        arg=before,
    )
    expect(page.get_by_role("alert")).to_be_hidden()


@pytest.mark.parametrize(
    "changes",
    [
        [
            ("Bounces", 1, "left=mis,sobol,1"),
            ("Seed", 7, "seed=7"),
            ("spp", 8, "spp=8"),
            ("Exposure", -1.5, "exposure=-1.5"),
        ],
        [
            ("Azimuth", 20, "azimuth=20"),
            ("Elevation", 10, "elevation=10"),
            ("Zoom", 0.5, "zoom=0.5"),
        ],
        [
            ("Radius", 30, "shape0.radius=30"),
            ("x", 200, "shape0.center=200,450,179.5"),
            ("y", 400, "shape0.center=200,400,179.5"),
            ("z", 250, "shape0.center=200,400,250"),
            ("Red", 0.125, "shape1.albedo=0.125,"),
        ],
    ],
    ids=["picture", "camera", "shapes"],
)
def test_numbers(open_view: Open, changes: list[tuple[str, float, str]]) -> None:
    page = open_view(FEW)
    for label, value, hash_ in changes:
        before = finished(page)
        enter(page, label, value)
        await_other(page, before)
        page.wait_for_function("text => location.hash.includes(text)", arg=hash_)


def test_choices(open_view: Open) -> None:
    page = open_view(FEW)
    before = finished(page)
    for label, value, hash_ in [
        ("Mode", "implicit", "left=implicit,sobol,3"),
        ("Sampler", "independent", "left=implicit,independent,3"),
        ("Scene", "cornell-box-glossy", "scene=cornell-box-glossy"),
    ]:
        combobox = page.get_by_role("combobox", name=label, exact=True)
        combobox.locator("visible=true").select_option(value)
        await_other(page, before)
        await_url(page, hash_)
        before = finished(page)
    page.locator("#surface-choice").select_option(label="shapes[2] · 2 faces")
    page.get_by_label("Phong").locator("visible=true").check()
    await_url(page, "shape2.exponent=50")
    await_other(page, before)
    enter(page, "Exponent", 500)
    await_url(page, "shape2.exponent=500")
    page.get_by_role("button", name="Reset surface").click()
    page.wait_for_function("() => !location.hash.includes('shape2')")
    page.get_by_role("button", name="Reset all").click()
    page.wait_for_function("() => location.hash === '#scene=cornell-box'")


def test_numbers_keep_within_what_they_mean(open_view: Open) -> None:
    page = open_view("exposure=1000&divider=5&scale=-1&path=-3&toString=1")
    expect(page.get_by_role("alert")).to_contain_text("toString=1")
    page.get_by_role("button", name="Dismiss").click()
    await_url(page, "exposure=100")
    enter(page, "Seed", 1234567)
    await_url(page, "seed=1234567")
    expect(page.get_by_role("spinbutton", name="Seed")).to_have_value("1234567")
    slider = page.get_by_role("slider", name="spp, slider")
    for key, spp in [("Home", 1), ("ArrowRight", 2), ("End", 2**20), ("ArrowLeft", 1010000)]:
        slider.press(key)
        await_url(page, f"spp={spp}")
    expect(page.get_by_role("alert")).to_be_hidden()


def test_a_refusal_is_seen_wherever_one_is(open_view: Open) -> None:
    for window in (WINDOW, {"width": 390, "height": 844}):
        page = open_view(FEW, viewport=window)
        finished(page)
        enter(page, "Elevation", 999)
        expect(page.get_by_role("alert")).to_be_in_viewport()
        expect(page.get_by_role("alert")).to_contain_text("camera.elevation: 999 is not allowed")


def test_a_surface_that_is_phong_again_is_as_glossy_as_before(open_view: Open) -> None:
    page = open_view(f"{FEW}&shape1.exponent=777&surface=1")
    finished(page)
    page.get_by_label("diffuse").locator("visible=true").check()
    await_url(page, "shape1.exponent=null")
    page.get_by_label("Phong").locator("visible=true").check()
    await_url(page, "shape1.exponent=777")


def test_a_slider_that_is_dragged_shows_pictures_on_its_way(open_view: Open) -> None:
    page = open_view(FEW)
    finished(page)
    slider = page.get_by_role("slider", name="Radius, slider")
    box = slider.bounding_box()
    assert box
    middle = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + box["width"] / 2, middle)
    page.mouse.down()
    pictures = {drawn(page)}
    for step in range(200):
        page.mouse.move(box["x"] + box["width"] * (0.4 - step % 10 / 50), middle)
        page.wait_for_timeout(25)
        pictures.add(drawn(page))
        if len(pictures) > 4:
            break
    else:
        pytest.fail(f"{len(pictures)} pictures")
    page.mouse.up()
    page.wait_for_function("() => location.hash.includes('shape0.radius')")


def test_what_is_refused_goes_back(open_view: Open) -> None:
    page = open_view(FEW)
    before = finished(page)
    bounces = page.get_by_role("spinbutton", name="Bounces").first
    enter(page, "Bounces", 999)
    expect(page.get_by_role("alert")).to_contain_text("bounces: 999 is not allowed")
    expect(bounces).to_have_value("3")
    bounces.fill("")
    bounces.press("Enter")
    expect(bounces).to_have_value("3")
    assert drawn(page) == before
    enter(page, "Bounces", 2)
    expect(page.get_by_role("alert")).to_be_hidden()


def test_a_link_that_is_refused_shows_the_default(open_view: Open) -> None:
    page = open_view("scene=nowhere&bounces=3&spp=many")
    expect(page.get_by_role("alert")).to_contain_text("nowhere")
    expect(page.locator("#scene")).to_have_value("cornell-box")
    expect(page.locator("[data-part=samples]")).to_contain_text("of 4096")


def test_halves(open_view: Open) -> None:
    page = open_view(FEW)
    before = finished(page)
    page.get_by_role("switch", name="Compare").check()
    page.locator("#mode-1").select_option("implicit-uniform")
    await_url(page, "right=implicit-uniform,sobol,3")
    expect(page.locator(".readout")).to_have_count(2)
    await_other(page, before)
    both = finished(page)
    divider = page.get_by_role("separator")
    divider.focus()
    page.keyboard.press("End")
    expect(divider).to_have_attribute("aria-valuenow", "100")
    page.wait_for_function("p => document.querySelector('#canvas').toDataURL() === p", arg=before)
    page.keyboard.press("Home")
    await_url(page, "divider=0")
    box, canvas = divider.bounding_box(), page.locator("#canvas").bounding_box()
    assert box
    assert canvas
    page.mouse.move(box["x"] + box["width"] / 2, canvas["y"] + canvas["height"] / 2)
    page.mouse.down()
    page.mouse.move(canvas["x"] + canvas["width"] / 2, canvas["y"] + 10)
    page.mouse.up()
    page.wait_for_function("p => document.querySelector('#canvas').toDataURL() === p", arg=both)


def test_difference(open_view: Open) -> None:
    page = open_view(f"{FEW}&right=explicit,independent,3")
    before = finished(page)
    page.get_by_role("radio", name="reference").check()
    await_other(page, before)
    legend = page.locator("#legend")
    expect(legend).to_contain_text(re.compile(r" k spp; relMSE left \S+, right \S+"))
    left, right = (
        number(text) for text in re.findall(r"(?:left|right) ([^\s,]+)", legend.inner_text())
    )
    assert 0 < left < right  # independent samples need more for the same error
    reference = drawn(page)
    enter(page, "Scale", 2)
    await_other(page, reference)
    page.screenshot(path=SHOTS / "difference.png")
    page.get_by_role("radio", name="other half").check()
    await_other(page, reference)
    expect(legend).to_contain_text("the other half")
    page.get_by_role("switch", name="Compare").uncheck()
    expect(legend).to_be_hidden()


def test_picking(open_view: Open) -> None:
    page = open_view(FEW)
    finished(page)
    click_at(page, AT_RED_WALL)
    column, row = AT_RED_WALL
    await_url(page, f"pixel={column},{row}")
    place = page.locator("#pixel-place")
    expect(place).to_have_text(re.compile(rf"column {column}, row {row}: shapes\[\d\]"))
    shape = int(place.inner_text()[-2])
    expect(page.locator("#surface-choice")).to_have_value(str(shape))
    expect(page.locator("#pixel-values td").nth(1)).to_contain_text("±")
    click_at(page, AT_LIGHT)
    expect(place).to_contain_text(f"shapes[{LIGHT}]")
    page.locator("#picture").focus()
    page.keyboard.press("Shift+ArrowDown")
    await_url(page, f"pixel={AT_LIGHT[0]},{AT_LIGHT[1] + 10}")
    page.keyboard.press("Escape")
    expect(place).to_be_hidden()


def test_paths(open_view: Open) -> None:
    page = open_view(f"{FEW}&pixel={AT_BACK_WALL[0]},{AT_BACK_WALL[1]}")
    finished(page)
    choices = page.locator("#path-list input")
    expect(choices).to_have_count(16)
    expect(page.locator(".ray")).to_have_count(16)
    for _ in range(3):
        page.locator("#path-list input:checked").focus()
        page.keyboard.press("ArrowRight")
        assert_contributions_add_up(page)
    page.locator(".ray:not(.chosen) .target").first.dispatch_event("click")
    await_url(page, f"path={page.locator('.ray.chosen').get_attribute('data-path')}")
    page.screenshot(path=SHOTS / "paths.png")
    page.get_by_label("Draw them").uncheck()
    expect(page.locator(".ray")).to_have_count(0)
    enter(page, "How many", 5)
    expect(choices).to_have_count(5)


def assert_contributions_add_up(page: Page) -> None:
    rows = [
        [
            number(text)
            for text in row.locator("td:last-child .triple span").all_inner_texts()
            if text
        ]
        for row in page.locator("#path-table tbody tr").all()
    ]
    *vertices, radiance = rows
    for channel in range(3):
        added = sum(vertex[channel] for vertex in vertices)
        assert added == pytest.approx(radiance[channel], rel=ROUNDED)


def test_orbit_and_zoom_by_mouse(open_view: Open) -> None:
    page = open_view(FEW)
    before = finished(page)
    box = page.locator("#canvas").bounding_box()
    assert box
    page.mouse.move(box["x"] + 100, box["y"] + 100)
    page.mouse.down(button="right")
    page.mouse.move(box["x"] + 150, box["y"] + 125)
    page.mouse.up(button="right")
    await_url(page, "azimuth=-20")
    await_url(page, "elevation=10")
    page.mouse.wheel(0, -200)
    await_url(page, "zoom=0.5")
    await_other(page, before)
    expect(page.locator("#pixel")).to_be_hidden()


def test_saving(open_view: Open) -> None:
    page = open_view(f"{FEW}&shape0.radius=30")
    finished(page)

    def saved(button: str, suffix: str) -> bytes:
        with page.expect_download() as download:
            page.get_by_role("button", name=button).click()
        assert download.value.suggested_filename == f"cornell-box.{suffix}"
        return download.value.path().read_bytes()

    assert saved("Save EXR", "exr").startswith(b"\x76\x2f\x31\x01")
    assert saved("Save PNG", "png").startswith(b"\x89PNG")
    scene = tomllib.loads(saved("Save the scene", "toml").decode())
    assert scene["shapes"][LIGHT]["radius"] == 30


def test_a_link_reproduces_the_view(open_view: Open) -> None:
    page = open_view(FEW)
    finished(page)
    page.get_by_role("switch", name="Compare").check()
    page.locator("#sampler-1").select_option("independent")
    for label, value in {"Radius": 30, "Exposure": 1, "Azimuth": 30, "Red": 0.5}.items():
        enter(page, label, value)
    click_at(page, AT_BACK_WALL)
    expect(page.locator("#path-list input")).to_have_count(16)
    finished(page)
    await_url(page, f"pixel={AT_BACK_WALL[0]},{AT_BACK_WALL[1]}")
    other = open_view(page.url.partition("#")[2])
    finished(other)
    other.wait_for_function(
        "p => document.querySelector('#canvas').toDataURL() === p", arg=drawn(page)
    )
    expect(other.locator("#path-table")).to_have_text(
        page.locator("#path-table").inner_text(), use_inner_text=True
    )


def test_an_edited_url_and_the_way_back(open_view: Open) -> None:
    page = open_view(FEW)
    before = finished(page)
    page.evaluate("location.hash = 'scene=cornell-box&spp=16&left=mis,sobol,0'")
    await_other(page, before)
    expect(page.get_by_role("spinbutton", name="Bounces").first).to_have_value("0")
    page.go_back()
    page.wait_for_function("p => document.querySelector('#canvas').toDataURL() === p", arg=before)


def test_it_connects_again(open_view: Open, viewer: Viewer, watched: Watched) -> None:
    page = open_view(f"{FEW}&shape0.radius=30")
    before = finished(page)
    viewer.close()
    expect(page.locator(".connection")).to_have_text("server gone, trying again")
    viewer.start_again()
    expect(page.locator(".connection")).to_have_text("connected")
    enter(page, "Exposure", 1)
    await_other(page, before)
    enter(page, "Exposure", 0)
    finished(page)
    page.wait_for_function("p => document.querySelector('#canvas').toDataURL() === p", arg=before)
    watched.complaints = [text for text in watched.complaints if "ERR_CONNECTION" not in text]


@pytest.mark.parametrize(
    ("code", "reason", "text"),
    [
        (1008, "type: 'bad'", "refused: type: 'bad'; reload the page to try again"),
        (1013, "32 viewers at most", "32 viewers at most; trying again"),
    ],
)
def test_why_the_server_hangs_up(
    browser_page: Page, viewer: Viewer, code: int, reason: str, text: str
) -> None:
    browser_page.route_web_socket("**/ws", lambda ws: ws.close(code=code, reason=reason))
    browser_page.goto(viewer.url)
    expect(browser_page.locator(".connection")).to_have_text(text)


def test_it_says_when_the_first_frame_takes_long(browser_page: Page, viewer: Viewer) -> None:
    held: list[bytes] = []
    routes: list[WebSocketRoute] = []

    def hold(route: WebSocketRoute) -> None:
        routes.append(route)
        server = route.connect_to_server()
        server.on_message(
            lambda message: (
                held.append(message) if isinstance(message, bytes) else route.send(message)
            )
        )

    browser_page.route_web_socket("**/ws", hold)
    browser_page.goto(viewer.url)
    busy = browser_page.locator("#busy")
    expect(busy).to_have_text("compiling…")
    while not held:
        browser_page.wait_for_timeout(50)
    routes[0].send(held[0])
    expect(busy).to_have_text("")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_stands_out(open_view: Open, scheme: str) -> None:
    """WCAG 2.2, 1.4.3: by 4.5 to 1 at least, in either theme."""
    page = open_view(f"{FEW}&right=explicit,sobol,2&pixel=20,40", color_scheme=scheme)
    finished(page)
    expect(page.locator("#path-table")).to_be_visible()
    page.screenshot(path=SHOTS / f"{scheme}.png")
    assert page.evaluate(CONTRAST, 4.5) == []


@pytest.mark.parametrize(("width", "height"), [(720, 450), (360, 740)], ids=["200 %", "narrow"])
def test_small_windows_scroll_one_way(open_view: Open, width: int, height: int) -> None:
    size = {"width": width, "height": height}
    page = open_view(f"{FEW}&right=explicit,sobol,2&pixel=20,40", viewport=size)
    finished(page)
    expect(page.locator("#path-table")).to_be_visible()
    page.screenshot(path=SHOTS / f"{width}.png", full_page=True)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.evaluate("document.querySelector('#picture').clientWidth") > width / 3


def test_keys_alone(open_view: Open) -> None:
    page = open_view(FEW)
    finished(page)
    reached = tabbed(page)
    focusable = page.evaluate(
        "[...document.querySelectorAll('button, select, input, [tabindex]')].filter("
        "e => e.checkVisibility() && !e.disabled && (e.type !== 'radio' || e.checked)).length"
    )
    assert len(reached) == focusable
    assert all(outline != "none" for _, outline in reached)
    page.evaluate("document.activeElement.blur()")
    for key, locator in [("?", "dialog[open]"), ("c", "#divider"), ("d", "#legend")]:
        page.keyboard.press(key)
        expect(page.locator(locator)).to_be_visible()
        page.keyboard.press("Escape")
    page.keyboard.press("p")
    expect(page.get_by_role("button", name="Go on")).to_be_visible()
    page.keyboard.press("Shift+E")
    await_url(page, "exposure=-0.5")
    page.locator("#picture").focus()
    page.keyboard.press("+")
    await_url(page, "zoom=0.25")
    page.keyboard.press("ArrowRight")
    expect(page.locator("#pixel-place")).to_be_visible()


def tabbed(page: Page) -> list[tuple[str, str]]:
    """What the tabulator reaches in turn, and the style of its outline."""
    reached: list[tuple[str, str]] = []
    while True:
        page.keyboard.press("Tab")
        element = page.evaluate(
            "[document.activeElement.outerHTML.slice(0, 80),"
            " getComputedStyle(document.activeElement).outlineStyle]"
        )
        if element[0].startswith("<body") or (reached and element[0] == reached[0][0]):
            return reached
        reached.append((element[0], element[1]))


@pytest.fixture
def browser_page(watched: Watched) -> Page:
    """An empty page."""
    return watched.open("about:blank", viewport=WINDOW)
