"""The page in a real browser: Debian's Chromium by Playwright, from the disk and without a network."""

import base64
import io
import os
import shutil
import time

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import sync_playwright

from enfilade.reports import live
from enfilade.reports.live import Live
from enfilade.reports.page import Wishes

FRAMES = 10
DESKTOP, PHONE = {"width": 1440, "height": 900}, {"width": 390, "height": 844}
PLACE = """(plot, frame) => {
    const axis = plot.querySelector(".canvas")._fullLayout.xaxis;
    return axis._offset + axis.l2p(frame);
}"""
KEYS = {"1": "result", "2": "source", "3": "visible", "4": "velocity", "5": "difference"}


@pytest.fixture(scope="module")
def browser():
    program = shutil.which("chromium") or shutil.which("chromium-browser")
    if program is None:
        pytest.fail("the tests of the page need Chromium; install it: sudo apt-get install chromium")
    sandbox = ["--no-sandbox"] if os.geteuid() == 0 else []  # which Chromium refuses to root
    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=program, args=sandbox)
        yield opened
        opened.close()


@pytest.fixture
def open_page(browser, page_file):
    """Opens the page; in the end nothing may have been asked of a network, or been complained of."""
    contexts, complaints = [], []

    def opened(viewport=DESKTOP, scheme="light"):
        context = browser.new_context(viewport=viewport, color_scheme=scheme)
        contexts.append(context)
        page = context.new_page()
        page.on("console", lambda message: complaints.append(f"{message.type}: {message.text}"))
        page.on("pageerror", lambda error: complaints.append(f"error: {error}"))
        page.on(
            "request", lambda request: complaints.append(request.url) if is_foreign(request.url) else None
        )
        page.goto(page_file.as_uri())
        page.wait_for_selector("html[data-ready=yes]")
        shown(page, 1, "result")
        return page

    def is_foreign(url):
        return not url.startswith(("data:", "blob:")) and url != page_file.as_uri()

    yield opened
    for context in contexts:
        context.close()
    assert complaints == []


def shown(page, number, layer):
    """Wait until a frame's layer is on the canvas."""
    page.wait_for_selector(f'#screen[data-shown="{number} {layer}"]')


def until(page, expression):
    """Wait for what a script says; Playwright's own way evaluates text, which the page forbids."""
    for _ in range(200):
        if page.evaluate(expression):
            return
        page.wait_for_timeout(50)
    pytest.fail(f"never became true: {expression}")


def pixels(page):
    """What the canvas shows, (H, W, 4) uint8."""
    text = page.evaluate("document.getElementById('screen').toDataURL('image/png')")
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(text.partition(",")[2]))).convert("RGBA"))


def cursors(page):
    """Frame of each chart's cursor, and how far it is from where Plotly has that frame, CSS pixels."""
    return page.evaluate(
        """() => [...document.querySelectorAll(".plot")].map((place) => {
            const axis = place.querySelector(".canvas")._fullLayout.xaxis;
            const cursor = place.querySelector(".cursor");
            const frame = Number(cursor.dataset.frame);
            return [frame, Math.abs(parseFloat(cursor.style.left) - axis._offset - axis.l2p(frame))];
        })"""
    )


def assert_in_step(page, number):
    assert page.locator("#scrubber").input_value() == str(number - 1)
    assert page.locator("#counter").text_content() == f"{number} / {FRAMES}"
    found = cursors(page)
    assert [frame for frame, _ in found] == [number] * 4
    assert max(distance for _, distance in found) < 1.0


def test_the_scrubber_moves_the_charts(open_page):
    page = open_page()
    assert_in_step(page, 1)
    assert page.locator("#fact-frame").text_content() == "1, keyframe"
    page.locator("#scrubber").fill("6")
    shown(page, 7, "result")
    assert_in_step(page, 7)
    assert page.locator("#scrubber").get_attribute("aria-valuetext").startswith("frame 7, ")


def test_the_charts_move_the_scrubber(open_page):
    page = open_page()
    for index, number in enumerate((4, 9, 2, 6)):
        plot = page.locator(".plot").nth(index)
        x = plot.evaluate(PLACE, number)
        plot.click(position={"x": x + 3.0, "y": 40.0})
        shown(page, number, "result")
        assert_in_step(page, number)


def test_dragging_over_a_chart_scrubs(open_page):
    page = open_page()
    box = page.locator(".plot").first.bounding_box()
    page.mouse.move(box["x"] + 60, box["y"] + 40)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"], box["y"] + 40, steps=5)
    shown(page, FRAMES, "result")
    page.mouse.up()
    page.mouse.move(box["x"] + 60, box["y"] + 40)
    assert_in_step(page, FRAMES)


def test_every_layer_shows(open_page):
    page = open_page()
    page.keyboard.press("ArrowRight")
    seen = {}
    for key, layer in KEYS.items():
        page.keyboard.press(key)
        shown(page, 2, layer)
        seen[layer] = pixels(page).astype(float)
        assert (seen[layer][..., 3] == 255).all(), layer
        assert seen[layer][..., :3].std() > 3.0, layer
        assert page.locator(f'[data-layer="{layer}"]').get_attribute("aria-pressed") == "true"
        assert [
            legend.get_attribute("data-legend") for legend in page.locator("[data-legend]:visible").all()
        ] == [layer]
    for one, other in zip(list(KEYS.values())[:-1], list(KEYS.values())[1:], strict=True):
        assert np.abs(seen[one] - seen[other])[..., :3].mean() > 5.0, (one, other)
    page.get_by_role("button", name="Velocity").click()
    shown(page, 2, "velocity")


