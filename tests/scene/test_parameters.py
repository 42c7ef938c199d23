"""Parameters of a scene are filled in as Mitsuba does it: what we judge is what it opens."""

from xml.sax.saxutils import quoteattr

import mitsuba as mi
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from enfilade.device import active
from enfilade.scene import parameters
from enfilade.scene.parameters import Parameters


def ours(defaults, text):
    """A text with its parameters, or None where it is refused."""
    known = Parameters()
    try:
        for name, value in defaults:
            known.define(known.filled(name), known.filled(value))
        return known.filled(text)
    except ValueError:
        return None


def mitsubas(defaults, text):
    mi.set_variant(active().variant)
    lines = [f"<default name={quoteattr(name)} value={quoteattr(value)}/>" for name, value in defaults]
    body = "".join(lines) + f'<string name="text" value={quoteattr(text)}/>'
    config = mi.parser.ParserConfig(active().variant)
    try:
        state = mi.parser.parse_string(config, f'<scene version="3.0.0">{body}</scene>')
    except RuntimeError:
        return None
    return state.root.props["text"]


@pytest.mark.parametrize(
    ("defaults", "text", "filled"),
    [
        ([("x", "ok"), ("x-y", "/etc/passwd")], "$x-y", "/etc/passwd"),
        ([("x-y", "/etc/passwd"), ("x", "ok")], "$x-y", "/etc/passwd"),
        ([("x", "ok")], "$x-y", "ok-y"),
        ([("si", "S"), ("size", "L")], "$size $si $sizes", "L S Ls"),
        ([("a", "1"), ("a", "2")], "$a", "1"),
        ([("a", "A"), ("b", "$a$a")], "$b", "AA"),
        ([("b", "$a"), ("a", "A")], "$b", None),
        ([("bb", r"\$a"), ("a", "A")], "$bb", "A"),
        ([("a", "A"), ("b", r"\$a")], "$b", None),
        ([("aa", r"\$"), ("b", "B")], "$aab", "B"),
        ([("n", "x"), ("$n", "X")], "$x", "X"),
        ([(r"\$q", "B")], "$$q", "B"),
        ([("a", "A")], r"\$a \\$a", r"$a \$a"),
        ([("a", "\\")], "$a$a", "$a"),
        ([("é", "E"), ("ab", "B")], "$é$ab", "EB"),
        ([("", "B")], "x", None),
        ([], "100$", None),
        ([], r"100\$", "100$"),
    ],
)
def test_cases(defaults, text, filled):
    assert ours(defaults, text) == filled
    assert mitsubas(defaults, text) == filled


# Few characters, so that names meet, begin alike, and stand beside what escapes them.
WORDS = st.text("ab-$\\é", max_size=4)
TEXTS = st.lists(st.sampled_from(["$", "\\", "a", "ab", "-", "$a", "$ab", "$b", "$a-", "é"]), max_size=6)


@settings(max_examples=400)
@given(st.lists(st.tuples(WORDS, TEXTS.map("".join)), max_size=4), TEXTS.map("".join))
@example([("a", "\\"), ("b", "")], "$a$b$a")
def test_any_text_is_filled_as_mitsuba_does(defaults, text):
    assert ours(defaults, text) == mitsubas(defaults, text)


def test_values_that_grow_within_values_are_refused():
    known = Parameters()
    known.define("a0", "x" * 1000)
    for index in range(9):
        known.define(f"a{index + 1}", known.filled(f"$a{index}$a{index}"))
    with pytest.raises(ValueError, match="more than 1000000 characters"):
        known.filled("$a9$a9")


def test_their_number_is_bounded(monkeypatch):
    monkeypatch.setattr(parameters, "MOST", 2)
    known = Parameters()
    for name in ("a", "b", "a"):
        known.define(name, "x")
    with pytest.raises(ValueError, match="more than 2 parameters"):
        known.define("c", "x")
