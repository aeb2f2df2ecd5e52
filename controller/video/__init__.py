"""The annotated video: what was seen, what was decided and why, how fast the robot went; for people.

moment.py - the data of one picture
seen_obstacles.py - obstacles in the body frame, as all views name them
corridor.py - the planned path as it is drawn
own_parts.py - the outlines of what the camera sees of the robot itself
compose.py - one picture from one moment
style.py, draw.py, text.py, labels.py, placement.py - palette, strokes, text, labels and layout
header.py, colour_view.py, depth_view.py, top_view.py, speed_strip.py, legend.py - the panels
pace.py - each picture as often as its time needs, so that the video plays in real time
writer.py, disk_reservation.py - pictures into a video file
"""

from controller.video.compose import Composer
from controller.video.moment import VideoMoment
from controller.video.writer import VideoError, VideoWriter

__all__ = ["Composer", "VideoError", "VideoMoment", "VideoWriter"]