def test_reused_pixels_are_grey_and_traced_ones_are_not(open_page):
    page = open_page()
    page.keyboard.press("2")
    shown(page, 1, "source")
    assert np.ptp(pixels(page)[..., :3].astype(int), axis=2).min() > 20  # a keyframe is traced whole
    page.keyboard.press("ArrowRight")
    shown(page, 2, "source")
    is_grey = np.ptp(pixels(page)[..., :3].astype(int), axis=2) <= 2
    assert 0.05 < is_grey.mean() < 0.95


def test_keys(open_page):
    page = open_page()
    for key, number in (
        ("ArrowRight", 2), ("ArrowRight", 3), ("ArrowLeft", 2), ("End", FRAMES), ("ArrowRight", FRAMES),
        ("Shift+ArrowLeft", 1), ("ArrowLeft", 1), ("Shift+ArrowRight", FRAMES), ("Home", 1),
    ):  # fmt: skip
        page.keyboard.press(key)
        shown(page, number, "result")
        assert_in_step(page, number)
    page.locator("#scrubber").focus()
    page.keyboard.press("ArrowRight")  # once, though the slider knows this key too
    assert_in_step(page, 2)
    page.keyboard.press("9")  # no such layer
    assert_in_step(page, 2)


def test_space_plays_and_stops(open_page):
    page = open_page()
    page.keyboard.press("Space")
    until(page, "Number(document.getElementById('scrubber').value) >= 3")
    assert page.locator("#play").get_attribute("aria-label") == "Pause"
    page.keyboard.press("Space")
    stopped = page.locator("#scrubber").input_value()
    time.sleep(0.3)
    assert page.locator("#scrubber").input_value() == stopped
    page.keyboard.press("End")
    page.locator("#play").click()  # from the end it begins anew
    until(page, "Number(document.getElementById('scrubber').value) < 8")


def background(page):
    return page.evaluate("getComputedStyle(document.body).backgroundColor")


def ink_of_charts(page):
    return page.evaluate("document.querySelector('.plot .canvas')._fullLayout.font.color")


def test_dark_and_light(open_page):
    light, dark = "rgb(255, 255, 255)", "rgb(19, 20, 22)"
    page = open_page(scheme="dark")
    assert background(page) == dark
    inks = [ink_of_charts(page)]
    page.locator("#theme").click()
    assert background(page) == light
    inks.append(ink_of_charts(page))
    assert inks[0] != inks[1]
    page.emulate_media(color_scheme="light")
    page.locator("#theme").click()
    assert background(page) == dark
    assert ink_of_charts(page) == inks[0]
    assert_in_step(page, 1)


def test_on_a_phone_nothing_is_wider_than_the_screen(open_page):
    page = open_page(PHONE)
    for layer in KEYS:
        page.keyboard.press(layer)
        assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
    page.evaluate("document.querySelectorAll('details').forEach((one) => { one.open = true; })")
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
    assert_in_step(page, 1)
    page.set_viewport_size({"width": 844, "height": 390})
    until(page, "document.querySelector('.plot .canvas')._fullLayout.width > 500")
    assert_in_step(page, 1)


def test_everything_has_a_name(open_page):
    page = open_page()
    nameless = page.evaluate(
        """() => [...document.querySelectorAll("button, input, canvas, [role=img]")]
            .filter((one) => !(one.getAttribute("aria-label") || one.textContent.trim()))
            .map((one) => one.outerHTML.slice(0, 80))"""
    )
    assert nameless == []
    page.keyboard.press("Tab")
    assert page.evaluate("getComputedStyle(document.activeElement).outlineStyle") == "solid"


def test_a_page_that_is_made_anew_shows_the_same(browser, copied, monkeypatch):
    monkeypatch.setattr(live, "LEAST_S", 0.0)
    monkeypatch.setattr(live, "REST", 0.0)
    context = browser.new_context(viewport=DESKTOP)
    with Live(copied, Wishes(has_metric=False)) as served:
        page = context.new_page()
        page.goto(served.address)
        first = page.wait_for_selector("iframe").content_frame()
        first.wait_for_selector("html[data-ready=yes]")
        first.locator("#scrubber").fill("6")
        first.get_by_role("button", name="Velocity").click()
        shown(first, 7, "velocity")
        first.get_by_text("All frames", exact=True).click()
        first.evaluate("scrollTo(0, 300)")
        with (copied / "ledger.jsonl").open("a") as ledger:
            ledger.write('{"unit": "frame 11", "fil')  # being written just now
        anew = page.wait_for_selector('iframe[src="page?2"]').content_frame()
        anew.wait_for_url("**/page?2")
        anew.wait_for_selector("html[data-ready=yes]")
        shown(anew, 7, "velocity")
        assert anew.evaluate("scrollY") == 300
        assert anew.evaluate("[...document.querySelectorAll('details')].map((one) => one.open)") == [
            False,
            False,
            True,
        ]
    context.close()
