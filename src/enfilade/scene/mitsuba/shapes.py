"""Tables of a Mitsuba scene's shapes and BSDFs, by their indices in Dr.Jit's registry."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from enfilade.arrays import Bool, UInt, lanes
from enfilade.records import SurfaceClass
from enfilade.scene.mitsuba.integrators import has_media
from enfilade.scene.mitsuba.merge import MergedScene

LAMP = "lamp"  # id of the `null` BSDF of emitters that the camera does not see, as in Blender's Cycles
HIDDEN = "hidden from the camera"  # with this begin the ids of BSDFs of other surfaces that it does not see


class Shapes:
    """The shapes of a scene's file.

    Parameters
    ----------
    merged
    hides_emitters
        Whether the camera sees no emitters.

    Attributes
    ----------
    names : tuple of str
        Of shapes 1, 2, ...
    may_be_null : bool
        Whether camera rays pass any surface: null interactions, thin glass apart, and hidden surfaces.
    has_hidden : bool
        Whether there are lamps or hidden surfaces. Camera rays pass them, but for scenes with participating
        media.
    hides_emitters : bool
        Whether camera rays pass all emitters, and meet a black background.
    """

    def __init__(self, merged: MergedScene, *, hides_emitters: bool = False) -> None:
        scene = merged.scene
        shapes = scene.shapes()
        registry = [registry_index(mi.ShapePtr(shape)) for shape in shapes]
        sizes = [len(source) for source in merged.sources]
        first, count = np.zeros((2, max(registry) + 1), np.uint32)
        first[registry] = np.cumsum([0, *sizes[:-1]])
        count[registry] = sizes
        self._index = lanes(np.concatenate([*merged.sources, [0]]).astype(np.uint32))  # two lanes at least
        self._first, self._last = lanes(first), lanes(np.maximum(count, 1) - np.uint32(1))
        self._bsdfs = mi.BSDFPtr([shape.bsdf() for shape in shapes])
        self._is_null = bsdf_table(scene, has_null_interactions)
        lamps = np.zeros(max(registry) + 1, bool)
        is_clear = not has_media(scene)
        lamps[registry] = [is_clear and is_lamp(shape) for shape in shapes]
        self._is_lamp = lanes(lamps)
        self._is_hidden = bsdf_table(scene, lambda bsdf: is_clear and bsdf.id().startswith(HIDDEN))
        self.names = merged.names
        has_hidden = bool(dr.any(self._is_hidden))
        self.hides_emitters = is_clear and hides_emitters
        self.may_be_null = bool(dr.any(self._is_null)) or has_hidden or self.hides_emitters
        self.has_hidden = bool(lamps.any()) or has_hidden or self.hides_emitters

    @property
    def state(self) -> Any:
        """Arrays that the methods read, and all BSDFs, which makes Dr.Jit consider those of no shape, too."""
        passed = self._is_null, self._is_lamp, self._is_hidden
        return self._index, self._first, self._last, passed, self._bsdfs

    def index(self, si: Any) -> Any:
        """Index of the shape that is hit, from 1; an instance is a shape. 0 for a miss; UInt."""
        number = self._number(si)
        first = dr.gather(UInt, self._first, number, si.is_valid())
        last = dr.gather(UInt, self._last, number, si.is_valid())
        return dr.gather(UInt, self._index, first + dr.minimum(si.prim_index, last), si.is_valid())

    def is_lamp(self, si: Any) -> Any:
        """Whether a hit is one of a lamp; Bool."""
        return dr.gather(Bool, self._is_lamp, self._number(si), si.is_valid())

    def _number(self, si: Any) -> Any:
        """Index in the registry of the shape that is hit, or of the instance whose shape it is; UInt."""
        shape: Any = dr.reinterpret_array(mi.UInt32, si.shape)
        instance: Any = dr.reinterpret_array(mi.UInt32, si.instance)
        return dr.select(instance != 0, instance, shape)

    def is_null(self, si: Any, transmittance: float) -> Any:
        """Whether camera rays pass a hit: it is hidden, or transmits more than this share of light; Bool.

        They pass emitters that are lamps or hidden alone: the light of others would be lost.
        """
        bsdf = si.bsdf()
        number: Any = dr.reinterpret_array(mi.UInt32, bsdf)
        is_null = dr.gather(Bool, self._is_null, number, si.is_valid())
        transmitted = bsdf.eval_null_transmission(si, is_null)
        is_dark = ~si.shape.is_emitter() | self.is_lamp(si)
        is_hidden = dr.gather(Bool, self._is_hidden, number, si.is_valid())
        if self.hides_emitters:
            is_hidden |= si.is_valid() & si.shape.is_emitter()
        return is_hidden | (is_null & is_dark & (mi.luminance(transmitted) > transmittance))


def is_lamp(shape: Any) -> bool:
    """Whether a shape gives light but is no surface: an emitter whose BSDF is :data:`LAMP`."""
    bsdf = shape.bsdf()
    return bool(shape.is_emitter() and bsdf.class_name() == "Null" and bsdf.id() == LAMP)


def has_meaning(bsdf_id: str) -> bool:
    """Whether the id of a BSDF says what the camera sees of its shapes."""
    return bsdf_id == LAMP or bsdf_id.startswith(HIDDEN)


def has_null_interactions(bsdf: Any) -> bool:
    """Whether a BSDF has null interactions: masks, and blends with a null lobe; thin glass is visible."""
    if not mi.has_flag(bsdf.flags(), mi.BSDFFlags.Null):
        return False
    nested = {node.class_name() for node in mi.traverse(bsdf).hierarchy}
    return bsdf.class_name() == "MaskBSDF" or "ThinDielectric" not in nested


def bsdf_table(scene: Any, value: Callable[[Any], Any], kind: Any = Bool) -> Any:
    """A value of all BSDFs of a scene, nested ones and those of instances included, by registry index.

    Parameters
    ----------
    scene : mitsuba.Scene
    value
        Of a BSDF.
    kind
        Bool, UInt or Float.
    """
    bsdfs = [node for node in mi.traverse(scene).hierarchy if isinstance(node, mi.BSDF)]
    registry = [registry_index(mi.BSDFPtr(bsdf)) for bsdf in bsdfs]
    table = np.array(kind(0)).repeat(max(registry, default=0) + 1)
    table[registry] = [value(bsdf) for bsdf in bsdfs]
    return lanes(table)


def bsdfs_of_shapes(scene: Any) -> list[Any]:
    """BSDFs of a scene that are not nested in others."""
    hierarchy = mi.traverse(scene).hierarchy.items()
    bsdfs = [(node, parent) for node, (parent, _) in hierarchy if isinstance(node, mi.BSDF)]
    return [node for node, parent in bsdfs if not isinstance(parent, mi.BSDF)]


def surface_class(flags: Any, is_narrow: Any, is_emitter: Any, is_hit: Any) -> Any:
    """``records.SurfaceClass`` of a BSDF with these flags, whose lobes may all show images; UInt."""
    refracts = has_lobe(flags, "DeltaTransmission", "GlossyTransmission")
    mirrors = has_lobe(flags, "DeltaReflection") | is_narrow
    is_glossy = has_lobe(flags, "GlossyReflection") & ~is_narrow
    is_broad = is_glossy | (has_lobe(flags, "DiffuseReflection", "DiffuseTransmission") & ~is_narrow)
    is_thin_glass = has_lobe(flags, "Null") & mirrors & ~is_broad

    surface = UInt(SurfaceClass.DIFFUSE)
    surface = dr.select(is_emitter, UInt(SurfaceClass.EMISSIVE), surface)
    surface = dr.select(is_glossy | mirrors, UInt(SurfaceClass.GLOSSY), surface)
    surface = dr.select(mirrors & ~is_broad, UInt(SurfaceClass.MIRROR), surface)
    surface = dr.select(refracts | is_thin_glass, UInt(SurfaceClass.TRANSPARENT), surface)
    return dr.select(is_hit, surface, UInt(SurfaceClass.NONE))


def has_lobe(flags: Any, *lobes: str) -> Any:
    """Whether a BSDF has any of these lobes, by their names in Mitsuba's ``BSDFFlags``; Bool."""
    return (flags & sum(int(getattr(mi.BSDFFlags, lobe)) for lobe in lobes)) != 0


def registry_index(pointer: Any) -> int:
    """Number of an object in Dr.Jit's registry, by a pointer to it such as ``BSDFPtr``."""
    index: Any = dr.reinterpret_array(mi.UInt32, pointer)
    return int(index[0])
