"""Which run a folder holds: what makes its results what they are, in ``run.json``."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from enfilade.errors import RunFolderError
from enfilade.files import MARK, is_full, json_bytes, read_json, unwritable, write_json
from enfilade.store.checksum import checksum
from enfilade.store.ledger import head_of
from enfilade.store.lock import LOCK_NAME

__all__ = ["LEDGER_FILE", "RUN_FILE", "claim", "identity_of", "prepare"]

FORMAT = 3  # of the folder; another number is refused
RUN_FILE, LEDGER_FILE = "run.json", "ledger.jsonl"
SHOWN_DIFFERENCES = 12
SHOWN_LETTERS = 80  # of one value: a list of frames has many


def prepare(folder: Path) -> None:
    """Make a folder fit for a run: it must be new, or empty, or hold one.

    Raises
    ------
    RunFolderError
    NoSpaceError
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        names = sorted(entry.name for entry in folder.iterdir())
    except OSError as error:
        if is_full(error):
            raise unwritable(folder, error) from error
        raise RunFolderError(
            f"can't make a run in {folder}: {error.strerror}; choose another --out"
        ) from error
    foreign = [name for name in names if name != LOCK_NAME and MARK not in name]
    if foreign and RUN_FILE not in names and head_of(folder / LEDGER_FILE) is None:
        raise RunFolderError(
            f"{folder} is not empty and holds no run (it has {', '.join(foreign[:3])}); choose another --out"
        )


def identity_of(folder: Path) -> dict[str, Any]:
    """What makes the results of a run what they are.

    Raises
    ------
    RunFolderError
        The folder holds no run, or is damaged.
    """
    if not folder.is_dir():
        raise RunFolderError(f"there is no folder {folder}")
    if not (folder / RUN_FILE).is_file():
        raise RunFolderError(f"{folder} is no run folder: it has no {RUN_FILE}")
    identity = _read_identity(folder)
    if head_of(folder / LEDGER_FILE) not in (None, checksum(folder / RUN_FILE)):
        raise RunFolderError(
            f"{folder / RUN_FILE} is damaged: it isn't what was written; run the command that made it again"
        )
    return identity


def claim(folder: Path, wanted: dict[str, Any], kept: Callable[[list[str]], str] | None) -> list[str]:
    """Say in ``run.json`` what the folder holds, or check that it is that; returns what was mended.

    Raises
    ------
    RunFolderError
        It holds another run, or is damaged.
    """
    file, text = folder / RUN_FILE, {"format": FORMAT, "identity": wanted}
    head, data = head_of(folder / LEDGER_FILE), json_bytes(text)
    is_there = file.exists()
    if is_there and (head is None or checksum(file) == head):
        _check_same(folder, _read_identity(folder), wanted, kept)
        return []
    if head is not None and head != {"bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()}:
        raise RunFolderError(
            f"{file} is {'damaged' if is_there else 'missing'}, and its checksum in the ledger isn't that of "
            "this command: continue with the command that began it, or choose another --out"
        )
    write_json(file, text)
    return [] if head is None else [f"{RUN_FILE} was damaged or missing and was written again"]


def _read_identity(folder: Path) -> dict[str, Any]:
    file = folder / RUN_FILE
    value = read_json(file)
    if not isinstance(value, dict) or not isinstance(value.get("identity"), dict):
        raise RunFolderError(
            f"{file} is damaged: it holds no identity; choose another --out or delete {folder}"
        )
    if value.get("format") != FORMAT:
        raise RunFolderError(
            f"{file} has format {value.get('format')!r}, this version knows {FORMAT}; choose another --out"
        )
    identity: dict[str, Any] = value["identity"]
    return identity


def _check_same(
    folder: Path,
    there: dict[str, Any],
    now: dict[str, Any],
    kept: Callable[[list[str]], str] | None,
) -> None:
    before, after = _flat(there), _flat(now)
    keys = [k for k in {**before, **after} if before.get(k, _ABSENT) != after.get(k, _ABSENT)]
    if not keys:
        return
    shown = "".join(
        f"\n  {key}: {_said(before.get(key, _ABSENT))} there, {_said(after.get(key, _ABSENT))} now"
        for key in keys[:SHOWN_DIFFERENCES]
    )
    more = f"\n  and {len(keys) - SHOWN_DIFFERENCES} more" if len(keys) > SHOWN_DIFFERENCES else ""
    raise RunFolderError(
        f"{folder} holds another run:{shown}{more}\n{'' if kept is None else kept(keys)}"
        f"Choose another --out, or delete {folder} to begin anew"
    )


_ABSENT = object()  # a key that one of two runs doesn't have


def _said(value: Any) -> str:
    text = "nothing" if value is _ABSENT else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= SHOWN_LETTERS else f"{text[:SHOWN_LETTERS]}..."


def _flat(value: Any, prefix: str = "") -> dict[str, Any]:
    if isinstance(value, dict) and value:
        parts = [_flat(v, f"{prefix}.{k}" if prefix else str(k)) for k, v in value.items()]
        return {key: leaf for part in parts for key, leaf in part.items()}
    return {prefix: value}
