"""The page of ``enfilade import --check``, in a real browser."""

import re

import numpy as np
import pytest

from enfilade.reports.fidelity import differences_of, write_check
from enfilade.runs.fidelity import CheckedFrame, Cost, ImportCheck
from enfilade.scene.blender.imported import ImportedScene, SourceView
from enfilade.scene.blender.notes import Note, NoteKind

SIZE = (90, 160)
NAMES = ("floor", "<b>lamp</b>", "elsewhere")


def image(seed, gain):
    rng = np.random.default_rng(seed)
    made = np.full((*SIZE, 3), 0.2, np.float32)
    made[45:] = 0.4 * np.float32(gain)
    return (made * rng.uniform(0.9, 1.1, (*SIZE, 1))).astype(np.float32)


@pytest.fixture(scope="module")
def check():
    index = np.zeros((2, *SIZE), np.uint32)
    index[:, 45:] = 1
    index[1, 9:18, 16:48] = 2  # seen in the second frame alone
    frames = [
        CheckedFrame(
            number, (image(0, 1.0), image(1, 1.0)), (image(2, (1.2, 1, 1)), image(3, (1.2, 1, 1))), of
        )
        for number, of in zip((11, 13), index, strict=True)
    ]
    return ImportCheck(tuple(frames), NAMES, 64, Cost(60.0, 110.0), Cost(20.0, 38.0))


@pytest.fixture(scope="module")
def page_file(check, tmp_path_factory):
    folder = tmp_path_factory.mktemp("check")
    (folder / "settings.toml").write_text("[viewing]\nexposure_ev = 0.5\n")
    note = Note(NoteKind.NOT_CARRIED, "Sofa", "Subsurface", "no light under the surface", "it looks hard")
    imported = ImportedScene(
        folder, "my <shot>.blend", "4.5.1", "Scene", "Cam", 24.0, (11, 13), (160, 90), 0.5,
        SourceView("sRGB", "Standard", "None"), {"objects": 3}, (note,),
    )  # fmt: skip
    return write_check(imported, check, differences_of(check))


def test_the_page_says_what_differs(page_file):
    text = page_file.read_text()
    rows = re.findall(r'<tr class="object" data-object="\d">(.*?)</tr>', text)
    assert len(rows) == 2  # the third object is nowhere
    assert ">floor<" in rows[0]
    assert "&lt;b&gt;lamp&lt;/b&gt;" in rows[1]
    cells = [float(cell) for cell in re.findall(r"<td>(.*?)</td>", rows[0])]
    assert cells[1] == pytest.approx(100 * 0.2 / 3, abs=0.5)  # red alone differs
    assert "my &lt;shot&gt;.blend" in text
    assert "no light under the surface" in text


@pytest.fixture
def page(open_page):
    opened = open_page()
    opened.wait_for_selector('#pair[data-shown="11"]')
    return opened


def test_the_boundary_moves(page):
    box = page.locator("#pair").bounding_box()
    page.mouse.click(box["x"] + 0.25 * box["width"], box["y"] + 20)
    clip = "getComputedStyle(document.querySelector('#right')).clipPath"
    assert float(page.locator("#split").input_value()) == pytest.approx(25.0, abs=0.5)
    assert float(re.search(r"([\d.]+)%", page.evaluate(clip))[1]) == pytest.approx(25.0, abs=0.5)
    page.locator("#split").fill("80")
    assert "80%" in page.evaluate(clip)


def test_frames_and_the_difference(page):
    page.get_by_role("button", name="frame 13").click()
    page.wait_for_selector('#pair[data-shown="13"]')
    page.get_by_role("button", name="difference").click()
    page.wait_for_selector('#pair[data-shown="13 difference"]')
    assert page.locator("#left").get_attribute("src") == page.locator("#right").get_attribute("src")
    widths = page.evaluate("['left', 'right'].map((id) => document.getElementById(id).naturalWidth)")
    assert widths == [160, 160]


def test_an_object_is_shown_where_it_is(page):
    page.get_by_role("button", name="lamp").click()
    page.wait_for_selector('#pair[data-shown="13"]')
    box, pair = page.locator("#box").bounding_box(), page.locator("#pair").bounding_box()
    assert (box["x"] - pair["x"]) / pair["width"] == pytest.approx(0.1, abs=0.01)
    assert box["height"] / pair["height"] == pytest.approx(0.1, abs=0.02)
    page.get_by_role("button", name="lamp").click()
    assert page.locator("#box").is_hidden()


def test_it_fits_a_phone(page):
    page.set_viewport_size({"width": 390, "height": 844})
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
