"""Settings: one frozen dataclass a section, with defaults, ranges and help.

A method names the sections that it reads. A TOML file sets them by table (``[keyframes]`` and below it
``spacing = 25``), the command line by flags or ``--set keyframes.spacing=25``.
"""

from __future__ import annotations

import dataclasses
import math
import os
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from enum import Enum
from numbers import Integral, Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar

from enfilade.errors import SettingsError

if TYPE_CHECKING:
    from enfilade.viewing import Viewing

S = TypeVar("S", bound="Section")

NUMBERS: dict[type, type] = {int: Integral, float: Real}  # types that stand for them


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
    """Declare a setting.

    Parameters
    ----------
    default
    text
        One sentence of help.
    least, most
        Range, ends included.
    choices
        Allowed words.
    is_odd
        Only odd numbers are allowed.
    is_path
        The value is a path; relative paths are resolved by the reader of the file or flag.
    joined_by
        Separator of a list, which may also be given as a TOML array.
    """
    metadata = {
        "help": text, "least": least, "most": most, "choices": choices, "is_odd": is_odd,
        "is_path": is_path, "joined_by": joined_by,
    }  # fmt: skip
    return field(default=default, metadata=metadata)


@dataclass(frozen=True)
class Section:
    """A section of settings. Subclasses are frozen dataclasses whose fields are made by :func:`option`.

    Attributes
    ----------
    table : str
        Name of its table in a TOML file.
    """

    table: ClassVar[str] = ""

    def __post_init__(self) -> None:
        for f in fields(self):
            where = f"[{self.table}] {f.name}"
            value = _typed(type(f.default), getattr(self, f.name), where)
            object.__setattr__(self, f.name, value)
            _check(f, value, where)

    @classmethod
    def from_table(cls, table: Mapping[str, Any]) -> Self:
        """Build from a TOML table.

        Raises
        ------
        SettingsError
            An unknown setting, a wrong type, a value out of range.
        """
        known = {f.name: f for f in fields(cls)}
        for key in table:
            if key not in known:
                raise SettingsError(
                    f"unknown setting {key!r} in [{cls.table}]; known are: {', '.join(known)}"
                )
        return cls(**{key: _converted(known[key], value, cls) for key, value in table.items()})

    def to_table(self) -> dict[str, Any]:
        """All values, fit for JSON; read back by :meth:`from_table`."""
        values = dataclasses.asdict(self)
        return {key: value.value if isinstance(value, Enum) else value for key, value in values.items()}


class Placement(Enum):
    """Placement of the initial keyframes (§4.2)."""

    ADAPTED = "adapted"
    UNIFORM = "uniform"
    EQUAL_FLOW = "equal-flow"


class Pursuit(Enum):
    """Eye movement while the image moves (§3.3).

    PURSUIT
        The eye follows the motion at each pixel as well as it can (Eq. 5). Segment splitting uses this.
    NONE
        It stands still: the image moves over the retina at its own velocity.
    BOTH
        Either may happen: each channel takes the larger sensitivity of the two.
    """

    PURSUIT = "pursuit"
    NONE = "none"
    BOTH = "both"

    @property
    def hypotheses(self) -> tuple[Pursuit, ...]:
        """The single eye movements to evaluate, of which the most sensitive counts."""
        return (Pursuit.PURSUIT, Pursuit.NONE) if self is Pursuit.BOTH else (self,)


class SampleFilter(Enum):
    """Pixel filter of frames that are traced whole and antialiased by themselves."""

    BOX = "box"
    GAUSSIAN = "gaussian"


@dataclass(frozen=True)
class TraceSettings(Section):
    """Path tracing."""

    table = "trace"

    seed: int = option(0, "Seed of all random numbers.", least=0, most=2**32 - 1)
    max_depth: int = option(
        0, "Greatest path depth, in segments; 0 takes what the scene's integrator says.", least=0, most=1024
    )


@dataclass(frozen=True)
class SamplingSettings(Section):
    """Samples per pixel of the methods that trace whole pixels: paper and reference."""

    table = "sampling"

    spp: int = option(64, "Paths a pixel, of the methods paper and reference.", least=1, most=1_048_576)


@dataclass(frozen=True)
class ReferenceSettings(Section):
    """The method reference."""

    table = "reference"

    pixel_filter: SampleFilter = option(SampleFilter.GAUSSIAN, "Pixel filter.")


