"""Irradiance cached at keyframes; visibility, texture and specular lobes in every frame: the default.

The modules in the order of the passes of `method.py`:

* of all passes: `shot` (caches and weights near a frame), `integrator` with `path_kernels`, `paths` and
  `cache_query`, `irradiance_cache` with `surface_image` and `image_store`, `light_camera`, `sample_counts`
* `prepass`: rough irradiance; `guiding`: a path guide, where bright surfaces light the scene
* `hash_grid_fill`: surfaces that no image shows (`hash_grid`), then those in mirrors (`virtual_images`,
  `virtual_irradiance`)
* `irradiance`: final gathering at keyframes and where they are disoccluded, `denoising`, `wavelet`
* `shading`: camera rays (`adaptive_sampling`, `edges`, `reconstruction`, `sharp_shadows`), and specular rays
  of every frame (`specular_rays`, `surface_edges`, `specular_filter`)
* `temporal`: accumulation over time, and delivered frames
"""

from enfilade.methods.decoupled.method import Decoupled

__all__ = ["Decoupled"]
