"""Command line of the studies: ``python -m studies COMMAND``."""

import click

from enfilade.cli.group import EnfiladeGroup, debug_option

MODULES = {
    "scene": "studies.scenes.command",
    "bench": "studies.bench.command",
    "blender": "studies.blender.command",
    "calibrate": "studies.cases.calibrate",
    "validate": "studies.observers.command",
}


@click.group(cls=EnfiladeGroup, modules=MODULES, context_settings={"help_option_names": ["-h", "--help"]})
@debug_option
def main() -> None:
    """Studies of enfilade: generated scenes, baselines, human observers, the paper's experiments."""


if __name__ == "__main__":
    main(prog_name="python -m studies")
