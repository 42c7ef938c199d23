# SPDX-License-Identifier: GPL-3.0-or-later
"""Small Blender files, each of one kind of material, light or object. They are made inside Blender's
Python."""