@dataclass(frozen=True)
class ViewingSettings(Section):
    """Viewing conditions of the video (§5.2), from which the pixels per degree follow."""

    table = "viewing"

    diagonal_m: float = option(0.25, "Diagonal of the image on the screen, metres.", least=0.01)
    distance_m: float = option(0.5, "Distance of the eye from the screen, metres.", least=0.05)
    peak_cd_m2: float = option(100.0, "Luminance of the display's white, cd/m2.", least=1.0)
    black_cd_m2: float = option(0.1, "Luminance of the display's black, cd/m2.", least=0.0)
    persistence: float = option(
        1.0, "Share of a frame's time for which the display shows it.", least=0.0, most=1.0
    )
    exposure_ev: float = option(0.0, "Exposure before the view transform, in stops.", least=-32.0, most=32.0)
    white: float = option(
        1.0,
        "Exposed luminance that the tone curve shows as white, by which `decoupled` judges contrasts: 1 for "
        "sRGB, 8 for AgX.",
        least=1.0,
        most=256.0,
    )

    def conditions(self, width_px: int, height_px: int, fps: float) -> Viewing:
        """Viewing conditions of images of a size.

        Raises
        ------
        InputError
            They are not consistent.
        """
        from enfilade.viewing import Viewing  # loads NumPy, which `--help` does without

        return Viewing(
            width_px,
            height_px,
            diagonal_m=self.diagonal_m,
            distance_m=self.distance_m,
            fps=fps,
            peak_cd_m2=self.peak_cd_m2,
            black_cd_m2=self.black_cd_m2,
            persistence=self.persistence,
        )


@dataclass(frozen=True)
class KeyframeSettings(Section):
    """Initial placement of keyframes (§4.2)."""

    table = "keyframes"

    placement: Placement = option(
        Placement.ADAPTED, "Uniform spacing adapted by flow (Eq. 6), plain, or equal flow."
    )
    spacing: int = option(
        0, "Uniform spacing of keyframes, frames (Delta), 2 or more; 0: 25 of paper, 8 of decoupled.", least=0
    )
    adaptation: float = option(
        0.5, "Largest relative change of the spacing (A of Eq. 6).", least=0.0, most=0.9
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.spacing == 1:
            raise SettingsError(
                f"[{self.table}] spacing = 1: every frame would be a keyframe; give 2 or more, or 0 for the "
                "method's own"
            )


@dataclass(frozen=True)
class WarpSettings(Section):
    """3D warp and compositing (§2.2)."""

    table = "warp"

    max_magnification: float = option(
        4.0,
        "Splats stretch to at most this many pixels a side; beyond, a pixel is disoccluded.",
        least=1.0,
        most=16.0,
    )
    depth_tolerance: float = option(
        0.02, "Relative difference of depth within which two samples are one surface.", least=1e-5, most=0.5
    )


@dataclass(frozen=True)
class MetricSettings(Section):
    """The animation quality metric (§3)."""

    table = "metric"

    pursuit: Pursuit = option(
        Pursuit.BOTH, "Eye movements that compare assumes: smooth pursuit, none, or the worse."
    )
    mask_slope: float = option(0.7, "Slope of visual masking.", least=0.0, most=1.0)


@dataclass(frozen=True)
class MaskSettings(Section):
    """Criteria by which pixels are traced and segments are split (§4.1, §4.3, §6)."""

    table = "masks"

    slow_deg_s: float = option(0.5, "Pixels slower than this are traced (v_t), deg/s.", least=0.0)
    specular_jnd: float = option(
        2.0, "A specular region with a difference above this is traced, JND.", least=0.0
    )
    specular_percent: float = option(
        25.0,
        "A specular region with more of its pixels above 1 JND is traced, percent.",
        least=0.0,
        most=100.0,
    )
    split_percent: float = option(
        10.0, "A segment with more of its unmasked pixels above 1 JND is split, percent.",
        least=0.0, most=100.0,
    )  # fmt: skip


@dataclass(frozen=True)
class AntialiasSettings(Section):
    """Motion-compensated spatiotemporal filter (§5.2, §5.3, §5.4)."""

    table = "antialias"

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
        3.0,
        "Spatial support at the fast velocity, pixels of 1/28 degree (the paper's: 9).",
        least=1.0,
        most=31.0,
    )
    support_beyond_px: float = option(
        3.0, "Spatial support beyond it, pixels of 1/28 degree (the paper's: 11).", least=1.0, most=31.0
    )
    fast_deg_s: float = option(16.0, "The fast velocity, deg/s.", least=0.1)
    separate_shapes: bool = option(
        True,
        "Leave out samples along the flow of another surface that moves otherwise (§5.3; the paper: no).",
    )


