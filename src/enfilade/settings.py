"""Every option of every stage: one frozen dataclass a stage, with defaults, ranges and help.

The command line makes its flags from these classes (``--keyframes-spacing``), and a TOML file sets them
by section (``[keyframes]`` / ``spacing = 25``).
"""

from __future__ import annotations

import dataclasses
import math
import os
import tomllib
from dataclasses import dataclass, field, fields
from enum import Enum
from pathlib import Path
from typing import Any, Self

from enfilade.errors import SettingsError


def option(
    default: Any,
    text: str,
    *,
    least: float | None = None,
    most: float | None = None,
    choices: tuple[str, ...] = (),
    is_odd: bool = False,
    is_path: bool = False,
    joined_by: str = "",
) -> Any:
    """Declare a setting: default, one sentence of help, range (ends included) or words to choose from.

    One with `joined_by` may be given as a list, too.
    """
    metadata = {
        "help": text, "least": least, "most": most, "choices": choices, "is_odd": is_odd,
        "is_path": is_path, "joined_by": joined_by,
    }  # fmt: skip
    return field(default=default, metadata=metadata)


@dataclass(frozen=True)
class Section:
    """What the settings of all stages share: range checks, and reading from a table."""

    def __post_init__(self) -> None:
        for f in fields(self):
            _check(f, getattr(self, f.name), f"[{section_name(type(self))}] {f.name}")

    @classmethod
    def from_table(cls, table: dict[str, Any]) -> Self:
        """Build from a TOML table; unknown keys raise and list the known ones.

        Raises
        ------
        SettingsError
        """
        known = {f.name: f for f in fields(cls)}
        for key in table:
            if key not in known:
                raise SettingsError(
                    f"unknown setting {key!r} in [{section_name(cls)}]; known are: {', '.join(known)}"
                )
        return cls(**{k: _converted(known[k], v, cls) for k, v in table.items()})


class Placement(Enum):
    """How initial keyframes are placed (§4.2)."""

    ADAPTED = "adapted"
    UNIFORM = "uniform"
    EQUAL_FLOW = "equal-flow"


class Metering(Enum):
    """Which retinal velocities the metric assumes (§3.3)."""

    PURSUIT = "pursuit"
    NONE = "none"
    BOTH = "both"


class SampleFilter(Enum):
    """Pixel filter of frames that are traced whole and antialiased by themselves."""

    BOX = "box"
    GAUSSIAN = "gaussian"


@dataclass(frozen=True)
class TraceSettings(Section):
    """Path tracing."""

    spp: int = option(
        64, "Paths traced for a pixel, by the methods paper and reference.", least=1, most=1_048_576
    )
    seed: int = option(0, "Seed of all random numbers.", least=0, most=2**32 - 1)
    max_depth: int = option(
        0, "Longest path in edges; 0 takes what the scene's integrator says.", least=0, most=1024
    )
    pixel_filter: SampleFilter = option(SampleFilter.GAUSSIAN, "Pixel filter of --method reference.")
    chunk: int = option(
        1_048_576, "Paths in flight at once: bounds the memory.", least=1024, most=268_435_456
    )


@dataclass(frozen=True)
class ViewingSettings(Section):
    """Who looks at the video, and on what (§5.2): this fixes pixels per degree."""

    diagonal_m: float = option(0.25, "Diagonal of the image on the screen, metres.", least=0.01)
    distance_m: float = option(0.5, "Distance of the eye from the screen, metres.", least=0.05)
    peak_cd_m2: float = option(100.0, "Luminance of the display's white, cd/m2.", least=1.0)
    black_cd_m2: float = option(0.1, "Luminance of the display's black, cd/m2.", least=0.0)
    persistence: float = option(
        1.0, "Share of a frame's time for which the display shows it.", least=0.0, most=1.0
    )
    exposure_ev: float = option(0.0, "Exposure before the view transform, in stops.", least=-32.0, most=32.0)


@dataclass(frozen=True)
class KeyframeSettings(Section):
    """Initial placement of keyframes (§4.2)."""

    placement: Placement = option(
        Placement.ADAPTED, "Uniform spacing adapted by flow (Eq. 6), plain, or equal flow."
    )
    spacing: int = option(25, "Uniform spacing of keyframes, frames (Delta).", least=2)
    adaptation: float = option(
        0.5, "Largest relative change of the spacing (A of Eq. 6).", least=0.0, most=0.9
    )


@dataclass(frozen=True)
class WarpSettings(Section):
    """3D warp and compositing (§2.2)."""

    max_magnification: float = option(
        4.0, "Splats stretch to at most this many pixels a side; beyond is a hole.", least=1.0, most=16.0
    )
    depth_tolerance: float = option(
        0.02, "Relative difference of depth within which two samples are one surface.", least=1e-5, most=0.5
    )


@dataclass(frozen=True)
class MetricSettings(Section):
    """The animation quality metric (§3)."""

    metering: Metering = option(
        Metering.BOTH, "Eye movements that compare assumes: smooth pursuit, none, or the worse."
    )
    mask_slope: float = option(0.7, "Slope of visual masking.", least=0.0, most=1.0)


