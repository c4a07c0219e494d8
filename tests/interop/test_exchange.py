"""Imports from and exports to other tools; repeated and damaged imports are refused."""

import json
import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from tests.report.records import Attempt, Lab, measured, step
from vsnbench.errors import RecordError, UsageError
from vsnbench.interop.episodes import cameras_of, read_episodes, write_tum
from vsnbench.interop.habitat import read_habitat
from vsnbench.interop.importing import import_habitat, import_upstream_log, unsurveyed_site
from vsnbench.interop.rosbag import write_bag
from vsnbench.interop.upstream_log import read_upstream_log
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.analysis.summary import summarise
from vsnbench.report.build import build, read
from vsnbench.report.comparison.sim_vs_real import sim_real_pairs
from vsnbench.report.tables.sim_vs_real import sim_vs_real_table
from vsnbench.results.model import Episode
from vsnbench.results.reading.filtering import EpisodeFilter
from vsnbench.results.reading.queries import episode_record, episode_steps, list_campaigns, list_episodes
from vsnbench.robots.profiles import load_profile
from vsnbench.values.camera import CameraRole
from vsnbench.values.movement import Action

STEPS = [
    step(1, Action.MOVE_FORWARD, x_m=0.25),
    step(2, Action.MOVE_FORWARD, x_m=0.25, blocked=True),
    step(3, Action.STOP, x_m=0.25),
]


@pytest.fixture
def lab(tmp_path: Path) -> Lab:
    return Lab(tmp_path)


def episodes_of(lab: Lab) -> tuple[Episode, ...]:
    return read_episodes(lab.engine())


def test_a_tum_file_has_a_unit_quaternion_a_step_in_the_frame_of_the_site(lab: Lab, tmp_path: Path) -> None:
    lab.write([Attempt(steps=STEPS)])
    (episode,) = episodes_of(lab)
    assert write_tum(episode, episode_steps(lab.engine(), episode.id), tmp_path / "t.tum") == 3
    comment, *lines = (tmp_path / "t.tum").read_text().splitlines()
    assert "frame: site" in comment
    rows = np.array([[float(word) for word in line.split()] for line in lines])
    assert rows.shape == (3, 8)
    assert rows[0, 1:3] == pytest.approx([1.25, 1.0])
    assert np.hypot(rows[:, 6], rows[:, 7]) == pytest.approx(1.0)
    assert (np.diff(rows[:, 0]) >= 0).all()


def test_simulated_results_stand_against_the_real_ones(lab: Lab, tmp_path: Path) -> None:
    file = tmp_path / "results.json"
    rows = [{"object_category": "chair", "success": float(i < 13), "num_steps": 50} for i in range(20)]
    file.write_text(json.dumps(rows))
    lab.write([Attempt(start=s, success=s <= 3) for s in range(1, 11)], model="pirlnav", simulated=False)
    episodes = read_habitat(file)
    protocol = ProtocolParameters(max_actions=500, success_distance_m=0.5)
    options = {"model": "pirlnav", "site": unsurveyed_site("hm3d"), "source": file, "protocol": protocol}
    with lab.journal() as journal:
        with pytest.raises(UsageError, match="episode of 50 steps, more than --max-steps 40"):
            import_habitat(journal, episodes, **options | {"protocol": ProtocolParameters(max_actions=40)})
        import_habitat(journal, episodes, **options)
        with pytest.raises(UsageError, match="already in the record"):
            import_habitat(journal, episodes, **options)
    record = read(lab.url, Selection())
    imported = next(one for one in record.conditions if one.simulated)
    assert (imported.max_actions, imported.success_distance_m) == (500, 0.5)
    table = sim_vs_real_table(sim_real_pairs(summarise(record)))
    assert table is not None
    (row,) = [[cell.text for cell in row.cells] for row in table.rows]
    assert "3/10" in row
    assert "13/20" in row
    assert "-35.00" in row


