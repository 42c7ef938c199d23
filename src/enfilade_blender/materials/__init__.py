# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's material nodes, read, and written as BSDFs of Mitsuba."""
