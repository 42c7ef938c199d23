# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders frames by Cycles on the CPU, as linear OpenEXR images: a rival, and the reference of a check."""

from __future__ import annotations

from typing import Any

import bpy

from enfilade_blender.job import Job
from enfilade_blender.notes import Notes, report_progress
from enfilade_blender.open_file import open_source


def render_frames(job: Job) -> dict[str, Any]:
    """Render ``job.frame_list`` into ``cycles-NNNN.exr``; content of ``cycles.json``.

    Data stays in memory from frame to frame. As in the exported scene, all is in focus, and the world is
    seen. With ``job.unbiased`` the file's clamping, filtered glossy and light threshold are off, and pixels
    are boxes. Limits of bounces stay the file's.
    """
    selection = open_source(job, Notes())
    scene = selection.scene
    render, cycles = scene.render, scene.cycles
    render.engine, cycles.device = "CYCLES", "CPU"
    render.use_persistent_data = True
    render.resolution_x, render.resolution_y = selection.size
    render.resolution_percentage = 100
    render.use_compositing = render.use_sequencer = render.use_motion_blur = False
    render.use_border = render.use_multiview = render.use_stamp = render.film_transparent = False
    settings = render.image_settings
    settings.file_format, settings.color_depth, settings.color_mode = "OPEN_EXR", "32", "RGB"
    cycles.film_exposure = 1.0  # as the exported scene; import.json has it in its exposure
    cycles.samples, cycles.seed = job.spp, job.seed
    cycles.use_layer_samples, cycles.time_limit = "IGNORE", 0.0
    cycles.use_adaptive_sampling, cycles.use_denoising = False, job.denoise
    if job.denoise:
        cycles.denoiser = "OPENIMAGEDENOISE"
    if job.unbiased:
        cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
        cycles.blur_glossy = cycles.light_sampling_threshold = 0.0
        cycles.pixel_filter_type = "BOX"
    for camera in bpy.data.cameras:
        camera.dof.use_dof = False
    for layer in scene.view_layers:
        layer.use = layer == selection.view_layer
    frames = job.frame_list or (selection.frames[0],)
    for number, frame in enumerate(frames):
        report_progress(number / len(frames), f"frame {frame}")
        scene.frame_set(frame)
        render.filepath = str(job.out / f"cycles-{frame:04d}.exr")
        bpy.ops.render.render(write_still=True, scene=scene.name)
    return {"spp": job.spp, "frames": list(frames)}
