import pytest

from support.sequences import write_sequence


@pytest.fixture
def sequence(tmp_path):
    def write(name, images, **options):
        return write_sequence(tmp_path / name, images, **options)

    return write
