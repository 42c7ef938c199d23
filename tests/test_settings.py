"""Settings: defaults, ranges, files, and what is said of wrong ones."""

import dataclasses
import json
import math
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from enfilade.errors import SettingsError
from enfilade.methods.analysis import SPACING
from enfilade.settings import (
    LAYERS,
    SECTIONS,
    AntialiasSettings,
    KeyframeSettings,
    LimitSettings,
    MaskSettings,
    OutputSettings,
    Placement,
    ReferenceSettings,
    SampleFilter,
    SamplingSettings,
    Section,
    Settings,
    ViewingSettings,
    option,
    read_tables,
)

FIELDS = [(cls, f) for cls in SECTIONS for f in dataclasses.fields(cls)]
RANGED = [(cls, f) for cls, f in FIELDS if f.metadata["least"] is not None]


def name(value):
    return getattr(value, "name", None) or getattr(value, "__name__", None)


def test_the_paper_is_the_default():
    settings = Settings()
    keyframes, masks = settings[KeyframeSettings], settings[MaskSettings]
    assert (SPACING, keyframes.adaptation) == (25, 0.5)  # §4.2
    assert masks.slow_deg_s == 0.5  # §4.1
    assert masks.split_percent == 10.0  # §4.3
    assert (masks.specular_jnd, masks.specular_percent) == (2.0, 25.0)
    assert (settings[AntialiasSettings].frames, settings[AntialiasSettings].slow_frames) == (11, 15)  # §5.2
    assert (settings[ViewingSettings].diagonal_m, settings[ViewingSettings].distance_m) == (0.25, 0.5)


def test_settings_survive_their_tables():
    settings = Settings.from_tables(
        {
            "sampling": {"spp": 3},
            "reference": {"pixel_filter": "box"},
            "keyframes": {"placement": "equal-flow"},
            "viewing": {"diagonal_m": 1},
        }
    )
    assert settings[SamplingSettings].spp == 3
    assert settings[ReferenceSettings].pixel_filter is SampleFilter.BOX
    assert settings[KeyframeSettings].placement is Placement.EQUAL_FLOW
    assert isinstance(settings[ViewingSettings].diagonal_m, float)
    through_json = json.loads(json.dumps(settings.to_tables()))
    assert Settings.from_tables(through_json) == settings
    assert Settings.from_tables({}) == Settings()


def test_sections_check_the_types_of_their_values():
    for kind, values in (
        (KeyframeSettings, {"placement": "uniform"}),
        (SamplingSettings, {"spp": 2.0}),
        (SamplingSettings, {"spp": np.bool_(True)}),
        (ViewingSettings, {"distance_m": "0.5"}),
        (AntialiasSettings, {"separate_shapes": 1}),
        (OutputSettings, {"layers": ["Z"]}),
    ):
        for made in (kind, partial(Settings().replace, kind)):
            with pytest.raises(SettingsError, match=rf"\[{kind.table}\] .* expected"):
                made(**values)
    assert json.dumps(SamplingSettings(spp=np.uint8(3)).to_table()["spp"]) == "3"
    assert json.dumps(ViewingSettings(distance_m=1).to_table()["distance_m"]) == "1.0"
    assert ViewingSettings(distance_m=np.float32(0.5)) == ViewingSettings()


@given(st.integers(1, 1_048_576), st.floats(0.0, 0.9), st.sampled_from(list(Placement)), st.booleans())
def test_any_settings_survive_their_tables(spp, adaptation, placement, separate):
    tables = {
        "sampling": {"spp": spp},
        "keyframes": {"adaptation": adaptation, "placement": placement.value},
        "antialias": {"separate_shapes": separate},
    }
    settings = Settings.from_tables(tables)
    assert settings[KeyframeSettings] == KeyframeSettings(placement=placement, adaptation=adaptation)
    assert Settings.from_tables(settings.to_tables()) == settings


@pytest.mark.parametrize(("cls", "f"), FIELDS, ids=name)
def test_every_setting_has_a_sentence_of_help(cls, f):
    text = f.metadata["help"]
    assert text[0].isupper()
    assert text.endswith(".")


@pytest.mark.parametrize(("cls", "f"), RANGED, ids=name)
def test_ranges_include_their_ends_and_nothing_beyond(cls, f):
    kind = type(f.default)
    step = 1 if kind is int else 1e-6
    for end, beyond in ((f.metadata["least"], -step), (f.metadata["most"], step)):
        if end is None:
            continue
        assert getattr(cls(**{f.name: kind(end)}), f.name) == end
        with pytest.raises(SettingsError, match=rf"\] {f.name} = .* out of range"):
            cls(**{f.name: kind(end + beyond * max(abs(end), 1))})


