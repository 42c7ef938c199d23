"""Stands for Blender in tests: answers --version, and does what its source file says in place of an import.

The source file is JSON: ``{"do": "export"}``, or one of the failures below. Other keys replace those of
``import.json``. The standard library only: it runs without the environment of the tests.
"""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

SCENE = """<scene version="3.0.0">
  <integrator type="path"/>
  <shape type="sphere" id="ball"><point name="center" x="0" y="0" z="-4"/></shape>
  <emitter type="constant"/>
</scene>"""
NOTE = {
    "object": "Sofa",
    "node": "Noise Texture",
    "what": "a procedural texture",
    "effect": "the sofa is plain",
}
RESULT = {
    "format": "enfilade-import",
    "version": 1,
    "blender": "4.5.1",
    "scene": "Scene",
    "camera": "Cam",
    "fps": 24.0,
    "frames": [11, 13],
    "size": [64, 48],
    "exposure_ev": 0.5,
    "view": {"display": "sRGB", "view_transform": "Standard", "look": "None"},
    "counts": {"objects": 3, "instances": 4, "triangles": 500, "materials": 2, "textures": 1},
    "notes": [],
    "files": [],
}


def say(text):
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def pose(x):
    return [1, 0, 0, x, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]


def camera_path(table):
    first, last = table["frames"]
    cameras = [{"camera_to_world": pose(0.02 * i), "fov": 50} for i in range(last - first + 1)]
    width, height = table["size"]
    size = {"render_width": width, "render_height": height}
    return {
        "camera_type": "perspective",
        **size,
        "fps": table["fps"],
        "first_frame": first,
        "camera_path": cameras,
    }


def export(job, wish):
    out = Path(job["out"])
    table = {**RESULT, **{key: value for key, value in wish.items() if key in RESULT}}
    table["source"] = Path(job["source"]).name
    table["size"] = job["size"] or table["size"]
    table["frames"] = job["frames"] or table["frames"]
    if job["camera"]:
        table["camera"] = job["camera"]
    say("progress: 0.5 meshes")
    (out / "scene.xml").write_text(wish.get("xml", SCENE))
    if table["camera"]:
        (out / "camera_path.json").write_text(json.dumps(camera_path(table)))
    if "echo" in wish:
        (out / "seen.json").write_text(json.dumps({"job": job, "environ": dict(os.environ)}))
    (out / "import.json").write_text(json.dumps(table))


def render(job, wish):
    """Copy the images of ``wish["cycles"]``, a folder with one folder a seed."""
    images = Path(wish["cycles"]) / str(job["seed"])
    for number in job["frame_list"]:
        shutil.copy(images / f"{number}.exr", Path(job["out"]) / f"cycles-{number:04d}.exr")
    (Path(job["out"]) / "cycles.json").write_text(json.dumps({"frames": job["frame_list"]}))


def write_program(file):
    """A program that runs this file with this Python; returns its path."""
    file.write_text(f'#!/bin/sh\nexec "{sys.executable}" -I "{__file__}" "$@"\n')
    file.chmod(0o755)
    return file


def main():
    if sys.argv[1:] == ["--version"]:
        say("Blender 4.5.1 LTS\n\tbuild date: never")
        return 0
    job = json.loads(Path(sys.argv[-1]).read_text())
    wish = json.loads(Path(job["source"]).read_text())
    Path(job["source"]).with_suffix(".calls").open("a").write(f"{os.getpid()}\n")
    if job["task"] == "cycles":
        render(job, wish)
        return 0
    match wish.get("do", "export"):
        case "export":
            export(job, wish)
        case "hang after":
            export(job, wish)
            time.sleep(600)
        case "leave a process":
            export(job, wish)
            line = ["/bin/sh", "-c", 'sleep 60; : > "$0"', str(Path(job["source"]).with_suffix(".ended"))]
            left = subprocess.Popen(line, start_new_session=True)  # noqa: S603
            (Path(job["out"]) / "left.pid").write_text(str(left.pid))
        case "hang":
            say("Fra:1 still at it")
            time.sleep(600)
        case "crash":
            say("Read blend: shot.blend\nError: \x1b[31mno memory")
            os.kill(os.getpid(), signal.SIGSEGV)
        case "eat":
            _ = bytearray(4 << 30)
        case "refuse":
            error = {"what": "it is cut off", "where": "block DATA", "do": "save it again"}
            (Path(job["out"]) / "error.json").write_text(json.dumps(error))
            return 3
        case "nothing":
            return 0
    return 0


if __name__ == "__main__":
    sys.exit(main())
