"""Import of .blend, glTF, USD, FBX and OBJ files by Blender, in a process of its own.

The scripts that run inside Blender are another package, ``enfilade_blender``, under the GPL. This one never
imports it: the two exchange files only (docs/blender.md).
"""