@dataclass(frozen=True)
class MaskSettings(Section):
    """Which pixels must be traced, and when a segment is split (§4.1, §4.3, §6)."""

    slow_deg_s: float = option(0.5, "Pixels slower than this are traced (v_t), deg/s.", least=0.0)
    specular_jnd: float = option(
        2.0, "A specular region with a difference above this is traced, JND.", least=0.0
    )
    specular_percent: float = option(
        25.0, "... or with more of its pixels above 1 JND than this, percent.", least=0.0, most=100.0
    )
    split_percent: float = option(
        10.0, "A segment with more of its unmasked pixels above 1 JND is split, percent.",
        least=0.0, most=100.0,
    )  # fmt: skip


@dataclass(frozen=True)
class AntialiasSettings(Section):
    """Motion-compensated spatiotemporal filter (§5.2, §5.3, §5.4)."""

    frames: int = option(11, "Temporal support, frames (odd).", least=1, most=63, is_odd=True)
    slow_frames: int = option(
        15, "Largest temporal support of slow pixels, frames (odd).", least=1, most=63, is_odd=True
    )
    slow_deg_s: float = option(0.15, "Below this the temporal support grows, deg/s.", least=0.0)
    specular_frames: int = option(
        3, "Temporal support on specular surfaces, frames (odd).", least=1, most=63, is_odd=True
    )
    support_still_px: float = option(3.0, "Spatial support at rest, pixels.", least=1.0, most=31.0)
    support_fast_px: float = option(
        9.0, "Spatial support at the fast velocity, pixels of 1/28 degree.", least=1.0, most=31.0
    )
    support_beyond_px: float = option(
        11.0, "Spatial support beyond it, pixels of 1/28 degree.", least=1.0, most=31.0
    )
    fast_deg_s: float = option(16.0, "The fast velocity, deg/s.", least=0.1)
    separate_items: bool = option(False, "Leave out samples of another surface along the flow (§5.3).")