@dataclass(frozen=True)
class DecoupledSettings(Section):
    """The method decoupled: irradiance cached at keyframes."""

    table = "decoupled"

    quality: float = option(
        10.0,
        "Noise that decoupled may leave, on a scale of its own; lower is better and costs more.",
        least=0.5,
        most=100.0,
    )
    irradiance_spp: int = option(
        0, "Paths a pixel of an irradiance image; 0: derived from the quality.", least=0, most=1_048_576
    )
    lookup_keyframes: int = option(4, "Nearest keyframes that are looked up.", least=1, most=16)
    min_spp: int = option(4, "Camera rays of every pixel.", least=2, most=4096)
    edge_spp: int = option(
        128, "Most rays of a pixel at an edge or on a narrow glossy surface.", least=2, most=4096
    )
    specular_spp: int = option(
        0,
        "First rays of a pixel with specular lobes, 2 or more (a quarter where they are faint); 0: derived "
        "from the quality.",
        least=0,
        most=4096,
    )
    denoiser: str = option(
        "balanced",
        "Quality of Open Image Denoise on decoupled's irradiance images and shadows; none: a wavelet filter, "
        "on specular AOVs, too, and shadows as they are.",
        choices=("none", "fast", "balanced", "high"),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("irradiance_spp", "specular_spp"):
            if getattr(self, name) == 1:
                raise SettingsError(
                    f"[{self.table}] {name} = 1: the noise of a single sample can't be estimated; give 2 or "
                    "more, or 0 to derive it from the quality"
                )


@dataclass(frozen=True)
class VideoSettings(Section):
    """Encoding of the video."""

    table = "video"

    codec: str = option("h264", "Codec of the video.", choices=("h264", "ffv1", "av1", "prores"))
    quality: int = option(16, "Constant rate factor of h264 and av1: lower is better.", least=0, most=63)
    ocio: str = option("", "An OpenColorIO configuration for the view, in place of sRGB.", is_path=True)
    view: str = option(
        "", "The view of that configuration; another one than a file's or run's leaves out its look."
    )
    look: str = option("", "A look of that configuration, applied before the view.")
    display: str = option("", "Its display, one for sRGB, Rec.1886 or Rec.709; none: the first of these.")


LAYERS = ("Z", "P", "N", "albedo", "shape_index", "forward", "backward", "provenance")  # of delivered frames


@dataclass(frozen=True)
class OutputSettings(Section):
    """Files of delivered frames."""

    table = "output"

    layers: str = option(
        "forward,backward,provenance",
        f"AOVs beside the colours: some of {','.join(LAYERS)}; or all, or none.",
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

    @property
    def ordered(self) -> str:
        """The same layers, always written in the same way."""
        names = [name for name in LAYERS if name in self.chosen]
        return {0: "none", len(LAYERS): "all"}.get(len(names), ",".join(names))


@dataclass(frozen=True)
class LimitSettings(Section):
    """Limits of resources. Rare long paths depend on the number of paths in flight, nothing else."""

    table = "limits"

    allow: str = option(
        "", f"Folders beside the scene's own that its files may lie in, separated by {os.pathsep!r}.",
        is_path=True, joined_by=os.pathsep,
    )  # fmt: skip
    paths_in_flight: int = option(
        1_048_576, "Paths traced at once; bounds the memory.", least=1024, most=268_435_456
    )
    task_timeout_s: float = option(
        0.0, "Seconds after which a worker process is killed that has not finished its task; 0: never.",
        least=0.0, most=31_536_000.0,
    )  # fmt: skip
    preflight_mb: int = option(
        16_384, "Memory of the process that loads a scene once before a run begins, MB.",
        least=512, most=10_000_000,
    )  # fmt: skip
    preflight_s: float = option(600.0, "Its time limit, seconds.", least=0.1, most=86_400.0)
    import_mb: int = option(
        16_384, "Memory of the process in which Blender imports a file, MB.", least=512, most=10_000_000
    )
    import_s: float = option(1800.0, "Its time limit, seconds.", least=0.1, most=604_800.0)
    import_instances: int = option(1_000_000, "Most instances of an imported file.", least=1)
    import_triangles: int = option(50_000_000, "Most triangles of an imported file.", least=1)


@dataclass(frozen=True)
class BlenderSettings(Section):
    """Import of .blend, glTF, USD, FBX and OBJ files by Blender."""

    table = "blender"

    program: str = option(
        "", "Blender, or a Python with the module bpy, in place of the one that is found.", is_path=True
    )
    scene: str = option("", "Name of the scene of the file; none: the active one.")
    view_layer: str = option("", "Name of the view layer; none: the first that is rendered.")
    camera: str = option("", "Name of the camera; none: the scene's, with its markers.")
    bake_px: int = option(1024, "Largest side of a baked texture, pixels.", least=16, most=8192)
    bake_samples: int = option(16, "Samples of a baked pixel.", least=1, most=4096)
    strict: bool = option(False, "Refuse files of which something is not carried over.")


SECTIONS: tuple[type[Section], ...] = (
    TraceSettings, SamplingSettings, ReferenceSettings, ViewingSettings, KeyframeSettings, WarpSettings,
    MetricSettings, MaskSettings, AntialiasSettings, DecoupledSettings, VideoSettings, OutputSettings,
    LimitSettings, BlenderSettings,
)  # fmt: skip


class Settings:
    """Settings by section, such as ``settings[MaskSettings].slow_deg_s``; one not given has its defaults.

    Parameters
    ----------
    sections
        One of a class; a later one replaces an earlier one.
    """

    def __init__(self, *sections: Section) -> None:
        self._sections: dict[type[Section], Section] = {type(section): section for section in sections}

    def __getitem__(self, kind: type[S]) -> S:
        """The section of a class."""
        found = self._sections.get(kind)
        return found if isinstance(found, kind) else kind()

    def __eq__(self, other: object) -> bool:
        """Whether all sections that either of them holds are equal."""
        if not isinstance(other, Settings):
            return NotImplemented
        return all(self[kind] == other[kind] for kind in {*self._sections, *other._sections})

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        """The sections that are not at their defaults."""
        changed = [repr(section) for kind, section in self._sections.items() if section != kind()]
        return f"Settings({', '.join(changed)})"

    def replace(self, kind: type[Section], **values: Any) -> Settings:
        """The same settings with other values in one section.

        Raises
        ------
        SettingsError
            A value is of a wrong type, or out of range.
        """
        return Settings(*self._sections.values(), dataclasses.replace(self[kind], **values))

    def only(self, kinds: Iterable[type[Section]]) -> Settings:
        """The same settings with all other sections at their defaults."""
        return Settings(*(self[kind] for kind in kinds))

    @classmethod
    def from_tables(cls, tables: Mapping[str, Any], kinds: Sequence[type[Section]] = SECTIONS) -> Self:
        """Build from the tables of a TOML or JSON file.

        Parameters
        ----------
        tables
        kinds
            Sections that there are.

        Raises
        ------
        SettingsError
            An unknown section or setting, a wrong type, a value out of range.
        """
        known = {kind.table: kind for kind in kinds}
        for name, table in tables.items():
            if name not in known:
                raise SettingsError(f"unknown section [{name}]; known are: {', '.join(known)}")
            _check_table(name, table)
        return cls(*(known[name].from_table(table) for name, table in tables.items()))

    def to_tables(self, kinds: Iterable[type[Section]] = SECTIONS) -> dict[str, dict[str, Any]]:
        """All values of some sections, fit for JSON; read back by :meth:`from_tables`."""
        return {kind.table: self[kind].to_table() for kind in kinds}


def read_tables(path: Path) -> dict[str, Any]:
    """Tables of a TOML file, whose settings are unchecked; :meth:`Settings.from_tables` checks them.

    Raises
    ------
    SettingsError
        The file can't be read, is no TOML, or has something else than tables.
    """
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8-sig"))  # Windows' editors write a mark
    except OSError as error:
        raise SettingsError(f"can't read the settings {path}: {error.strerror}") from error
    except (ValueError, RecursionError) as error:  # numbers of 5000 digits and deep nesting included
        raise SettingsError(f"{path} is not valid TOML: {error}") from error
    for name, table in tables.items():
        _check_table(name, table)
    return tables


def _check_table(name: str, table: Any) -> None:
    if not isinstance(table, dict):
        raise SettingsError(f"[{name}] must be a table of settings, not {table!r}")


def _converted(f: dataclasses.Field[Any], value: Any, cls: type[Section]) -> Any:
    kind = type(f.default)
    where = f"[{cls.table}] {f.name}"
    if issubclass(kind, Enum):
        choices = [choice.value for choice in kind]
        if value not in choices:
            raise SettingsError(f"{where} = {value!r}: choose one of {', '.join(choices)}")
        return kind(value)
    joined_by = f.metadata["joined_by"]
    if joined_by and isinstance(value, list) and all(isinstance(part, str) for part in value):
        return joined_by.join(value)
    return value


def _typed(kind: type, value: Any, where: str) -> Any:
    """A value of a type; whole numbers are taken for floats, and numbers of NumPy become Python's."""
    if not isinstance(value, NUMBERS.get(kind, kind)) or (isinstance(value, bool) and kind is not bool):
        raise SettingsError(f"{where} = {value!r}: expected {kind.__name__}")
    try:
        return kind(value) if kind in NUMBERS else value
    except OverflowError:
        return math.inf  # which the check refuses


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
