"""MCAP files and bags, written by the public libraries."""

import numpy as np
import pytest
import somebodys_robot as somebody

from drake_ispace.blocks.errors import InputError
from drake_ispace.logs.bags import read_bag, topics_of
from drake_ispace.logs.convert import convert
from drake_ispace.logs.mapping import load_mapping
from drake_ispace.logs.sniff import sniff

pytest.importorskip("mcap", reason="needs the extra [logs]")
pytest.importorskip("rosbags", reason="needs the extra [logs]")

KINDS = ("public.mcap", "run", "run.bag")
MAPPING = """
format: drake-ispace-mapping/1
robot: {{kind: differential, wheel_diameter_m: 0.1, track_m: 0.3}}
channels:
  encoder:
    file: {file}
    topic: /joint_states
    t: {{column: header.stamp}}
    columns: {{theta_right: "position[right_wheel]", theta_left: "position[left_wheel]"}}
  kinect:
    file: {file}
    topic: /mocap
    clock: camera
    t: {{column: header.stamp}}
    columns:
      x: pose.position.x
      y: pose.position.y
      phi: {{quaternion: [pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w]}}
clocks: {{camera: {{offset_s: 1000.08}}}}
"""


def messages(store):
    """(topic, kind, time [s], message) of run 1, in order of time."""
    packages = {"JointState": "sensor_msgs", "Header": "std_msgs", "Time": "builtin_interfaces"}
    kinds = {
        name: store.types[f"{packages.get(name, 'geometry_msgs')}/msg/{name}"]
        for name in ("JointState", "Header", "Time", "PoseStamped", "Pose", "Point", "Quaternion")
    }

    def header(t):
        ns, extra = round(t * 1e9), {"seq": 0} if "seq" in kinds["Header"].__dataclass_fields__ else {}
        return kinds["Header"](stamp=kinds["Time"](sec=ns // 10**9, nanosec=ns % 10**9), frame_id="map", **extra)

    found = []
    uptime_ms, _, stamps, poses = somebody.samples(1, seconds=10.0)
    _, angles, _ = somebody.cart(1, seconds=10.0)
    for ms, own in zip(uptime_ms, angles[::20], strict=True):
        t = somebody.EPOCH_S + ms / 1e3
        found.append(("/joint_states", "sensor_msgs/msg/JointState", t, kinds["JointState"](
            header=header(t), name=["left_wheel", "right_wheel"], position=own.copy(), velocity=np.zeros(2),
            effort=np.zeros(2),
        )))
    for t, (x, y, phi) in zip(stamps + somebody.UPTIME_S, poses, strict=True):
        found.append(("/mocap", "geometry_msgs/msg/PoseStamped", t, kinds["PoseStamped"](header=header(t), pose=kinds[
            "Pose"](position=kinds["Point"](x=x, y=y, z=0.1), orientation=kinds["Quaternion"](
                x=0.0, y=0.0, z=np.sin(phi / 2), w=np.cos(phi / 2))))))
    return sorted(found, key=lambda message: message[2])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the same run as MCAP by the public library, as a ROS 2 bag, and as a ROS 1 bag."""
    from mcap.writer import Writer
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    folder = tmp_path_factory.mktemp("bags")
    two, one = get_typestore(Stores.ROS2_HUMBLE), get_typestore(Stores.ROS1_NOETIC)
    with (folder / "public.mcap").open("wb") as stream:
        writer, channels = Writer(stream), {}
        writer.start("ros2", "test")
        for topic, kind, t, message in messages(two):
            if topic not in channels:
                schema = writer.register_schema(kind, "ros2msg", two.generate_msgdef(kind, ros_version=2)[0].encode())
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            ns = round(t * 1e9)
            writer.add_message(channels[topic], ns, bytes(two.serialize_cdr(message, kind)), ns)
        writer.finish()
    for writer, store, write in (
        (Writer2(folder / "run", version=9, storage_plugin=StoragePlugin.MCAP), two, two.serialize_cdr),
        (Writer1(folder / "run.bag"), one, one.serialize_ros1),
    ):
        with writer:
            connections = {}
            for topic, kind, t, message in messages(store):
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=store)
                writer.write(connections[topic], round(t * 1e9), write(message, kind))
    return folder


def converted(folder, file, said=None):
    (folder / "mapping.yaml").write_text(MAPPING.format(file=file))
    return convert(load_mapping(folder / "mapping.yaml"), folder, (said if said is not None else []).append)


@pytest.mark.parametrize("file", KINDS)
def test_a_bag_gives_the_same_recording_as_its_numbers(folder, file):
    recording = converted(folder, file)
    _, angles, _ = somebody.cart(1, seconds=10.0)
    _, _, stamps, poses = somebody.samples(1, seconds=10.0)
    encoder, kinect = recording.channels["encoder"], recording.channels["kinect"]
    assert np.array_equal(encoder.column("theta_left"), angles[::20, 0])
    assert np.array_equal(kinect.column("x"), poses[:, 0])
    assert kinect.column("phi") == pytest.approx(poses[:, 2], abs=1e-12)
    assert kinect.t - encoder.t[0] == pytest.approx(stamps - 1000.0 - somebody.EPOCH_S - 0.08, abs=1e-6)


@pytest.mark.parametrize("file, is_said", [("public.mcap", False), ("run.bag", True)])
def test_a_bag_without_checksums_is_said_to_have_none(folder, file, is_said):
    said = []
    converted(folder, file, said)
    assert any("has no checksums" in sentence for sentence in said) == is_said


@pytest.mark.parametrize("file", KINDS)
def test_topics_are_listed_with_their_numbers(folder, file):
    topics = topics_of(folder / file)
    assert topics["/joint_states"].count == 500 and "position[left_wheel]" in topics["/joint_states"].numbers
    assert {"header.stamp", "pose.position.x", "pose.orientation.w"} <= set(topics["/mocap"].numbers)


@pytest.mark.parametrize("file", KINDS)
def test_a_mapping_is_proposed(folder, file, tmp_path):
    text = sniff([folder / file])
    assert 'theta_left: {column: "position[left_wheel]", unit: rad}' in text
    assert "quaternion: [pose.orientation.x" in text


def test_damage_is_noticed(folder, tmp_path):
    wanted, data = converted(folder, "public.mcap"), (folder / "public.mcap").read_bytes()
    rng = np.random.default_rng(0)
    for trial in range(40):
        damaged = bytearray(data)
        damaged[rng.integers(len(data))] ^= 1 << rng.integers(8)
        (tmp_path / "public.mcap").write_bytes(damaged[: rng.integers(len(data))] if trial % 4 == 3 else damaged)
        try:
            found = converted(tmp_path, "public.mcap")
        except InputError:
            continue
        for name, channel in wanted.channels.items():
            assert np.array_equal(found.channels[name].values, channel.values)
            assert np.array_equal(found.channels[name].t, channel.t)


@pytest.mark.parametrize("topic, field, message", [
    ("/joint", "header.stamp", "did you mean '/joint_states'"),
    ("/joint_states", "name", "is no number"),
    ("/joint_states", "position[", "expected a path"),
    ("/joint_states", "header.frame_id", "is no number"),
])
def test_a_path_that_leads_to_no_number_is_refused(folder, topic, field, message):
    with pytest.raises(InputError, match=r"public\.mcap") as refusal:
        read_bag(folder / "public.mcap", topic, [field])
    assert message in str(refusal.value)


def test_what_a_message_lacks_is_no_number(folder):
    lacking = ["position[middle]", "position[7]", "no.such"]
    series = read_bag(folder / "public.mcap", "/joint_states", [*lacking, "log_time"])
    assert all(np.isnan(series.columns[name]).all() for name in lacking)
    assert len(series) == 500 and series.columns["log_time"][0] == pytest.approx(somebody.EPOCH_S + somebody.UPTIME_S)
