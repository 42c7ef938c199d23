"""Fidelity of scenes that are imported from Blender, against Cycles."""
