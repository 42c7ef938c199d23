# SPDX-License-Identifier: GPL-3.0-or-later
"""The one error of this program; it becomes ``error.json``."""

from __future__ import annotations


class ExportError(Exception):
    """A file can't be exported.

    Attributes
    ----------
    what : str
        The failure.
    where : str
        File, object or node.
    do : str
        What the user can do about it.
    """

    def __init__(self, what: str, where: str, do: str) -> None:
        super().__init__(f"{what} ({where}): {do}")
        self.what, self.where, self.do = what, where, do
