"""Synthetic runs, summaries and plans, with values like those of the paper's Figs. 12 and 13."""

import math

import numpy as np

from enfilade.files import write_json
from enfilade.images import write_exr
from enfilade.records import Provenance
from enfilade.runs.folder import RunFolder
from enfilade.settings import Settings, VideoSettings

SIZE = (64, 48)
FRAMES = tuple(range(1, 11))


def synthetic_summary(count=120, *, spacing=20, method="paper"):
    """Summary of a run: of `paper` with segments, of `decoupled` with rays, of `reference` with neither."""
    per_frame = []
    for i in range(count):
        speed = abs(6.0 * math.sin(i / 17.0)) + 0.3
        shares = {"slow": 0.0, "specular": 0.0, "disoccluded": 0.0, "keyframe": 100.0}
        if method != "reference" and i % spacing and i != count - 1:
            shares = {"slow": max(0.0, 60.0 - 40.0 * speed), "specular": 8.0 + 4.0 * math.cos(i / 9.0)}
            shares |= {"disoccluded": 1.5, "keyframe": 0.0}
        row = {"frame": i + 1, "velocity_deg_s": speed, **shares, "traced": sum(shares.values())}
        per_frame.append(row)
    return {
        "method": method,
        "frames": count,
        "size": [640, 480],
        "fps": 30.0,
        "video": "video.mp4",
        "traced_percent": {
            "slow": 20.0,
            "specular": 7.9,
            "disoccluded": 0.43,
            "keyframe": 5.8,
            "total": 34.13,
        },
        "time_s": {
            "total_s": 240.0,
            "per_frame_s": 2.0,
            "cpu_s": 430.0,
            "stages": {
                "trace": {"wall_s": 60.0, "cpu_s": 110.0},
                "final_gather": {"wall_s": 150.0, "cpu_s": 290.0},
                "frames": {"wall_s": 29.96, "cpu_s": 29.9},
                "video": {"wall_s": 0.04, "cpu_s": 0.1},
            },
        },
        "per_frame": per_frame,
        **_rays(count if method == "decoupled" else 0, spacing),
        "segments": _segments(count, spacing) if method == "paper" else [],
        "dropped_samples": 0,
    }


def _rays(count, spacing):
    rows = [
        {
            "frame": i + 1,
            "camera": 12.5,
            "specular": 0.0,
            **({"irradiance": 40.0} if i % spacing == 0 else {}),
        }
        for i in range(count)
    ]
    kinds = ("irradiance", "camera", "specular") if rows else ()
    return {
        "rays": {k: sum(row.get(k, 0.0) for row in rows) / count for k in kinds},
        "rays_per_frame": rows,
    }


def _segments(count, spacing):
    made = []
    for first in range(1, count, spacing):
        last = min(first + spacing, count)
        is_split = first == 1 + 2 * spacing
        made.append(_segment(first, last, 14.0 if is_split else 3.0 + first / 30.0, is_split, 0))
        if is_split:
            middle = (first + last) // 2
            made += [_segment(first, middle, 4.0, False, 1), _segment(middle, last, 6.0, False, 1)]
    return made


def _segment(first, last, visible, is_split, depth):
    return {
        "first": first,
        "last": last,
        "middle": (first + last) // 2,
        "percent_visible": visible,
        "percent_visible_no_pursuit": 0.4 * visible,
        "is_split": is_split,
        "depth": depth,
    }


def synthetic_plan(count=60, *, method="paper"):
    """A plan: of `decoupled` with rays."""
    speed = [abs(6.0 * math.sin(i / 17.0)) + 0.3 for i in range(count)]
    return {
        "method": method,
        "frames": list(range(1, count + 1)),
        "mean_speed_deg_s": speed,
        "slow_percent": [max(0.0, 60.0 - 40.0 * v) for v in speed],
        "specular_percent": [8.0] * count,
        "keyframes": [1, 21, 41, 60],
        "tasks": {"keyframes": 4, "frames": count},
        "seconds": 512.25,
        "cpu_seconds": 1000.0,
        "traced_percent": {"slow": 15.0, "specular": 7.5, "disoccluded": 1.5, "keyframe": 7.5, "total": 31.5},
        "rays": {"final_gather": 12.0, "camera": 3.0} if method == "decoupled" else {},
        "excerpt_frames": 9,
        "excerpt_size": [365, 274],
    }


