"""Finds the gyro in a ROS bag, and turns its readings into the optical axes of the colour camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from os.path import commonpath

import numpy as np

from hal.cameras.bag_exposures import Exposures
from hal.cameras.bag_file import BagFile, Topic, until_damage
from hal.cameras.bag_realsense import stream_of
from hal.cameras.bag_topics import list_names, named_topic
from hal.cameras.bag_transforms import StaticTransforms, frame_name
from hal.cameras.gyro_track import GyroTrack
from hal.errors import BadRecording
from hal.types import FloatArray

_IMU = "sensor_msgs/msg/Imu"
_GYRO, _ACCELEROMETER = "gyro", "accel"
_NOT_MEASURED = -1.0  # in the first place of a covariance (sensor_msgs/Imu)


@dataclass(frozen=True, slots=True)
class ColourCamera:
    """The camera whose gyro is looked for: its topic, its frame, and whose times it has (see Exposures)."""

    topic: str
    frame: str
    clock: str | None


def read_gyro(
    bag: BagFile, wanted: str | None, camera: ColourCamera, transforms: StaticTransforms
) -> tuple[GyroTrack | None, tuple[str, ...]]:
    """(the gyro's readings, notes for the summary); no track if there is none that can be used.

    wanted: the topic that the user chose; None: to be found. Raises BadRecording if wanted is not there, or
    cannot be used.
    """
    imus = [topic for topic in bag.topics if topic.kind == _IMU]
    if wanted is not None:
        return _track(bag, named_topic(bag.path, imus, wanted, "gyro").name, camera, transforms), ()
    best = _nearest(imus, camera.topic)
    if not best:
        return None, ()
    if len(best) > 1:
        return None, (f"several topics could be the gyro: {list_names(best)}; choose one with --gyro-topic",)
    try:
        return _track(bag, best[0].name, camera, transforms), ()
    except BadRecording as error:
        return None, (f"the gyro is not used: {error}",)


def _nearest(imus: Sequence[Topic], colour_topic: str) -> list[Topic]:
    """The topics whose names are most like that of the camera's gyro; several if they are equally like it."""
    ranked: dict[Topic, tuple[int, bool]] = {}
    for topic in imus:
        name = topic.name.lower()
        if _ACCELEROMETER not in name:
            ranked[topic] = (len(commonpath((colour_topic, topic.name))), _GYRO in name)
    return [topic for topic in ranked if ranked[topic] == max(ranked.values())]


def _track(bag: BagFile, topic: str, camera: ColourCamera, transforms: StaticTransforms) -> GyroTrack:
    """Raises BadRecording if the gyro's clock or axes are not those of the camera, or a reading is none."""
    exposures = Exposures(bag, (topic,))
    if exposures.clock != camera.clock:
        raise BadRecording(
            f"{bag.path}: {topic}: its times are of another clock than those of the images "
            f"({exposures.clock or 'headers'}, {camera.clock or 'headers'}); replay with --no-gyro"
        )
    stamps_ns: list[int] = []
    rates: list[tuple[float, float, float]] = []
    frame = ""
    for _, message in until_damage(bag.messages((topic,))):
        if message.angular_velocity_covariance[0] == _NOT_MEASURED:
            raise BadRecording(f"{bag.path}: {topic}: has no angular velocity; choose another --gyro-topic")
        frame, rate = frame_name(message.header.frame_id), message.angular_velocity
        stamps_ns.append(exposures.stamp_ns(topic, message))
        rates.append((rate.x, rate.y, rate.z))
    rates_radps = np.array(rates, np.float64).reshape(-1, 3)
    if not np.isfinite(rates_radps).all():
        raise BadRecording(
            f"{bag.path}: {topic}: holds readings that are not finite; leave it out: --no-gyro"
        )
    rotation = _rotation(bag, topic, frame, camera, transforms)
    return GyroTrack(topic, np.array(stamps_ns, np.int64), rates_radps @ rotation.T)


def _rotation(
    bag: BagFile, topic: str, frame: str, camera: ColourCamera, transforms: StaticTransforms
) -> FloatArray:
    """(3, 3), from the gyro's axes to those of the camera. Raises BadRecording if it is not known."""
    stream = stream_of(topic)
    for name in (frame, stream):
        in_camera = transforms.find(camera.frame, name) if name else None
        if in_camera is not None:
            return in_camera.rotation
    if stream and stream_of(camera.topic):
        # In a RealSense, the housing aligns the two to within a degree, and its viewer does not record how.
        return np.eye(3)
    raise BadRecording(
        f"{bag.path}: {topic}: how {frame or 'its frame'} is turned to {camera.frame} was not recorded in "
        "/tf_static; record it, or replay with --no-gyro"
    )