def test_a_bag_reads_back_with_images_odometry_and_actions(lab: Lab, tmp_path: Path) -> None:
    (number,) = lab.write([Attempt(steps=STEPS)])
    directory = lab.directory / "episodes" / f"{number:06d}"
    (directory / "rgb").mkdir(parents=True)
    (directory / "depth").mkdir()
    depth = np.arange(12, dtype=np.uint16).reshape(3, 4) * 1000
    assert cv2.imwrite(str(directory / "rgb" / "0001.jpg"), np.zeros((3, 4, 3), np.uint8))
    assert cv2.imwrite(str(directory / "depth" / "0001.png"), depth)
    (episode,) = episodes_of(lab)
    record = episode_record(lab.engine(), episode.id)
    written = write_bag(record, episode_steps(lab.engine(), episode.id), lab.directory, tmp_path / "e.bag")
    assert written["/vsnbench/action"] == 3
    assert written["/camera/color/camera_info"] == written["/camera/depth/camera_info"] == 1
    with AnyReader([tmp_path / "e.bag"]) as reader:
        heard = {}
        for connection, _, raw in reader.messages():
            heard.setdefault(connection.topic, []).append(reader.deserialize(raw, connection.msgtype))
    assert [message.data for message in heard["/vsnbench/action"]] == ["MOVE_FORWARD", "BLOCKED", "STOP"]
    (image,) = heard["/camera/depth/image_raw"]
    assert (image.encoding, image.height, image.width) == ("16UC1", 3, 4)
    assert (image.data.view("<u2").reshape(3, 4) == depth).all()
    assert 0.25 in [message.pose.pose.position.x for message in heard["/odom"]]
    assert len(heard["/tf"]) == len(heard["/odom"])
    frames = {(t.header.frame_id, t.child_frame_id) for m in heard["/tf_static"] + heard["/tf"] for t in m.transforms}
    assert ("odom", "base_footprint") in frames
    assert ("base_footprint", "camera_color_optical_frame") in frames
    calibration = heard["/camera/color/camera_info"][0]
    assert calibration.K[0] == pytest.approx(cameras_of(record.provenance.robot_profile)[CameraRole.FRONT].focal_px)
    (picture,) = heard["/camera/color/image_raw/compressed"]
    assert cv2.imdecode(picture.data, cv2.IMREAD_COLOR).shape == (3, 4, 3)


def upstream(directory: Path, lines: str, pictures: int = 0) -> Path:
    (directory / "rgb").mkdir(parents=True)
    (directory / "datos.csv").write_text(lines)
    for number in range(pictures):
        assert cv2.imwrite(str(directory / "rgb" / f"{number}.png"), np.full((6, 8, 3), number, np.uint8))
    return directory


def test_an_upstream_log_comes_in_unjudged_with_its_pictures(lab: Lab, tmp_path: Path) -> None:
    log = upstream(
        tmp_path / "log",
        "1700000000.5,chair,['Forward', 'Left', 'Stop'],3\n2024-03-01 10:00:00,bed,\"[1, 2, 4]\",3\n",
        pictures=6,
    )
    episodes = read_upstream_log(log)
    with lab.journal() as journal:
        _, numbers = import_upstream_log(
            journal,
            lab.directory,
            episodes,
            model="vlv",
            site=unsurveyed_site("lab"),
            robot=load_profile("turtlebot2"),
            source=log / "datos.csv",
        )
    first, second = episodes_of(lab)
    assert (first.id, second.id) == numbers
    assert (first.goal, first.end_reason, first.success, first.counts) == ("chair", "stop", None, False)
    assert second.end_reason == "aborted"  # the log has no result, so a person judges the episode
    steps = list(episode_steps(lab.engine(), second.id))
    assert [(one.raw_action, one.action) for one in steps] == [
        ("MOVE_FORWARD", "MOVE_FORWARD"),
        ("TURN_LEFT", "TURN_LEFT"),
        ("LOOK_UP", "MOVE_BACKWARD"),
    ]
    kept = sorted((lab.directory / second.images_directory / "rgb").iterdir())
    assert [path.name for path in kept] == ["0001.jpg", "0002.jpg", "0003.jpg"]
    assert abs(int(cv2.imread(str(kept[0])).mean()) - 3) <= 1  # the fourth image is the first of the second episode
    (one,) = summarise(read(lab.url, Selection())).conditions
    assert (one.total.episodes, measured(one.total, "unjudged")) == (0, 2)
    assert math.isnan(one.total.success_rate)


def test_pictures_whose_names_are_not_numbers_are_ignored(tmp_path: Path) -> None:
    log = upstream(tmp_path / "log", "1,chair,[1],1\n", pictures=1)
    for name in ("²", "1" * 200, "notes"):
        (log / "rgb" / f"{name}.png").write_bytes(b"")
    (episode,) = read_upstream_log(log)
    assert [path.name for path in episode.pictures] == ["0.png"]


def test_a_folder_without_a_log_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"has no datos\.csv"):
        read_upstream_log(tmp_path)


def test_an_episode_that_is_not_there_is_named(lab: Lab) -> None:
    lab.write([Attempt()])
    with pytest.raises(UsageError, match="no ended episode 7"):
        read_episodes(lab.engine(), [7])
    with pytest.raises(UsageError, match="no ended episodes to export"):
        read_episodes(lab.engine(), models=["unknown"])


