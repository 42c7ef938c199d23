# SPDX-License-Identifier: GPL-3.0-or-later
"""Constants in place of nodes of a tree that Cycles renders for the exporter."""

from __future__ import annotations

from typing import Any

BLACK = (0.0, 0.0, 0.0, 1.0)


def cut_light_path(tree: Any) -> None:
    """Replace the outputs of Light Path by 0, in copies of groups, too."""
    for node in list(tree.nodes):
        if node.type == "GROUP" and node.node_tree is not None:
            node.node_tree = node.node_tree.copy()
            cut_light_path(node.node_tree)
        elif node.type == "LIGHT_PATH":
            _replace(tree, node, BLACK)


def _replace(tree: Any, node: Any, colour: tuple[float, ...]) -> None:
    """Link a colour where the outputs of a node are linked."""
    constant = tree.nodes.new("ShaderNodeRGB")
    constant.outputs[0].default_value = colour
    for socket in [link.to_socket for link in tree.links if link.from_node == node]:
        tree.links.new(constant.outputs[0], socket)
