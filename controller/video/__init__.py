"""The annotated video: what was seen, what was decided and why, how fast the robot went; for people.

moment.py - the data of one picture
seen.py - obstacles in the body frame, as all views name them
corridor.py - the planned path as it is drawn
compose.py - one picture from one moment
style.py, draw.py, text.py, labels.py, picture.py - palette, layout, strokes, text and labels
header.py, colour_view.py, depth_view.py, top_view.py, speed_strip.py, legend.py - the panels
writer.py - pictures into a video file
"""

from controller.video.compose import Composer
from controller.video.moment import VideoMoment
from controller.video.writer import VideoError, VideoWriter

__all__ = ["Composer", "VideoError", "VideoMoment", "VideoWriter"]
