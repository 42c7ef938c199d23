import pytest
from click.testing import CliRunner

from studies.__main__ import main


@pytest.fixture
def run():
    def invoke(*arguments):
        return CliRunner().invoke(main, [str(a) for a in arguments], prog_name="python -m studies")

    return invoke