@pytest.mark.parametrize(
    ("tables", "problem"),
    [
        ({"tracing": {}}, r"unknown section \[tracing\]; known are: trace, sampling"),
        ({"trace": 3}, r"\[trace\] must be a table of settings, not 3"),
        ({"trace": {"sed": 3}}, r"unknown setting 'sed' in \[trace\]; known are: seed, max_depth"),
        ({"sampling": {"spp": 0}}, r"\[sampling\] spp = 0 is out of range: it must be between 1 and 1048576"),
        ({"sampling": {"spp": 2.5}}, r"\[sampling\] spp = 2.5: expected int"),
        ({"sampling": {"spp": "64"}}, "expected int"),
        ({"sampling": {"spp": True}}, "expected int"),
        ({"viewing": {"distance_m": True}}, "expected float"),
        ({"viewing": {"distance_m": 0.0}}, r"must be at least 0.05"),
        ({"viewing": {"distance_m": math.nan}}, "distance_m = nan"),
        ({"viewing": {"distance_m": math.inf}}, "finite"),
        ({"viewing": {"distance_m": 10**400}}, "finite"),
        ({"antialias": {"separate_shapes": 1}}, "expected bool"),
        ({"antialias": {"frames": 10}}, r"\[antialias\] frames = 10: give an odd number"),
        ({"antialias": {"slow_frames": 2}}, "slow_frames = 2: give an odd number"),
        ({"antialias": {"specular_frames": 4}}, "specular_frames = 4: give an odd number"),
        ({"keyframes": {"placement": "best"}}, "'best': choose one of adapted, uniform, equal-flow"),
        ({"keyframes": {"placement": 3}}, "choose one of"),
        ({"decoupled": {"irradiance_spp": 1}}, "irradiance_spp = 1"),
        ({"decoupled": {"edge_spp": 1}}, "must be between 2 and 4096"),
        ({"decoupled": {"min_spp": 1}}, "must be between 2 and 4096"),
        ({"decoupled": {"specular_spp": 1}}, "specular_spp = 1"),
        ({"output": {"layers": "Z,z"}}, "no layer 'z'.* Z,P,N,albedo,shape_index,"),
        ({"output": {"layers": ""}}, "no layer ''"),
        ({"video": {"codec": "divx"}}, "'divx': choose one of h264, ffv1, av1, prores"),
        ({"video": {"codec": ["h264"]}}, "expected str"),
    ],
)
def test_wrong_settings_are_named(tables, problem):
    with pytest.raises(SettingsError, match=problem):
        Settings.from_tables(tables)


@pytest.mark.parametrize(
    ("layers", "chosen", "ordered"),
    [
        ("all", LAYERS, "all"),
        (",".join(reversed(LAYERS)), LAYERS, "all"),
        ("none", (), "none"),
        ("provenance, Z", ("Z", "provenance"), "Z,provenance"),
        ("N", ("N",), "N"),
    ],
)
def test_layers_by_name(layers, chosen, ordered):
    assert (OutputSettings(layers).chosen, OutputSettings(layers).ordered) == (frozenset(chosen), ordered)


def test_layers_may_be_a_list():
    made = Settings.from_tables({"output": {"layers": ["Z", "N"]}, "limits": {"allow": ["/a", "/b"]}})
    assert (made[OutputSettings].chosen, made[LimitSettings].allow) == ({"Z", "N"}, "/a:/b")
    for layers, problem in (
        (["Z", 3], "expected str"),
        (["Z", "z"], "no layer 'z'"),
        ([], "write all, none"),
    ):
        with pytest.raises(SettingsError, match=problem):
            Settings.from_tables({"output": {"layers": layers}})


def test_sections_check_themselves_when_made():
    with pytest.raises(SettingsError, match=r"\[viewing\] peak_cd_m2 = 0.5 is out of range"):
        ViewingSettings(peak_cd_m2=0.5)


def test_a_file_is_read(tmp_path):
    file = tmp_path / "s.toml"
    file.write_text("[keyframes]\nspacing = 12\nplacement = 'uniform'\n")
    settings = Settings.from_tables(read_tables(file))
    assert settings[KeyframeSettings] == KeyframeSettings(Placement.UNIFORM, 12)
    file.write_bytes(b"\xef\xbb\xbf" + file.read_bytes())  # as Windows' editors write it
    assert Settings.from_tables(read_tables(file)) == settings


def test_files_that_cannot_be_read_are_named(tmp_path):
    file = tmp_path / "s.toml"
    with pytest.raises(SettingsError, match=r"can't read the settings .*s\.toml: No such file"):
        read_tables(file)
    for content in (b"[trace\nspp = 1", b"spp 3", b"\xff\xfe", b"a = " + b"9" * 5000, b"a = " + b"[" * 9999):
        file.write_bytes(content)
        with pytest.raises(SettingsError, match=r"s\.toml is not valid TOML"):
            read_tables(file)


@dataclasses.dataclass(frozen=True)
class GrainSettings(Section):
    """Of a method of one's own."""

    table = "grain"
    size: int = option(3, "Size of a grain.", least=1)


def test_sections_of_your_own():
    settings = Settings.from_tables({"grain": {"size": 5}}, [*SECTIONS, GrainSettings])
    assert settings[GrainSettings] == GrainSettings(5)
    assert Settings()[GrainSettings] == GrainSettings()
    with pytest.raises(SettingsError, match=r"unknown section \[grain\]"):
        Settings.from_tables({"grain": {"size": 5}})