def imported(lab: Lab, log: Path) -> tuple[int, tuple[int, ...]]:
    with lab.journal() as journal:
        return import_upstream_log(
            journal,
            lab.directory,
            read_upstream_log(log),
            model="vlv",
            site=unsurveyed_site("lab"),
            robot=load_profile("turtlebot2"),
            source=log / "datos.csv",
        )


TWO_EPISODES = "1700000000,chair,['Forward', 'Stop'],2\n1700000100,bed,['Left', 'Stop'],2\n"


def test_an_import_with_one_bad_picture_leaves_nothing_behind_and_can_be_repeated(lab: Lab, tmp_path: Path) -> None:
    log = upstream(tmp_path / "log", TWO_EPISODES, pictures=4)
    last = sorted((log / "rgb").iterdir())[-1]
    good = last.read_bytes()
    last.write_bytes(b"no picture")
    with pytest.raises(RecordError, match="png is not an image; nothing was imported"):
        imported(lab, log)
    with lab.journal() as journal:
        assert list_episodes(journal.engine, EpisodeFilter()) == ()
    assert not (lab.directory / "episodes").exists()
    assert not list(lab.directory.glob(".arrivals.*"))
    last.write_bytes(good)
    _, numbers = imported(lab, log)
    assert len(numbers) == 2
    assert len(list((lab.directory / "episodes").rglob("*.jpg"))) == 4


def test_an_import_that_fails_half_way_writes_neither_rows_nor_files(lab: Lab, tmp_path: Path) -> None:
    log = upstream(tmp_path / "log", TWO_EPISODES, pictures=4)
    (lab.directory / "episodes").mkdir()
    (lab.directory / "episodes" / "000002").write_text("in the way")
    with pytest.raises(RecordError, match="cannot import files"):
        imported(lab, log)
    with lab.journal() as journal:
        assert list_episodes(journal.engine, EpisodeFilter()) == ()
        assert list_campaigns(journal.engine) == ()
    assert sorted(path.name for path in (lab.directory / "episodes").iterdir()) == ["000002"]


def test_a_withdrawn_import_leaves_no_row_and_renames_nothing(lab: Lab, tmp_path: Path) -> None:
    lab.write([Attempt(start=start) for start in range(1, 4)], model="vlv")
    before = build(lab.url, Selection(), activity=False)
    with lab.journal() as journal:
        file = tmp_path / "results.json"
        file.write_text(json.dumps({"episodes": [{"goal": "chair", "success": 1.0, "steps": 50}] * 3}))
        site, protocol = unsurveyed_site("hm3d"), ProtocolParameters(max_actions=500)
        campaign, _ = import_habitat(
            journal, read_habitat(file), model="vlv", site=site, source=file, protocol=protocol
        )
        assert len(build(lab.url, Selection(), activity=False).results.conditions) == 2
        journal.withdraw_import(campaign, author="ada")
    after = build(lab.url, Selection(), activity=False)
    assert after.tables() == before.tables()
    assert [one.condition.name for one in after.results.conditions] == ["vlv"]


def test_an_import_is_withdrawn_whole_and_may_come_again(lab: Lab, tmp_path: Path) -> None:
    file = tmp_path / "results.json"
    file.write_text(json.dumps([{"goal": "chair", "success": 1.0, "steps": 50}] * 3))

    def bring_in() -> int:
        with lab.journal() as journal:
            episodes = read_habitat(file)
            site, protocol = unsurveyed_site("hm3d"), ProtocolParameters(max_actions=500)
            campaign, _ = import_habitat(journal, episodes, model="vlv", site=site, source=file, protocol=protocol)
        return campaign

    def counted() -> int:
        return len(read(lab.url, Selection()).counted())

    campaign = bring_in()
    assert counted() == 3
    with lab.journal() as journal:
        assert journal.withdraw_import(campaign, author="ada", note="the wrong checkpoint") == 3
        with pytest.raises(RecordError, match="no campaign"):
            counted()
        assert journal.withdraw_import(campaign, author="ada") == 0
    assert bring_in() == campaign
    assert counted() == 3
    lab.write([Attempt()])
    with lab.journal() as journal, pytest.raises(UsageError, match="was run here, not imported"):
        journal.withdraw_import(campaign + 1, author="ada")
    with lab.journal() as journal, pytest.raises(UsageError, match="campaign 77"):
        journal.withdraw_import(77, author="ada")
