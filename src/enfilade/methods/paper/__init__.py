"""Myszkowski, Rokita and Tawara 2000: keyframes, reprojected in-betweens, perceptual refinement (§4, §5)."""

from enfilade.methods.paper.method import Paper

__all__ = ["Paper"]
