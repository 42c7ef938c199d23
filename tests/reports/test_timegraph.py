"""The time graph shows the results of a comparison: the axes are read, not the pixels."""

import numpy as np
import pytest

from enfilade.reports.timegraph import plot_comparison, time_figure

FIRST = 101  # number of the first frame


def made_up(frames=5, *, flicker=0.1):
    rows = [
        {
            "number": FIRST + i,
            "score_jnd": 0.5 + 0.1 * i,
            "steady_jnd": 0.5,
            "transient_jnd": flicker * i,
            "percent_visible": 2.0 * i,
            "steady_bands_jnd": [0.1, 0.4, 0.2],
            "transient_bands_jnd": [0.0, 0.05 * i, 0.3],
        }
        for i in range(frames)
    ]
    figures = {"score_jnd": 0.8, "meaning": "noticed", "size": [64, 48], "fps": 25.0, "mode": "modern"}
    bands = [[14.0, 20.0], [7.0, 14.0], [0.0, 7.0]]
    figures |= {"pixels_per_degree": 28.0, "noise_floor": None}
    return {**figures, "bands_cpd": bands, "per_frame": rows}


def lines(ax):
    return {line.get_label(): line.get_xydata().tolist() for line in ax.lines}


def test_score_and_its_parts():
    figure = time_figure(made_up())
    drawn = lines(figure.axes[0])
    for label, key in (("score", "score_jnd"), ("transient part", "transient_jnd")):
        assert drawn[label] == [[row["number"], row[key]] for row in made_up()["per_frame"]]
    assert drawn["sequence 0.80"][0][1] == 0.8
    assert set(drawn) == {"score", "steady part", "transient part", "sequence 0.80"}
    assert "0.80 JND (noticed)" in figure.get_suptitle()
    assert [ax.get_ylabel() for ax in figure.axes[:3]] == ["JND", "% of pixels", "cycles per degree"]
    assert "steady part" not in lines(time_figure(made_up(flicker=0.0)).axes[0])  # that is the score


def test_the_noise_floor_is_on_the_axis():
    figure = time_figure({**made_up(), "noise_floor": {"per_frame_jnd": [2.0, 3.0, 4.0, 5.0, 6.0]}})
    assert lines(figure.axes[0])["noise floor"] == [[FIRST + i, 2.0 + i] for i in range(5)]
    assert figure.axes[0].get_ylim()[1] > 6.0


def test_visible_pixels_and_bands():
    figure = time_figure(made_up())
    (stairs,) = figure.axes[1].patches
    assert list(stairs.get_data().values[::2]) == [0.0, 2.0, 4.0, 6.0, 8.0]
    assert sorted(set(stairs.get_data().edges)) == [100.5, 101.5, 102.5, 103.5, 104.5, 105.5]
    (mesh,) = figure.axes[2].collections
    np.testing.assert_allclose(np.reshape(mesh.get_array(), (3, 5))[:, -1], [0.1, 0.4, 0.3])
    labels = [label.get_text() for label in figure.axes[2].get_yticklabels()]
    assert labels == ["14 to 20", "7 to 14", "below 7"]


def test_a_single_frame_is_seen():
    figure = time_figure(made_up(1, flicker=0.1))
    (mesh,) = figure.axes[2].collections
    across = mesh.get_coordinates()[..., 0]
    assert across.max() - across.min() == 1.0
    assert all(line.get_marker() == "o" for line in figure.axes[0].lines if len(line.get_xdata()) == 1)


@pytest.mark.parametrize("frames", [1, 300])
def test_any_length_is_drawn(tmp_path, frames):
    file = plot_comparison(made_up(frames), tmp_path / "new" / "graph.png")
    assert file.read_bytes().startswith(b"\x89PNG")
