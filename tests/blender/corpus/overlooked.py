# SPDX-License-Identifier: GPL-3.0-or-later
"""A file of settings, nodes and objects that an exporter can overlook."""

from corpus.stage import new_file, plane, principled, world


def overlooked(_folder):
    scene = new_file()
    _filtered(scene)
    scene.cycles.diffuse_bounces = 1  # of glossy ones there are 4
    plane("Floor", (0.0, 0.0, 0.0), 4.0, principled("floor"))


def _filtered(scene):
    """A view layer that leaves out the world and, says its switch, surfaces."""
    world((5.0, 5.0, 5.0))
    layer = scene.view_layers[0]
    layer.use_sky = layer.use_solid = False
