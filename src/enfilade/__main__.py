"""``python -m enfilade`` is the ``enfilade`` command."""

from enfilade.cli import main

main()
