"""Records as files: OpenEXR for images of one size, NumPy's format for other arrays, exact both ways."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pytest

from enfilade.errors import ImageError
from enfilade.images.records import read_record, write_record

RNG = np.random.default_rng(1)
SIZE = 4, 6


@dataclass(frozen=True, eq=False)
class Inner:
    color: npt.NDArray[np.float32]
    is_valid: npt.NDArray[np.bool_] | None = None


@dataclass(frozen=True, eq=False)
class Record:
    first: npt.NDArray[np.float32]
    count: int
    rest: npt.NDArray[np.float64] | None = None
    limit: int | None = None
    inner: Inner | None = None


@dataclass(frozen=True, eq=False)
class Numbers:
    count: int


def image(*shape):
    return RNG.random(shape, np.float32)


RECORDS = {
    "images": (Record(image(*SIZE, 3), 3, inner=Inner(image(*SIZE), RNG.random(SIZE) > 0.5)), ".exr"),
    "vectors": (Record(image(*SIZE, 2), -1, limit=4), ".exr"),
    "of several sizes": (Record(image(*SIZE), 1, inner=Inner(image(2, 2))), ".npz"),
    "four channels": (Record(image(*SIZE, 4), 1), ".npz"),
    "double precision": (Record(image(*SIZE), 1, RNG.random(SIZE)), ".npz"),
    "a list": (Record(image(7), 1), ".npz"),
    "empty": (Record(image(0, 3), 1), ".npz"),
    "numbers alone": (Numbers(5), ".npz"),
}


def assert_same(one, other):
    assert type(one) is type(other)
    for name, value in vars(one).items():
        found = getattr(other, name)
        if isinstance(value, np.ndarray):
            assert found.dtype == value.dtype
            np.testing.assert_array_equal(found, value)
        elif isinstance(value, Inner):
            assert_same(value, found)
        else:
            assert found == value


@pytest.mark.parametrize("name", RECORDS)
def test_what_is_read_is_what_was_written(tmp_path, name):
    record, suffix = RECORDS[name]
    file = write_record(tmp_path / "record", record)
    assert file.suffix == suffix
    assert_same(record, read_record(file, type(record)))


def test_a_file_of_another_record_is_refused(tmp_path):
    file = write_record(tmp_path / "record", Inner(image(*SIZE)))
    with pytest.raises(ImageError, match="holds no Record: 'first'; delete it"):
        read_record(file, Record)
