# SPDX-License-Identifier: GPL-3.0-or-later
"""A panel that renders the open file by the command ``enfilade``, with its progress and its report."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

import bpy

from .command import Order, Process, next_run, wrapped

LOOK_S = 0.5
LETTER_PX = 7.0  # width of a letter of labels
running: Process | None = None  # of this session; Blender has one panel


class EnfiladePreferences(bpy.types.AddonPreferences):
    """Where the command is."""

    bl_idname = __package__

    command: bpy.props.StringProperty(
        name="Command", description="The program enfilade", default="enfilade", subtype="FILE_PATH"
    )

    def draw(self, _context: Any) -> None:
        """Show the setting."""
        self.layout.prop(self, "command")


class EnfiladeSettings(bpy.types.PropertyGroup):
    """Settings of a scene."""

    run: bpy.props.StringProperty(
        name="Run folder", description="Frames, video and report", default="//enfilade/", subtype="DIR_PATH"
    )
    quality: bpy.props.FloatProperty(
        name="Quality",
        description="Noise that may remain: lower is better and costs more",
        default=10.0,
        min=0.5,
        max=100.0,
    )


def command_of(context: Any) -> str:
    """The program of the preferences."""
    found = context.preferences.addons.get(__package__)
    command = found.preferences.command if found and found.preferences else "enfilade"
    return str(bpy.path.abspath(command))


def run_folder(context: Any) -> Path:
    """The run folder of the scene."""
    return Path(bpy.path.abspath(context.scene.enfilade.run))


class EnfiladeRender(bpy.types.Operator):
    """Render the animation of the saved file; the same folder continues an interrupted run."""

    bl_idname = "enfilade.render"
    bl_label = "Render walkthrough"

    is_new: bpy.props.BoolProperty(
        name="New run", description="Render into the next free folder, as after a change of the file"
    )

    @classmethod
    def poll(cls, _context: Any) -> bool:
        """One at a time."""
        return running is None

    def execute(self, context: Any) -> set[str]:
        """Start the command."""
        global running  # noqa: PLW0603  (Blender makes operators anew)
        is_changed = bpy.data.is_dirty and not bpy.app.background  # where it is always true
        if is_changed or not bpy.data.filepath:
            self.report({"ERROR"}, "Save the file first: it is rendered from the disk")
            return {"CANCELLED"}
        settings = context.scene.enfilade
        if self.is_new:
            new = str(next_run(run_folder(context)))
            settings.run = bpy.path.relpath(new) if settings.run.startswith("//") else new
        order = Order(
            command=command_of(context),
            source=Path(bpy.data.filepath),
            run=run_folder(context),
            quality=settings.quality,
            scene=context.scene.name,
            blender=bpy.app.binary_path,
        )
        try:
            running = Process(order.line())
        except OSError as error:
            self.report({"ERROR"}, f"{order.command}: {error.strerror}; give the program in the preferences")
            return {"CANCELLED"}
        bpy.app.timers.register(watch, first_interval=LOOK_S, persistent=True)  # opening a file keeps it
        return {"FINISHED"}


class EnfiladeStop(bpy.types.Operator):
    """End the command; finished frames stay."""

    bl_idname = "enfilade.stop"
    bl_label = "Stop"

    def execute(self, _context: Any) -> set[str]:
        """End it."""
        if running is not None:
            running.end()
        return {"FINISHED"}


class EnfiladeReport(bpy.types.Operator):
    """Write the report of the run, and open it in the browser."""

    bl_idname = "enfilade.report"
    bl_label = "Open report"

    def execute(self, context: Any) -> set[str]:
        """Write and open the page."""
        run = run_folder(context)
        line = [command_of(context), "report", str(run), "--quiet"]
        try:
            done = subprocess.run(line, capture_output=True, text=True, check=False)  # noqa: S603
        except OSError as error:
            self.report({"ERROR"}, f"{line[0]}: {error.strerror}; give the program in the preferences")
            return {"CANCELLED"}
        if done.returncode:
            self.report({"ERROR"}, done.stderr.strip())
            return {"CANCELLED"}
        bpy.ops.wm.url_open(url=(run / "report.html").as_uri())
        return {"FINISHED"}


class EnfiladePanel(bpy.types.Panel):
    """In the output properties."""

    bl_idname = "RENDER_PT_enfilade"
    bl_label = "enfilade"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "output"
    message = ""  # of the last run

    def draw(self, context: Any) -> None:
        """Show settings, or progress."""
        layout = self.layout
        layout.use_property_split = True
        layout.prop(context.scene.enfilade, "run")
        layout.prop(context.scene.enfilade, "quality")
        if running is None:
            layout.operator("enfilade.render").is_new = False
            layout.operator("enfilade.render", text="Begin a new run").is_new = True
            layout.operator("enfilade.report")
        else:
            layout.progress(factor=running.fraction, text=running.stage)
            layout.operator("enfilade.stop")
        width = context.region.width / (LETTER_PX * context.preferences.system.ui_scale)
        for line in wrapped(EnfiladePanel.message, int(width)):
            layout.label(text=line)


def watch() -> float | None:
    """Take the progress of the command, and redraw; returns the seconds until the next call, or None."""
    global running  # noqa: PLW0603
    if running is None:
        return None
    running.poll()
    if running.code is not None:
        EnfiladePanel.message = "finished" if running.code == 0 else running.message
        running = None
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "PROPERTIES":
                area.tag_redraw()
    return None if running is None else LOOK_S


CLASSES = (
    EnfiladePreferences, EnfiladeSettings, EnfiladeRender, EnfiladeStop, EnfiladeReport, EnfiladePanel,
)  # fmt: skip


def register() -> None:
    """Called by Blender when the add-on is enabled."""
    for one in CLASSES:
        bpy.utils.register_class(one)
    bpy.types.Scene.enfilade = bpy.props.PointerProperty(type=EnfiladeSettings)


def unregister() -> None:
    """Called by Blender when the add-on is disabled; a command that runs is ended."""
    if running is not None:
        running.end()
    if bpy.app.timers.is_registered(watch):
        bpy.app.timers.unregister(watch)
    del bpy.types.Scene.enfilade
    for one in reversed(CLASSES):
        bpy.utils.unregister_class(one)
