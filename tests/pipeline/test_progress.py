"""What a monitor is told of units."""

from scenes_analytic import room, room_walk
from small_runs import Told, job_of, rendered


class Counting(Told):
    """Notes how many frames a run has when their stage is first announced."""

    def __init__(self, folder):
        super().__init__()
        self.folder, self.before = folder, {}

    def stage(self, name, total):
        super().stage(name, total)
        self.before.setdefault(name, len(list((self.folder / "frames").glob("*.exr"))))


def test_in_process_a_stage_is_announced_before_its_first_unit(tmp_path):
    job = job_of(tmp_path, room(), room_walk(3, size=(32, 24)), method="reference")
    monitor = Counting(tmp_path / "run")
    rendered(tmp_path, job, monitor=monitor)
    assert monitor.before["trace"] == 0
