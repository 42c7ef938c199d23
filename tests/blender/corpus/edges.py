# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials that are easily lost: one plane of each."""

import bpy
import numpy as np

from corpus.stage import image, new_file, node_of, plane, principled, shader


def uncommon_materials(folder):
    new_file()
    half = image("half", _grey, 16, alpha=lambda x, _y: np.where(x < 0.5, 1.0, 0.5))
    makers = (_cut_out, _see_through, _sheer_gloss, _bumpy_plastic)
    materials = [make(half) for make in makers]
    materials.append(principled("premultiplied", **{"Base Color": half, "Metallic": 1.0}))
    inputs = {"Emission Color": (1, 1, 1, 1), "Emission Strength": 4.0, "Alpha": 0.25}
    materials.append(principled("faint glow", **inputs))
    (folder / "picture.png").write_bytes(half.packed_file.data)
    materials.append(
        principled("picture", **{"Base Color": bpy.data.images.load(str(folder / "picture.png"))})
    )
    for number, material in enumerate(materials):
        plane(material.name, (2.0 * number, 0.0, 0.0), 1.5, material)


def _grey(x, _y):
    return np.full((*x.shape, 3), 0.8)


def _cut_out(picture):
    """The opacity is 1 minus a corrected image, which is baked."""
    material, tree, mix = shader("cut out", "ShaderNodeMixShader")
    tree.links.new(node_of(tree, "ShaderNodeBsdfDiffuse").outputs[0], mix.inputs[1])
    tree.links.new(node_of(tree, "ShaderNodeBsdfTransparent").outputs[0], mix.inputs[2])
    texture, gamma = tree.nodes.new("ShaderNodeTexImage"), node_of(tree, "ShaderNodeGamma", Gamma=2.0)
    texture.image = picture
    tree.links.new(texture.outputs["Color"], gamma.inputs[0])
    tree.links.new(gamma.outputs[0], mix.inputs[0])
    return material


def _see_through(_picture):
    return shader("see-through", "ShaderNodeBsdfTransparent", Color=(0.2, 0.5, 0.9, 1))[0]


def _sheer_gloss(_picture):
    material, tree, total = shader("sheer gloss", "ShaderNodeAddShader")
    for number, kind in enumerate(("ShaderNodeBsdfTransparent", "ShaderNodeBsdfAnisotropic")):
        tree.links.new(node_of(tree, kind).outputs[0], total.inputs[number])
    return material


def _bumpy_plastic(picture):
    material, tree, mix = shader("bumpy plastic", "ShaderNodeMixShader")
    matt, gloss = (
        node_of(tree, "ShaderNodeBsdfDiffuse"),
        node_of(tree, "ShaderNodeBsdfAnisotropic", Color=(1.0, 0.5, 0.5, 1), Roughness=0.2),
    )
    texture, bump = tree.nodes.new("ShaderNodeTexImage"), tree.nodes.new("ShaderNodeBump")
    texture.image = picture
    tree.links.new(texture.outputs["Color"], bump.inputs["Height"])
    tree.links.new(bump.outputs[0], matt.inputs["Normal"])
    tree.links.new(node_of(tree, "ShaderNodeFresnel", IOR=1.5).outputs[0], mix.inputs[0])
    tree.links.new(matt.outputs[0], mix.inputs[1])
    tree.links.new(gloss.outputs[0], mix.inputs[2])
    return material


CASES = (uncommon_materials,)
