"""What the commands print: tables for people, JSON for programs, results on stdout only."""

import json

from made_up_runs import made_up_plan, made_up_summary


def test_render_prints_both_tables_and_names_its_files(run, jobs, camera_path, tmp_path):
    jobs.answer = {**made_up_summary(), "dropped_samples": 3}
    folder = tmp_path / "run"
    output = run("render", "s.xml", "--path", camera_path, "--out", folder).stdout
    for words in ("Table 1", "34.1", "Table 2", "antialias", "3 samples"):
        assert words in output
    assert output.splitlines()[-3:] == [
        f"video   {folder}/video.mp4",
        f"plot    {folder}/plots/walkthrough.png",
        f"run     {folder}",
    ]
    assert (folder / "plots" / "walkthrough.png").exists()


def test_render_as_json(run, jobs, camera_path, tmp_path):
    result = run("render", "s.xml", "--path", camera_path, "--out", tmp_path, "--json", "--quiet")
    plots = [str(tmp_path / "plots" / "walkthrough.png")]
    assert json.loads(result.stdout) == {**made_up_summary(), "folder": str(tmp_path), "plots": plots}
    assert result.stderr == ""


def test_plan_prints_a_table_and_draws(run, jobs, camera_path, tmp_path):
    jobs.answer = made_up_plan()
    plot = tmp_path / "plan.png"
    output = run("plan", "s.xml", "--path", camera_path, "--plot", plot).stdout
    assert "4 initial keyframes: 1, 21, 41, 60" in output
    assert str(plot) in output.replace("\n", "")
    assert plot.read_bytes().startswith(b"\x89PNG")


def test_a_plan_that_cannot_be_drawn_is_told(run, jobs, camera_path, tmp_path):
    jobs.answer = made_up_plan()
    (tmp_path / "file").write_text("")
    line = ("plan", "s.xml", "--path", camera_path, "--plot", tmp_path / "file" / "plan.png")
    for flags, words in (((), "4 initial keyframes: 1, 21, 41, 60"), (("--json",), '"keyframes"')):
        result = run(*line, *flags)
        assert result.exit_code == 2
        assert words in result.stdout
        assert "can't write" in result.stderr


def test_a_plan_is_drawn_as_png(run, jobs, camera_path, tmp_path):
    result = run("plan", "s.xml", "--path", camera_path, "--plot", tmp_path / "plan.pdf")
    assert result.exit_code == 2
    assert "plan.pdf: it is written as .png" in result.stderr
    assert jobs.seen == []


def test_plan_as_json(run, jobs, camera_path):
    jobs.answer = made_up_plan()
    assert json.loads(run("plan", "s.xml", "--path", camera_path, "--json").stdout) == made_up_plan()