def synthetic_run(
    folder, *, noise=0.0, finished=None, has_video=True, metadata=None, layers=None, **identity
):
    """Write the run folder of a user's method with the passes ``probe`` and ``frames``.

    Parameters
    ----------
    noise
        Standard deviation of the result, whose mean does not depend on it.
    finished
        Numbers of the finished frames; by default all.
    metadata
        Of each task of ``probe``, in place of its rays.
    layers
        Of the files; by default all.
    identity
        Replaced parts of the identity.
    """
    path = {"size": list(SIZE), "fps": 24.0, "frames": list(FRAMES), "cuts": [6], "poses": "0123"}
    known = {
        "enfilade": "0.1.0",
        "method": {"name": "mine", "revision": 1},
        "scene": {"renderer": "mine:open", "variant": "llvm", "fingerprint": "abcd"},
        "path": path,
        "settings": {"probe": {"count": 3}, "trace": {"seed": 7, "max_depth": 0}},
    }
    random = np.random.default_rng(1)
    with RunFolder.create(folder, {**known, **identity}) as run:
        job = {"scene": {"file": "scene.xml"}, "settings": Settings().to_tables()}
        write_json(folder / "job.json", job)
        analysis = [{"speed_px": 0.5 * number} for number in FRAMES]
        _finish(run, "analysis", FRAMES[0], {"frames": analysis})
        for number in FRAMES if finished is None else finished:
            _finish(run, "probe", number, metadata or {"rays": {"probe_rays": 2 * SIZE[0] * SIZE[1]}})
            made = _layers(number, random.normal(0.0, noise, (SIZE[1], SIZE[0], 1)))
            kept = made if layers is None else {name: made[name] for name in layers}
            file = run.stem("frames", number).with_suffix(".exr")
            write_exr(file, kept)
            of = made["provenance"]
            counts = {p.name.lower(): int((of == p).sum()) for p in Provenance}
            _finish(run, "frames", number, {"provenance": counts}, [file])
        if finished is None and has_video:
            (folder / "video.mp4").write_bytes(b"a video")
            table = VideoSettings().to_table()
            encoded = {
                "video": {name: table[name] for name in table if name != "ocio"} | {"exposure_ev": 0.0}
            }
            _finish(run, "video", FRAMES[0], encoded, [folder / "video.mp4"])
    return folder


def _finish(run, name, number, metadata, files=()):
    cost = {"gbuffer": {"wall_s": 0.25, "cpu_s": 0.5}, name: {"wall_s": 0.5, "cpu_s": 1.0}}
    run.finish({"pass": name, "frame": number, **metadata, "files": run.record_of(files), "cost": cost})


def _layers(number, noise):
    """A pattern that moves by two pixels a frame."""
    y, x = np.mgrid[: SIZE[1], : SIZE[0]]
    wave = 0.3 + 0.2 * np.sin((x + 2.0 * number) / 5.0) * np.cos(y / 7.0)
    provenance = np.full(wave.shape, Provenance.REUSED, np.uint32)
    provenance[:, :9], provenance[:12, 9:] = Provenance.DISOCCLUDED, Provenance.SPECULAR
    if number in (FRAMES[0], FRAMES[-1]):
        provenance[:] = Provenance.KEYFRAME
    flow = np.stack([np.full(wave.shape, 2.0), np.zeros(wave.shape)], axis=-1).astype(np.float32)
    color = np.stack([wave, 0.8 * wave, 0.3 + 0.0 * wave], axis=-1) + noise
    return {
        "RGB": np.maximum(color, 0.0).astype(np.float16),
        "provenance": provenance,
        "forward": -flow if number != FRAMES[-1] else 0.0 * flow,
        "backward": flow if number != FRAMES[0] else 0.0 * flow,
    }
