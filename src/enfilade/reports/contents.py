"""What stands on the page of a run, besides its pictures: state, tables, settings, and the page's data."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

from enfilade.metric import sequence_score
from enfilade.reports.film import Film
from enfilade.reports.forecast import Forecast, forecast
from enfilade.reports.layers import LAYERS
from enfilade.reports.panels import PURPOSES, counts_rays, panels
from enfilade.reports.seen import SeenRun
from enfilade.reports.tables import SOURCES, percent, seconds
from enfilade.settings import Settings

__all__ = ["contents"]


def contents(seen: SeenRun, reference: SeenRun | None, film: Film) -> dict[str, Any]:
    """Gather what the page says, by the names that its template knows.

    Parameters
    ----------
    seen
    reference
        None: without one.
    film
    """
    ahead = _ahead(seen)
    made = panels(seen.figures, seen.numbers, seen.speed_deg_s, film.beside)
    return {
        "name": seen.name,
        "folder": str(seen.run.folder.resolve()),
        "figures": seen.figures,
        "counts_rays": counts_rays(seen.figures),
        "state": _state(seen),
        "written": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "has_frames": bool(film.frames),
        "video": _video(seen),
        "layers": [layer for layer in LAYERS if layer.name in film.layers],
        "panels": made,
        "effort": _effort(seen.figures),
        "table2": _times(seen.figures),
        "ahead": ahead,
        "left": _left(ahead),
        "beside": _beside(seen, reference, film),
        "settings": _settings(seen.identity.get("settings", {})),
        "identity": _identity(seen),
        "rows": _rows(seen, film),
        "data": json.dumps(_data(seen, film, made), ensure_ascii=True).replace("<", "\\u003c"),
        "has_reference": reference is not None,
    }


def _ahead(seen: SeenRun) -> Forecast:
    found = forecast(seen.identity, seen.lines, workers=sum(one["workers"] for one in seen.writers))
    if seen.silent_since is None:
        return found
    return replace(found, left_s=None, text="the time left is not known: perhaps nobody is at work any more")


def _effort(figures: Mapping[str, Any]) -> dict[str, Any]:
    """What was traced, and why: rays where the method counts them, and pixels (Table 1) otherwise."""
    if counts_rays(figures):
        rays = figures["rays"]
        sent = {**rays, "total": sum(rays.values())} if rays else {}
        named = [*((kind, name) for kind, (name, _) in PURPOSES.items()), ("total", "total")]
        return {
            "title": "Rays per pixel and frame",
            "table": "",
            "columns": [(name, f"{sent[kind]:.2f}" if sent else "–") for kind, name in named],
            "text": "Drafts are what tells where light comes from, and how many paths it takes.",
            "headings": [name for name, _ in PURPOSES.values()] + ["rays"],
        }
    known, count = len(figures["per_frame"]), figures["frames"]
    return {
        "title": "Pixels traced",
        "table": "Table 1",
        "columns": [(name, percent(figures["table1"][key])) for key, name in SOURCES.items()],
        "text": f"Percent of the pixels of {known}{'' if known == count else f' of {count}'} frames.",
        "headings": ["slow, %", "specular, %", "holes, %", "keyframe, %", "traced, %"],
    }


def _efforts(figures: Mapping[str, Any]) -> dict[int, list[float]]:
    """By frame, what stands under the headings of :func:`_effort`."""
    if counts_rays(figures):
        rows, keys = figures["rays_per_frame"], tuple(PURPOSES)
        return {row["frame"]: [*(row[k] for k in keys), sum(row[k] for k in keys)] for row in rows}
    keys = ("slow", "specular", "hole", "keyframe", "traced")
    return {row["frame"]: [row[k] for k in keys] for row in figures["per_frame"]}


def _state(seen: SeenRun) -> dict[str, str]:
    count = f"{len(seen.finished)} of {len(seen.numbers)} frames"
    if seen.is_finished:
        return {
            "word": "finished",
            "text": f"all {len(seen.numbers)} frames" + (" and the video" if _video(seen) else ""),
        }
    if seen.writers:
        first, *others = seen.writers
        who = f"process {first['pid']} on {first['host']}, since {first['started']}"
        who += f", and {len(others)} more" if others else ""
        if seen.silent_since is None:
            return {"word": "running", "text": f"{count} finished; {who}"}
        last = f"{seen.silent_since:%Y-%m-%d %H:%M} UTC"
        gone = f"nothing was finished since {last}: it may be gone, and then the same command goes on"
        return {"word": "unfinished", "text": f"{count} finished; {who}, but {gone}"}
    return {
        "word": "unfinished",
        "text": f"{count} finished, and nobody is at work; the same command goes on",
    }


def _video(seen: SeenRun) -> str:
    names = [name for line in seen.lines if line["unit"] == "video" for name in line["files"]]
    return str(seen.run.folder.resolve() / names[0]) if names else ""


def _times(figures: Mapping[str, Any]) -> dict[str, Any]:
    times, count = figures["table2"], figures["frames"]
    total = max(times["total_s"], 1e-9)
    stages = [
        {
            "name": name,
            "wall": seconds(spent["wall_s"]),
            "cpu": seconds(spent["cpu_s"]),
            "per_frame": seconds(spent["wall_s"] / count),
            "share": percent(100.0 * spent["wall_s"] / total),
        }
        for name, spent in times["stages"].items()
    ]
    sums = {"wall": times["total_s"], "cpu": times["cpu_s"], "per_frame": times["per_frame_s"]}
    return {"stages": stages, "total": {name: seconds(value) for name, value in sums.items()}}


def _left(ahead: Forecast) -> str:
    if not ahead.left_s:
        return ""
    return f"{max(ahead.left_s, 1.0):.0f} s" if ahead.left_s < 100.0 else seconds(ahead.left_s)


def _beside(seen: SeenRun, reference: SeenRun | None, film: Film) -> dict[str, Any] | None:
    if reference is None or not film.beside:
        return None
    found = list(film.beside.values())
    scores = [f["score_jnd"] for f in found if f["score_jnd"] is not None]
    shares = [f["percent_visible"] for f in found if f["percent_visible"] is not None]
    psnr = [f["psnr_db"] for f in found if f["psnr_db"] is not None]
    rows = [
        ("frames compared", f"{len(found)}", ""),
        (*_effort_of_a_pixel(reference.figures), "its noise counts as a difference too"),
    ]
    if scores:
        rows += [
            ("visible difference", f"{sequence_score(scores):.2f} JND", "one score for the sequence"),
            ("pixels above 1 JND", f"{percent(sum(shares) / len(shares))} %", "mean over the frames"),
        ]
    if psnr:
        rows.append(("PSNR", f"{sum(psnr) / len(psnr):.2f} dB", "mean over the frames, encoded values"))
    if seen.is_finished and reference.is_finished:
        own, other = (r.figures["table2"]["cpu_s"] / r.figures["frames"] for r in (seen, reference))
        rows += [
            ("CPU time per frame", seconds(own), "this run"),
            ("", seconds(other), "the reference"),
            ("", f"{other / max(own, 1e-9):.2f} : 1", "reference : this run; fair on one machine alone"),
        ]
    return {"name": reference.name, "folder": str(reference.run.folder.resolve()), "rows": rows}


def _effort_of_a_pixel(figures: Mapping[str, Any]) -> tuple[str, str]:
    if counts_rays(figures):
        return "its rays a pixel", f"{sum(figures['rays'].values()):.1f}"
    return "its paths a pixel", str(figures["spp"])


def _settings(tables: Mapping[str, Any]) -> list[dict[str, Any]]:
    default = Settings()
    known = default.to_tables()
    return [
        {
            "name": section,
            "rows": [
                {
                    "name": name,
                    "value": _said(value),
                    "is_changed": name in known.get(section, {}) and known[section][name] != value,
                    "default": _said(known.get(section, {}).get(name)),
                    "help": _help(default, section, name),
                }
                for name, value in table.items()
            ],
        }
        for section, table in tables.items()
        if isinstance(table, dict)
    ]


def _said(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:g}"
    return "none" if value in (None, "") else str(value)


def _help(default: Settings, section: str, name: str) -> str:
    fields = getattr(getattr(default, section, None), "__dataclass_fields__", {})
    return str(fields[name].metadata["help"]) if name in fields else ""


def _identity(seen: SeenRun) -> list[tuple[str, str]]:
    identity, path = seen.identity, seen.identity["path"]
    scene, versions = identity.get("scene", {}), identity.get("versions", {})
    shapes = next((line["shapes"] for line in seen.lines if "shapes" in line), "unknown")
    numbers, of = seen.numbers, seen.viewing
    screen = (
        f"diagonal {of.diagonal_m:g} m at {of.distance_m:g} m: {of.pixels_per_degree:.1f} pixels per degree"
    )
    return [
        ("folder", str(seen.run.folder.resolve())),
        ("method", str(identity["method"])),
        ("frames", f"{len(numbers)}, numbered {numbers[0]} to {numbers[-1]}"),
        ("cuts before frames", ", ".join(str(n) for n in path.get("cuts", [])) or "none"),
        ("image", f"{path['size'][0]}x{path['size'][1]} pixels, {path['fps']:g} frames per second"),
        ("screen", screen),
        ("scene", f"{scene.get('fingerprint', 'unknown')}"),
        ("shapes in it", str(scene.get("shapes", shapes))),
        ("poses", str(path.get("poses", "unknown"))),
        *((f"version: {name}", str(value)) for name, value in versions.items()),
    ]


def _rows(seen: SeenRun, film: Film) -> list[dict[str, Any]]:
    efforts = _efforts(seen.figures)
    rows = []
    for index, number in enumerate(seen.numbers):
        found = film.beside.get(number, {})
        rows.append(
            {
                "frame": number,
                "velocity": None if seen.speed_deg_s is None else seen.speed_deg_s[index],
                "effort": efforts.get(number),
                "score": found.get("score_jnd"),
                "psnr": found.get("psnr_db"),
            }
        )
    return rows


def _data(seen: SeenRun, film: Film, made: list[dict[str, Any]]) -> dict[str, Any]:
    by_number = {row["frame"]: row for row in seen.figures["per_frame"]}
    efforts = _efforts(seen.figures)
    # By method reference no frame is made of others: all are traced alike.
    kinds = ("", "") if seen.figures["method"] == "reference" else ("in-between", "keyframe")
    frames = []
    for frame in film.frames:
        row = by_number.get(frame["number"], {})
        found = film.beside.get(frame["number"], {})
        frames.append(
            {
                "number": frame["number"],
                "index": frame["index"],
                "velocity": None if seen.speed_deg_s is None else seen.speed_deg_s[frame["index"]],
                "effort": efforts.get(frame["number"], [None])[-1],
                "isRaw": frame["is_raw"],
                "kind": kinds[row.get("keyframe", 0.0) > 0.0],
                "score": found.get("score_jnd"),
                "psnr": found.get("psnr_db"),
                "layers": frame["layers"],
            }
        )
    layers = {layer.name: layer for layer in LAYERS}
    return {
        "fps": seen.identity["path"]["fps"],
        "size": film.size,
        "range": [seen.numbers[0], seen.numbers[-1]],
        "frames": frames,
        "layers": [
            {"name": n, "key": layers[n].key, "title": layers[n].title, "isOverlay": layers[n].is_overlay}
            for n in film.layers
        ],
        "panels": made,
        "unit": "" if counts_rays(seen.figures) else "%",
    }
