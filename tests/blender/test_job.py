"""Job files."""

import json
from pathlib import Path

import pytest

import enfilade_blender
from enfilade_blender.failure import ExportError
from enfilade_blender.job import read_job
from enfilade_blender.notes import Notes

JOB = {"task": "export", "source": "/a.blend", "out": "/b"}


def test_a_job_of_all_keys(tmp_path):
    file = tmp_path / "job.json"
    file.write_text(
        json.dumps(
            JOB | {"frames": [3, 9], "size": None, "limits": {"instances": 5}, "library_folders": ["/c"]}
        )
    )
    job = read_job(file)
    assert (job.frames, job.size, job.limits.instances) == ((3, 9), None, 5)
    assert [str(folder) for folder in job.library_folders] == ["/c"]


@pytest.mark.parametrize(
    "job", [JOB | {"colour": 1}, {"task": "export", "source": "/a"}, JOB | {"task": "bake"}]
)
def test_a_wrong_job_is_refused(tmp_path, job):
    file = tmp_path / "job.json"
    file.write_text(json.dumps(job))
    with pytest.raises(ExportError, match="unknown or missing"):
        read_job(file)


@pytest.mark.blender
def test_an_error_of_the_importer_ends_its_process(blender, tmp_path):
    file = tmp_path / "job.json"
    file.write_text(json.dumps(JOB | {"limits": {"unknown": 1}}))
    done = blender.run(Path(enfilade_blender.__file__).parent, file)
    assert (done.returncode, "TypeError" in done.stderr) == (1, True)


def test_a_note_is_made_once():
    notes = Notes()
    for _ in range(2):
        notes.add("baked", "wall", "Noise", "baked", "less detail")
    assert notes.to_list() == [
        {"kind": "baked", "object": "wall", "node": "Noise", "what": "baked", "effect": "less detail"}
    ]