@dataclass(frozen=True)
class LightSettings(Section):
    """Keyframes as a cache of light (--method decoupled)."""

    quality: float = option(
        10.0, "Noise that may be left, JND as compare scores it: lower is dearer.", least=0.5, most=100.0
    )
    paths: int = option(
        0, "Paths of a keyframe's pixel; 0 finds how many the quality asks for.", least=0, most=1_048_576
    )
    spacing: int = option(8, "Uniform spacing of the keyframes of light, frames.", least=2)
    keyframes: int = option(4, "Keyframes in which a surface is looked up.", least=1, most=16)
    least_samples: int = option(4, "Camera rays of every pixel in every frame.", least=2, most=4096)
    samples: int = option(
        0, "Camera rays of a pixel that shows an edge; 0: as many as the quality asks for.",
        least=0, most=4096,
    )  # fmt: skip
    lobe_samples: int = option(
        0, "Rays of a pixel that shows a glossy, mirroring or transparent surface, 2 or more; 0: as many as "
        "the quality asks for.", least=0, most=4096,
    )  # fmt: skip
    denoiser: str = option(
        "none",
        "Quality of Open Image Denoise on the light of keyframes, in place of smoothing it along surfaces.",
        choices=("none", "fast", "balanced", "high"),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("paths", "lobe_samples"):
            if getattr(self, name) == 1:
                raise SettingsError(
                    f"[light] {name} = 1: of one ray the noise can't be told; give 2 or more, or 0 for as "
                    "many as the quality asks for"
                )
        if 0 < self.samples < self.least_samples:
            raise SettingsError(
                f"[light] samples = {self.samples}: every pixel has {self.least_samples} (least_samples); "
                "give as many or more, or 0 for as many as the quality asks for"
            )


@dataclass(frozen=True)
class VideoSettings(Section):
    """Encoding of the video."""

    codec: str = option("h264", "Codec of the video.", choices=("h264", "ffv1", "av1", "prores"))
    quality: int = option(16, "Constant rate factor of h264 and av1: lower is better.", least=0, most=63)
    ocio: str = option("", "An OpenColorIO configuration for the view, in place of sRGB.", is_path=True)
    view: str = option("", "The view of that configuration.")
    display: str = option("", "Its display, one for sRGB, Rec.1886 or Rec.709; none: the first of these.")


LAYERS = ("Z", "P", "N", "albedo", "item", "forward", "backward", "source")  # of delivered frames


@dataclass(frozen=True)
class OutputSettings(Section):
    """Files of delivered frames."""

    layers: str = option(
        "forward,backward,source",
        f"Layers beside the colours: some of {','.join(LAYERS)}; or all, or none. Depth, position, normal, "
        "albedo, number of the item, image flow, and why a pixel has its value.",
        joined_by=",",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if unknown := sorted(self.chosen.difference(LAYERS)):
            raise SettingsError(
                f"[output] layers = {self.layers!r}: there is no layer {unknown[0]!r}; write all, none, or "
                f"some of {','.join(LAYERS)}"
            )

    @property
    def chosen(self) -> frozenset[str]:
        """The layers' names."""
        groups = {"all": LAYERS, "none": ()}
        return frozenset(groups.get(self.layers, [name.strip() for name in self.layers.split(",")]))


@dataclass(frozen=True)
class LimitSettings(Section):
    """Folders and resources that a scene may use; no result depends on them."""

    allow: str = option(
        "", f"Folders beside the scene's own in which its files may lie, with {os.pathsep!r} between them.",
        is_path=True, joined_by=os.pathsep,
    )  # fmt: skip
    preflight_mb: int = option(
        16_384, "Memory of the preflight process, which loads the scene before a run begins, MB.",
        least=512, most=10_000_000,
    )  # fmt: skip
    preflight_s: float = option(600.0, "Time limit of the preflight process, s.", least=0.1, most=86_400.0)


@dataclass(frozen=True)
class Settings:
    """All settings of a run."""

    trace: TraceSettings = field(default_factory=TraceSettings)
    viewing: ViewingSettings = field(default_factory=ViewingSettings)
    keyframes: KeyframeSettings = field(default_factory=KeyframeSettings)
    warp: WarpSettings = field(default_factory=WarpSettings)
    metric: MetricSettings = field(default_factory=MetricSettings)
    masks: MaskSettings = field(default_factory=MaskSettings)
    antialias: AntialiasSettings = field(default_factory=AntialiasSettings)
    light: LightSettings = field(default_factory=LightSettings)
    video: VideoSettings = field(default_factory=VideoSettings)
    output: OutputSettings = field(default_factory=OutputSettings)
    limits: LimitSettings = field(default_factory=LimitSettings)

    @classmethod
    def from_tables(cls, tables: dict[str, Any]) -> Self:
        """Build from the tables of a TOML or JSON file.

        Raises
        ------
        SettingsError
            An unknown section or setting, a wrong type, a value out of range.
        """
        known = sections()
        for name, table in tables.items():
            if name not in known:
                raise SettingsError(f"unknown section [{name}]; known are: {', '.join(known)}")
            if not isinstance(table, dict):
                raise SettingsError(f"[{name}] must be a table of settings, not {table!r}")
        built: dict[str, Any] = {n: known[n].from_table(t) for n, t in tables.items()}
        return cls(**built)

    def to_tables(self) -> dict[str, dict[str, Any]]:
        """All values as plain tables, fit for JSON; read back by :meth:`from_tables`."""
        return {
            name: {
                key: value.value if isinstance(value, Enum) else value
                for key, value in dataclasses.asdict(getattr(self, name)).items()
            }
            for name in sections()
        }


def sections() -> dict[str, type[Section]]:
    """Name and class of every section of :class:`Settings`, in order."""
    return {f.name: f.default_factory for f in fields(Settings)}  # type: ignore[misc]


def section_name(cls: type[Section]) -> str:
    """Name under which a section stands in a file."""
    return next((name for name, c in sections().items() if c is cls), cls.__name__)


def read_tables(path: Path) -> dict[str, Any]:
    """Tables of a TOML file, unchecked; :meth:`Settings.from_tables` checks them.

    Raises
    ------
    SettingsError
        The file can't be read or is no TOML.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))  # Windows' editors write a mark
    except OSError as error:
        raise SettingsError(f"can't read the settings {path}: {error.strerror}") from error
    except (ValueError, RecursionError) as error:  # numbers of 5000 digits and deep nesting included
        raise SettingsError(f"{path} is not valid TOML: {error}") from error


def _converted(f: dataclasses.Field[Any], value: Any, cls: type[Section]) -> Any:
    kind = type(f.default)
    where = f"[{section_name(cls)}] {f.name}"
    if issubclass(kind, Enum):
        choices = [choice.value for choice in kind]
        if value not in choices:
            raise SettingsError(f"{where} = {value!r}: choose one of {', '.join(choices)}")
        return kind(value)
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value) if abs(value) < 1e300 else math.inf  # which the check refuses
    joined_by = f.metadata["joined_by"]
    if joined_by and isinstance(value, list) and all(isinstance(part, str) for part in value):
        return joined_by.join(value)
    if type(value) is not kind:
        raise SettingsError(f"{where} = {value!r}: expected {kind.__name__}")
    return value


def _check(f: dataclasses.Field[Any], value: Any, where: str) -> None:
    choices = f.metadata["choices"]
    if choices and value not in choices:
        raise SettingsError(f"{where} = {value!r}: choose one of {', '.join(choices)}")
    if isinstance(value, float) and not math.isfinite(value):
        raise SettingsError(f"{where} = {value!r}: it must be a finite number")
    least, most = f.metadata["least"], f.metadata["most"]
    if (least is not None and not value >= least) or (most is not None and not value <= most):
        span = f"at least {least:.10g}" if most is None else f"between {least:.10g} and {most:.10g}"
        raise SettingsError(f"{where} = {value!r} is out of range: it must be {span}")
    if f.metadata["is_odd"] and value % 2 == 0:
        raise SettingsError(f"{where} = {value!r}: give an odd number: a frame and as many on either side")
