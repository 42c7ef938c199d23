"""The command line: parse, call, print. Nothing else.

Exit codes: 0; 1 a failure; 2 wrong input; 130 interrupted. Results go to stdout, progress and log to
stderr.
"""

from enfilade.cli.group import main

__all__ = ["main"]
