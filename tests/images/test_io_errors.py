"""A disk that doesn't answer is told from a file that is damaged: the one may pass."""

import errno
import os
import stat

import numpy as np
import pytest

from enfilade import files as whole
from enfilade.errors import ImageError, RunFolderError
from enfilade.files import write_json
from enfilade.images import exr, read_exr, write_exr

PIXELS = np.ones((4, 4, 3), np.float32)


def broken(*arguments, **options):
    raise RuntimeError("OpenEXR gives no reason")


def test_pixels_that_can_not_be_read(tmp_path, monkeypatch):
    file = tmp_path / "file.exr"
    write_exr(file, {"RGB": PIXELS})
    really = type(file).open

    def opened(self, *how, **more):
        stream = really(self, *how, **more)
        read = stream.read

        class Bad:
            """Gives the first bytes alone."""

            def __enter__(self):
                return self

            def __exit__(self, *_):
                stream.close()

            def read(self, size):
                if size > 4:
                    raise OSError(errno.EIO, "Input/output error")
                return read(size)

        return Bad()

    monkeypatch.setattr(exr.OpenEXR, "File", broken)
    with pytest.raises(ImageError, match="cut off or damaged"):
        read_exr(file)
    monkeypatch.setattr(type(file), "open", opened)
    with pytest.raises(ImageError, match=r"can't read .*Input/output error") as seen:
        read_exr(file)
    assert whole.is_passing(seen.value.__cause__)


@pytest.mark.parametrize("number", [errno.EIO, errno.ESTALE, errno.ETIMEDOUT])
def test_what_may_pass_is_not_told_to_make_room(tmp_path, number):
    error = OSError(number, os.strerror(number))
    assert whole.is_passing(error)
    text = str(whole.unwritable(tmp_path / "file", error))
    assert os.strerror(number) in text
    assert "look at its disk" in text
    assert "make room" not in text


@pytest.mark.parametrize("number", [errno.ENOENT, errno.EACCES, errno.EPERM, errno.EROFS, errno.ENOSPC, None])
def test_what_stays_as_it_is(number):
    assert not whole.is_passing(OSError("no reason") if number is None else OSError(number, "it said so"))


@pytest.mark.parametrize("number", [errno.EINVAL, errno.ENOTSUP])
def test_a_file_system_that_can_not_flush_folders_need_not(tmp_path, monkeypatch, number):
    really, refused = os.fsync, [stat.S_ISDIR]

    def flush(handle):
        if refused[0](os.fstat(handle).st_mode):
            raise OSError(number, os.strerror(number))
        really(handle)

    monkeypatch.setattr(os, "fsync", flush)
    write_json(tmp_path / "deep" / "file.json", {})
    refused[0] = stat.S_ISREG
    with pytest.raises(RunFolderError, match=os.strerror(number)):
        write_json(tmp_path / "deep" / "other.json", {})


def test_a_folder_that_a_disk_could_not_flush_is_said(tmp_path, monkeypatch):
    def flush(_handle):
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(os, "fsync", flush)
    with pytest.raises(OSError, match="Input/output"):
        whole.flush(tmp_path)
