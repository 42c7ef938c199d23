# SPDX-License-Identifier: GPL-3.0-or-later
"""Constants in place of nodes of a tree that Cycles renders for the exporter."""

from __future__ import annotations

from typing import Any

from enfilade_blender.materials.image_pixels import is_missing

NO_RAY, MISSING = (0.0, 0.0, 0.0, 1.0), (0.5, 0.5, 0.5, 1.0)
IMAGES = ("TEX_IMAGE", "TEX_ENVIRONMENT")


def put_stand_ins(tree: Any) -> list[Any]:
    """Replace Light Path by 0 and missing images by grey, in copies of groups, too; nodes of such images."""
    missing = []
    for node in list(tree.nodes):
        if node.type == "GROUP" and node.node_tree is not None:
            node.node_tree = node.node_tree.copy()
            missing += put_stand_ins(node.node_tree)
        elif node.type == "LIGHT_PATH":
            _replace(tree, node, NO_RAY)
        elif node.type in IMAGES and is_missing(node.image, node.image_user):
            _replace(tree, node, MISSING)
            missing.append(node)
    return missing


def _replace(tree: Any, node: Any, colour: tuple[float, ...]) -> None:
    """Link a colour where the outputs of a node are linked."""
    constant = tree.nodes.new("ShaderNodeRGB")
    constant.outputs[0].default_value = colour
    for socket in [link.to_socket for link in tree.links if link.from_node == node]:
        tree.links.new(constant.outputs[0], socket)
