"""Irradiance cached at keyframes; visibility, texture and specular lobes in every frame: the default."""

from enfilade.methods.decoupled.method import Decoupled

__all__ = ["Decoupled"]
