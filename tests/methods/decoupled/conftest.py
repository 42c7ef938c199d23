"""What several tests of the irradiance cache share."""

import pytest

from balls import MATERIALS, front_camera, opened_scene, traced_page


@pytest.fixture(scope="module")
def diffuse(tmp_path_factory):
    """Diffuse balls, with the light of two pages."""
    renderer = opened_scene(
        tmp_path_factory.mktemp("diffuse"), {"one": MATERIALS["diffuse"], "two": MATERIALS["diffuse"]}
    )
    pages = [traced_page(renderer, front_camera(x=x)) for x in (-0.5, 0.5)]
    return renderer, pages
