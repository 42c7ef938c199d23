"""A made-up run and a made-up plan, with figures like those of the paper's Figs. 12 and 13."""

import math


def made_up_summary(count=120, *, spacing=20, method="paper"):
    per_frame = []
    for i in range(count):
        is_keyframe = method == "reference" or i % spacing == 0 or i == count - 1
        speed = abs(6.0 * math.sin(i / 17.0)) + 0.3
        shares = {"slow": 0.0, "specular": 0.0, "hole": 0.0, "keyframe": 100.0}
        if not is_keyframe:
            shares = {"slow": max(0.0, 60.0 - 40.0 * speed), "specular": 8.0 + 4.0 * math.cos(i / 9.0)}
            shares |= {"hole": 1.5, "keyframe": 0.0}
        row = {"frame": i + 1, "velocity_deg_s": speed, **shares, "traced": sum(shares.values())}
        per_frame.append(row)
    return {
        "frames": count,
        "size": [640, 480],
        "method": method,
        "spp": 64,
        "table1": {"slow": 20.0, "specular": 7.9, "occlusion": 0.43, "keyframes": 5.8, "total": 34.13},
        "table2": {
            "total_s": 240.0,
            "per_frame_s": 2.0,
            "cpu_s": 430.0,
            "stages": {
                "keyframes": {"wall_s": 60.0, "cpu_s": 110.0},
                "fill": {"wall_s": 150.0, "cpu_s": 290.0},
                "antialias": {"wall_s": 29.96, "cpu_s": 29.9},
                "video": {"wall_s": 0.04, "cpu_s": 0.1},
            },
        },
        "per_frame": per_frame,
        **_rays(count if method == "decoupled" else 0, spacing),
        "segments": _segments(count, spacing) if method == "paper" else [],
        "dropped_samples": 0,
        "peak_memory_bytes": 2_000_000_000,
        "video": "video.mp4",
        "split_percent": 10.0,
    }


def _rays(count, spacing):
    rows = [
        {"frame": i + 1, "camera": 12.5, "lobes": 3.0, "light": light, "drafts": light / 2}
        for i, light in enumerate(40.0 if i % spacing == 0 else 0.0 for i in range(count))
    ]
    kinds = [kind for kind in (rows[0] if rows else ()) if kind != "frame"]
    return {"rays": {k: sum(row[k] for row in rows) / count for k in kinds}, "rays_per_frame": rows}


def _segments(count, spacing):
    made = []
    for first in range(1, count, spacing):
        last = min(first + spacing, count)
        split = first == 1 + 2 * spacing
        made.append(_segment(first, last, 14.0 if split else 3.0 + first / 30.0, split, 0))
        if split:
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


def made_up_plan(count=60):
    speed = [abs(6.0 * math.sin(i / 17.0)) + 0.3 for i in range(count)]
    return {
        "frames": list(range(1, count + 1)),
        "mean_speed_deg_s": speed,
        "slow_percent": [max(0.0, 60.0 - 40.0 * v) for v in speed],
        "specular_percent": [8.0] * count,
        "hole_percent": [2.0 if frame in (11, 31, 50) else None for frame in range(1, count + 1)],
        "keyframes": [1, 21, 41, 60],
        "segments": [
            {"first": 1, "middle": 11, "last": 21},
            {"first": 21, "middle": 31, "last": 41},
            {"first": 41, "middle": 50, "last": 60},
        ],
        "method": "paper",
        "forecast": {
            "traced_percent": 31.5,
            "traced_percent_least": 24.0,
            "shares_percent": {"slow": 15.0, "specular": 7.5, "holes": 1.5, "keyframes": 7.5},
            "paths": 123_456_789,
            "seconds": 512.25,
        },
    }
