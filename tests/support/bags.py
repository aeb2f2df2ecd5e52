"""Small ROS bags for tests, of either ROS: cameras, transforms and odometry as robots record them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from rosbags import rosbag1, rosbag2
from rosbags.rosbag2.enums import StoragePlugin
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from hal.clocks import NS_PER_S
from hal.types import Intrinsics, RgbdFrame
from tests.support.recordings import small_frame

Format = Literal["bag", "db3", "mcap"]
FORMATS: tuple[Format, ...] = ("bag", "db3", "mcap")

COLOUR, COLOUR_INFO = "/camera/color/image_raw", "/camera/color/camera_info"
DEPTH, DEPTH_INFO = "/camera/depth/image_rect_raw", "/camera/depth/camera_info"
ALIGNED, ALIGNED_INFO = (
    "/camera/aligned_depth_to_color/image_raw",
    "/camera/aligned_depth_to_color/camera_info",
)
ODOMETRY = "/odom"
COLOUR_FRAME, DEPTH_FRAME = "camera_color_optical_frame", "camera_depth_optical_frame"


class Ros:
    """Makes the messages of one ROS: those of ROS 1 have a number in their header, and capitals."""

    def __init__(self, bag_format: Format) -> None:
        self.is1 = bag_format == "bag"
        self.store = get_typestore(Stores.ROS1_NOETIC if self.is1 else Stores.ROS2_HUMBLE)
        if self.is1:
            transforms = "geometry_msgs/TransformStamped[] transforms"
            self.store.register(get_types_from_msg(transforms, "tf2_msgs/msg/TFMessage"))

    def make(self, kind: str, **fields: Any) -> Any:
        return self.store.types[kind](**fields)

    def header(self, stamp_ns: int, frame: str) -> Any:
        stamp = self.make(
            "builtin_interfaces/msg/Time", sec=stamp_ns // NS_PER_S, nanosec=stamp_ns % NS_PER_S
        )
        numbered = {"seq": 0} if self.is1 else {}
        return self.make("std_msgs/msg/Header", stamp=stamp, frame_id=frame, **numbered)

    def image(self, stamp_ns: int, frame: str, encoding: str, pixels: NDArray[Any], padding: int = 0) -> Any:
        """padding: bytes behind each row that mean nothing."""
        height, width = pixels.shape[:2]
        rows = np.ascontiguousarray(pixels).view(np.uint8).reshape(height, -1)
        rows = np.pad(rows, ((0, 0), (0, padding)), constant_values=0xEE)
        return self.make(
            "sensor_msgs/msg/Image",
            header=self.header(stamp_ns, frame),
            height=height,
            width=width,
            encoding=encoding,
            is_bigendian=int(pixels.dtype.byteorder == ">"),
            step=rows.shape[1],
            data=rows.ravel(),
        )

    def compressed(self, stamp_ns: int, frame: str, described: str, data: bytes) -> Any:
        return self.make(
            "sensor_msgs/msg/CompressedImage",
            header=self.header(stamp_ns, frame),
            format=described,
            data=np.frombuffer(data, np.uint8),
        )

    def info(
        self,
        frame: str,
        camera: Intrinsics,
        distortion: Sequence[float] = (),
        model: str = "plumb_bob",
    ) -> Any:
        k = np.array([camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0])
        p = np.insert(k, [3, 6, 9], 0.0)
        matrices = {"d": np.array(distortion, np.float64), "k": k, "r": np.eye(3).ravel(), "p": p}
        region = self.make(
            "sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False
        )
        return self.make(
            "sensor_msgs/msg/CameraInfo",
            header=self.header(0, frame),
            height=camera.height,
            width=camera.width,
            distortion_model=model,
            **{name.upper() if self.is1 else name: value for name, value in matrices.items()},
            binning_x=0,
            binning_y=0,
            roi=region,
        )

    def pose(self, position: Sequence[float], quaternion: Sequence[float]) -> tuple[Any, Any]:
        """(Point or Vector3 fields, Quaternion)."""
        x, y, z, w = quaternion
        return dict(zip("xyz", position, strict=True)), self.make(
            "geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w
        )

    def transform(
        self, parent: str, child: str, position: Sequence[float], quaternion: Sequence[float]
    ) -> Any:
        at, turn = self.pose(position, quaternion)
        transform = self.make(
            "geometry_msgs/msg/Transform",
            translation=self.make("geometry_msgs/msg/Vector3", **at),
            rotation=turn,
        )
        stamped = self.make(
            "geometry_msgs/msg/TransformStamped",
            header=self.header(0, parent),
            child_frame_id=child,
            transform=transform,
        )
        return self.make("tf2_msgs/msg/TFMessage", transforms=[stamped])

    def text(self, data: str) -> Any:
        return self.make("std_msgs/msg/String", data=data)

    def imu(self, stamp_ns: int, frame: str, rates_radps: Sequence[float]) -> Any:
        x, y, z = rates_radps
        level = self.make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
        return self.make(
            "sensor_msgs/msg/Imu",
            header=self.header(stamp_ns, frame),
            orientation=level,
            orientation_covariance=np.zeros(9),
            angular_velocity=self.make("geometry_msgs/msg/Vector3", x=x, y=y, z=z),
            angular_velocity_covariance=np.zeros(9),
            linear_acceleration=self.make("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0),
            linear_acceleration_covariance=np.zeros(9),
        )

    def odometry(
        self, stamp_ns: int, position: Sequence[float], quaternion: Sequence[float], child: str = "base_link"
    ) -> Any:
        at, turn = self.pose(position, quaternion)
        zero = self.make("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
        pose = self.make(
            "geometry_msgs/msg/Pose",
            position=self.make("geometry_msgs/msg/Point", **at),
            orientation=turn,
        )
        return self.make(
            "nav_msgs/msg/Odometry",
            header=self.header(stamp_ns, "odom"),
            child_frame_id=child,
            pose=self.make("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=np.zeros(36)),
            twist=self.make(
                "geometry_msgs/msg/TwistWithCovariance",
                twist=self.make("geometry_msgs/msg/Twist", linear=zero, angular=zero),
                covariance=np.zeros(36),
            ),
        )


Entry = tuple[str, int, Any]
"""Topic, time of arrival in nanoseconds, message."""


def write_bag(folder: Path, bag_format: Format, entries: Callable[[Ros], Sequence[Entry]]) -> Path:
    """A bag with these entries in their order. Returns the file or, of ROS 2, the folder."""
    ros = Ros(bag_format)
    path = folder / ("run.bag" if bag_format == "bag" else f"run_{bag_format}")
    if bag_format == "bag":
        writer: Any = rosbag1.Writer(path)
    else:
        plugin = StoragePlugin.MCAP if bag_format == "mcap" else StoragePlugin.SQLITE3
        writer = rosbag2.Writer(path, version=9, storage_plugin=plugin)
    with writer:
        connections: dict[str, Any] = {}
        for topic, stamp_ns, message in entries(ros):
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=ros.store)
            serialize = ros.store.serialize_ros1 if ros.is1 else ros.store.serialize_cdr
            writer.write(connections[topic], stamp_ns, serialize(message, kind))
    return path


def camera_entries(ros: Ros, frames: Sequence[RgbdFrame]) -> list[Entry]:
    """As a driver records them with depth aligned to colour. The depth must be in millimetres."""
    camera, first_ns = frames[0].intrinsics, frames[0].captured_ns
    info = ros.info(COLOUR_FRAME, camera)
    entries: list[Entry] = [(COLOUR_INFO, first_ns, info), (ALIGNED_INFO, first_ns, info)]
    for frame in frames:
        stamp_ns = frame.captured_ns
        depth = ros.image(stamp_ns, COLOUR_FRAME, "16UC1", frame.depth)
        colour = ros.image(stamp_ns, COLOUR_FRAME, "bgr8", frame.colour)
        entries += [(ALIGNED, stamp_ns, depth), (COLOUR, stamp_ns, colour)]
    return entries


def small_bag(folder: Path, bag_format: Format = "mcap", count: int = 4) -> Path:
    """Of tests.support.recordings.small_frame, without odometry."""
    return write_bag(
        folder, bag_format, lambda ros: camera_entries(ros, [small_frame(n) for n in range(count)])
    )


def without(entries: list[Entry], *topics: str) -> list[Entry]:
    return [entry for entry in entries if entry[0] not in topics]
