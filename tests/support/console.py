"""Tables as a terminal shows them."""

from io import StringIO

from rich.console import Console
from rich.table import Table


def as_text(table: Table, width: int = 100) -> str:
    """Plain text without colours."""
    out = StringIO()
    Console(file=out, width=width, color_system=None).print(table)
    return out.getvalue()
