"""Radiance and irradiance by the integrator, and by path tracing, of whole images."""

import numpy as np

from enfilade.arrays import opaque
from enfilade.camera.pinhole import Camera
from enfilade.kernels.estimate import Estimate
from enfilade.methods.decoupled.irradiance_cache import IrradianceCache, upload
from enfilade.records import Shading
from enfilade.renderer import PixelFilter, Purpose, RandomKey
from support.material_scene import camera_paths, front_camera, integrator_of, pixels_of

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
EMPTY = IrradianceCache()


def shaded(renderer, irradiance: IrradianceCache, camera: Camera, spp: int, **more) -> Shading:
    """Diffuse and specular radiance together."""
    integrator = integrator_of(renderer)

    def radiance(rays, sampler):
        path = camera_paths(rays, sampler)
        diffuse = integrator.diffuse_radiance(irradiance, path).layers[0]
        specular = integrator.specular_radiance(irradiance, path)
        return diffuse + sum(specular.layers)

    return estimated(radiance, camera, spp, **more)[0]


def gathered(renderer, irradiance: IrradianceCache, camera: Camera, spp: int, **more) -> list[Shading]:
    """Irradiance by final gathering, direct and indirect."""

    def radiance(rays, sampler):
        return integrator_of(renderer).final_gather(irradiance, camera_paths(rays, sampler))

    return estimated(radiance, camera, spp, layers=2, **more)


def estimated(
    radiance, camera, spp, *, layers=1, paths_in_flight=1 << 20, pixel_filter=PixelFilter.CENTRE, pixels=None
):
    estimate = Estimate(
        camera,
        pixels_of(camera)[:pixels],
        radiance,
        paths_in_flight=paths_in_flight,
        pixel_filter=pixel_filter,
        random=RandomKey(2, 0, Purpose.DIFFUSE),
        layers=layers,
    )
    estimate.add(spp)
    return estimate.shadings


def traced(renderer, camera: Camera, spp: int) -> Shading:
    return renderer.trace(camera, pixels_of(camera), RandomKey(1, 0, Purpose.REFERENCE), spp=spp)


def cache_of(*images) -> IrradianceCache:
    return cache_of_uploaded([upload(*image) for image in images])


def cache_of_uploaded(images, weights=None, **more) -> IrradianceCache:
    own = [1.0] * len(images) if weights is None else weights
    return IrradianceCache(images=tuple(images), weights=tuple(map(opaque, own)), **more)


def standard_errors(ours: Shading, reference: Shading, where=slice(None)) -> float:
    """Difference of energy, in standard errors."""
    difference = ((ours.color.reshape(-1, 3) - reference.color.reshape(-1, 3)) @ LUMINANCE)[where].sum()
    variance = ours.variance.ravel() + reference.variance.ravel()
    return float(difference / np.sqrt(variance[where].sum()))


def assert_same_in_batches(renderer, irradiance: IrradianceCache) -> None:
    """The image is the same with all samples at once, and in batches of which the last is smaller."""
    one, many = (
        shaded(
            renderer,
            irradiance,
            front_camera(24, 18),
            4,
            paths_in_flight=paths_in_flight,
            pixel_filter=PixelFilter.GAUSSIAN,
        )
        for paths_in_flight in (1 << 20, 600)
    )
    np.testing.assert_array_equal(one.color, many.color)
