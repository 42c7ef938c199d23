"""Scenes that several tests share."""

import pytest

from support.material_scene import MATERIALS, front_camera, opened_scene, traced_irradiance


@pytest.fixture(scope="session")
def materials(tmp_path_factory):
    """Balls of all materials, and the path traced irradiance of an image."""
    renderer = opened_scene(tmp_path_factory.mktemp("materials"), MATERIALS)
    return renderer, traced_irradiance(renderer, front_camera())[1]


@pytest.fixture(scope="session")
def diffuse(tmp_path_factory):
    """Diffuse balls, with the irradiance of two images: pairs of G-buffer and record."""
    balls = {"one": MATERIALS["diffuse"], "two": MATERIALS["diffuse"]}
    renderer = opened_scene(tmp_path_factory.mktemp("diffuse"), balls)
    return renderer, [traced_irradiance(renderer, front_camera(x=x)) for x in (-0.5, 0.5)]
