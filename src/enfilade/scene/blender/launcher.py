"""Sets limits for its own process, and becomes Blender."""

from __future__ import annotations

import os
import sys

from enfilade.resource_limits import die_with, limit_memory
from enfilade.scene.blender.find import clean_environment


def _main(parent: int, megabytes: int, home: str, line: list[str]) -> None:
    die_with(parent)
    limit_memory(megabytes)
    environment = {**clean_environment(), "HOME": home, "TMPDIR": home}
    os.execve(line[0], line, environment)  # noqa: S606


if __name__ == "__main__":
    _main(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3], sys.argv[4:])
