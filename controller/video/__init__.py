"""The annotated video: what was seen, what was decided and why, how fast the robot went; for people."""

from controller.video.compose import Composer
from controller.video.moment import VideoMoment
from controller.video.writer import VideoError, VideoWriter

__all__ = ["Composer", "VideoError", "VideoMoment", "VideoWriter"]
