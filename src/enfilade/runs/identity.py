"""The identity of a run: everything on which its results depend."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from enfilade.errors import RunFolderError
from enfilade.files import MARK, is_full, read_json, unwritable
from enfilade.runs.ledger import LEDGER_FILE
from enfilade.runs.lock import LOCK_FILE
from enfilade.scene.blender.process import RESULT_FILE as IMPORT_FILE

FORMAT = 4  # of the folder; another number is refused
RUN_FILE = "run.json"
SCENE_FOLDER = "scene"  # of a run, if its scene was imported by Blender
SHOWN_DIFFERENCES, SHOWN_LETTERS = 12, 80
ABSENT = object()


def check_place(folder: Path) -> None:
    """Make a folder for a run; it must be new, empty, or hold one.

    Raises
    ------
    RunFolderError
        It holds something else, or can't be made.
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
    own = {LOCK_FILE, SCENE_FOLDER} if (folder / SCENE_FOLDER / IMPORT_FILE).is_file() else {LOCK_FILE}
    foreign = [name for name in names if name not in own and MARK not in name]
    if foreign and RUN_FILE not in names and LEDGER_FILE not in names:
        raise RunFolderError(
            f"{folder} is not empty and holds no run (it has {', '.join(foreign[:3])}); choose another --out"
        )


def identity_of(folder: Path) -> dict[str, Any]:
    """Identity of the run in a folder.

    Raises
    ------
    RunFolderError
        The folder holds no run, one of another format, or is damaged.
    """
    file = folder / RUN_FILE
    if not file.is_file():
        raise RunFolderError(f"{folder} is no run folder: it has no {RUN_FILE}")
    value = read_json(file)
    if not isinstance(value, dict) or not isinstance(value.get("identity"), dict):
        raise RunFolderError(f"{file} is damaged; run the command that made it again")
    if value.get("format") != FORMAT:
        raise RunFolderError(
            f"{file} has format {value.get('format')!r}, this version reads format {FORMAT}; choose another "
            "--out"
        )
    identity: dict[str, Any] = value["identity"]
    return identity


def check_same(folder: Path, now: dict[str, Any], *, is_begun: bool, has_results: bool) -> None:
    """Refuse a folder that holds another run, and list the differences.

    Parameters
    ----------
    folder
    now
        Identity of the run that is wanted.
    is_begun
        Whether the ledger names another identity, or one of another format.
    has_results
        Whether it has finished tasks.

    Raises
    ------
    RunFolderError
        It does, or its identity is damaged, or results have none.
    """
    if not is_begun and not (folder / RUN_FILE).exists():
        if has_results:
            raise RunFolderError(
                f"{folder} has results of a run that is not named: {RUN_FILE} and the first line of "
                f"{LEDGER_FILE} are missing; choose another --out, or delete {folder} to begin anew"
            )
        return
    before, after = _flat(identity_of(folder)), _flat(now)
    keys = [key for key in {**before, **after} if before.get(key, ABSENT) != after.get(key, ABSENT)]
    if not keys and not is_begun:
        return
    shown = "".join(
        f"\n  {key}: {_shown(before.get(key, ABSENT))} there, {_shown(after.get(key, ABSENT))} now"
        for key in keys[:SHOWN_DIFFERENCES]
    )
    more = f"\n  and {len(keys) - SHOWN_DIFFERENCES} more" if len(keys) > SHOWN_DIFFERENCES else ""
    raise RunFolderError(
        f"{folder} holds another run:{shown}{more}\nChoose another --out, or delete {folder} to begin anew"
    )


def _shown(value: Any) -> str:
    text = "nothing" if value is ABSENT else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= SHOWN_LETTERS else f"{text[:SHOWN_LETTERS]}..."


def _flat(value: Any, prefix: str = "") -> dict[str, Any]:
    if isinstance(value, dict) and value:
        parts = [_flat(v, f"{prefix}.{k}" if prefix else str(k)) for k, v in value.items()]
        return {key: leaf for part in parts for key, leaf in part.items()}
    return {prefix: value}


def digest_of(identity: Mapping[str, Any]) -> str:
    """Checksum of an identity; 24 and 24.0 are the same."""
    canonical = json.loads(json.dumps(identity), parse_int=float)
    return hashlib.sha256(json.dumps(canonical, sort_keys=True).encode()).hexdigest()
