# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads a Blender file inside Blender's Python, and writes a Mitsuba scene, a camera path, and notes.

A program of its own: it talks to enfilade by files only (``__main__.py``), and imports neither it nor
Mitsuba.
"""
