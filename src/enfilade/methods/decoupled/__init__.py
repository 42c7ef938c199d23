"""Irradiance cached at keyframes, visibility and texture afresh in every frame: the default method."""

from enfilade.methods.decoupled.method import Decoupled

__all__ = ["Decoupled"]
