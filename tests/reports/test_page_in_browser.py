"""The page in a real browser: Debian's Chromium by Playwright, from the disk and without a network."""

import io
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

FRAMES = 10
DESKTOP, PHONE = {"width": 1440, "height": 900}, {"width": 390, "height": 844}
LAYERS = ("result", "provenance", "visible", "velocity", "difference")


def shown(page, number, layer):
    """Wait until a layer of a frame is on the screen."""
    page.wait_for_selector(f'#screen[data-shown="{number} {layer}"]')


def tick_x(plot, number):
    """Where the axis of a chart has a frame, from the left edge of the chart."""
    tick = plot.locator("text", has_text=str(number)).first.bounding_box()
    return tick["x"] + tick["width"] / 2 - plot.bounding_box()["x"]


def assert_in_step(page, number, axis_number=None):
    """All parts of the page show a frame; the cursors are where the axes have it, if they label it."""
    assert page.locator("#scrubber").input_value() == str(number - 1)
    assert page.locator("#counter").text_content() == f"{number} / {FRAMES}"
    cursors = page.locator(".cursor")
    assert cursors.count() == 4
    assert {cursors.nth(i).get_attribute("data-frame") for i in range(4)} == {str(number)}
    if axis_number is not None:
        for plot in page.locator(".plot").all():
            x = plot.locator(".cursor").bounding_box()["x"] - plot.bounding_box()["x"]
            assert x == pytest.approx(tick_x(plot, axis_number), abs=2.0)


def test_the_scrubber_moves_cursors_and_values(open_page):
    page = open_page()
    shown(page, 1, "result")
    assert_in_step(page, 1)
    page.locator("#scrubber").fill("7")
    shown(page, 8, "result")
    assert_in_step(page, 8, axis_number=8)
    assert page.locator("#scrubber").get_attribute("aria-valuetext") == "frame 8"
    velocity = page.locator("figure").first.locator(".keyed b")
    assert velocity.all_text_contents() == ["34.37", ""]
    page.keyboard.press("End")
    assert velocity.all_text_contents() == ["42.97", "42.97"]
    assert page.locator("#screen").get_attribute("aria-label") == f"Frame {FRAMES}, keyframe: Result"


def test_charts_move_the_scrubber(open_page):
    page = open_page()
    first = page.locator(".plot").first
    for index, number in enumerate((4, 8, 2, 6)):
        page.locator(".plot").nth(index).click(position={"x": tick_x(first, number) + 3.0, "y": 40.0})
        shown(page, number, "result")
        assert_in_step(page, number, axis_number=number)
    box = first.bounding_box()
    page.mouse.move(box["x"] + 60, box["y"] + 40)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] + 200, box["y"] + 400, steps=5)
    shown(page, FRAMES, "result")
    page.mouse.up()
    page.mouse.move(box["x"] + 60, box["y"] + 40)
    assert_in_step(page, FRAMES)


def test_every_layer_shows(open_page):
    page = open_page()
    page.keyboard.press("ArrowRight")
    seen = []
    for key, layer in enumerate(LAYERS, 1):
        page.keyboard.press(str(key))
        shown(page, 2, layer)
        seen.append(
            np.asarray(Image.open(io.BytesIO(page.locator("#screen").screenshot())).convert("RGB"), int)
        )
        assert page.locator(f'[data-layer="{layer}"]').get_attribute("aria-pressed") == "true"
        legends = page.locator("[data-legend]:visible")
        assert [of.get_attribute("data-legend") for of in legends.all()] == [layer]
    for one, other in pairwise(seen):
        assert np.abs(one - other).mean() > 5.0
    is_grey = np.ptp(seen[1], axis=2) <= 3  # reused pixels
    assert 0.4 < is_grey.mean() < 0.8
    page.get_by_role("button", name="Velocity").click()
    shown(page, 2, "velocity")


def test_keys(open_page):
    page = open_page()
    for key, number in (
        ("ArrowRight", 2), ("ArrowRight", 3), ("ArrowLeft", 2), ("End", FRAMES), ("ArrowRight", FRAMES),
        ("Shift+ArrowLeft", 1), ("ArrowLeft", 1), ("Shift+ArrowRight", FRAMES), ("Home", 1), ("9", 1),
    ):  # fmt: skip
        page.keyboard.press(key)
        shown(page, number, "result")
        assert_in_step(page, number)
    page.locator("#scrubber").focus()
    page.keyboard.press("ArrowRight")  # once, though the slider has this key too
    assert_in_step(page, 2)


def test_space_plays_and_stops(open_page):
    page = open_page()
    page.keyboard.press("Space")
    page.wait_for_selector('#screen[data-shown="4 result"]')
    assert page.locator("#play").get_attribute("aria-label") == "Pause"
    page.keyboard.press("Space")
    stopped = page.locator("#scrubber").input_value()
    page.wait_for_timeout(300)
    assert page.locator("#scrubber").input_value() == stopped
    page.keyboard.press("End")
    page.locator("#play").click()  # from the end it begins anew
    page.wait_for_selector('#screen[data-shown="1 result"]')


def test_dark_and_light(open_page):
    inks = []
    for scheme, paper in (("light", "rgb(255, 255, 255)"), ("dark", "rgb(19, 20, 22)")):
        page = open_page(color_scheme=scheme)
        assert page.evaluate("getComputedStyle(document.body).backgroundColor") == paper
        inks.append(page.evaluate("getComputedStyle(document.querySelector('.plot text')).fill"))
    assert inks[0] != inks[1]


@pytest.mark.parametrize("size", [PHONE, {"width": 844, "height": 390}, DESKTOP], ids=str)
def test_nothing_is_wider_than_the_screen(open_page, size):
    page = open_page(viewport=size)
    for key in range(1, len(LAYERS) + 1):
        page.keyboard.press(str(key))
        assert page.evaluate("document.documentElement.scrollWidth") <= size["width"]
    page.evaluate("document.querySelectorAll('details').forEach((one) => { one.open = true; })")
    assert page.evaluate("document.documentElement.scrollWidth") <= size["width"]
    page.keyboard.press("ArrowRight")
    assert_in_step(page, 2, axis_number=2)
    box = page.locator(".plot text").first.bounding_box()
    assert box["height"] > 9.0  # legible


def test_everything_has_a_name(open_page):
    page = open_page()
    nameless = page.evaluate(
        """() => [...document.querySelectorAll("button, input, [role=img]")]
            .filter((one) => !(one.getAttribute("aria-label") || one.textContent.trim()))
            .map((one) => one.outerHTML.slice(0, 80))"""
    )
    assert nameless == []
    page.keyboard.press("Tab")
    assert page.evaluate("getComputedStyle(document.activeElement).outlineStyle") == "solid"
