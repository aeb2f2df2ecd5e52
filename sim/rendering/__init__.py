"""What an RGB-D camera in a simulated world reports, and the ground truth of it.

camera.py - the camera: exposes frames at fixed times
faulty_camera.py - the same camera with faults: no frames, frozen frames, glass
late_camera.py - and with late frames, in real time
render.py - one noiseless picture: colour, inverse depth and labels
spans.py, raster.py - which face is seen at each pixel
shade.py - the colour of each pixel
shadow.py - soft shadows on the floor
own_parts.py - parts of the robot that its camera sees
antialias.py - smooth edges
depth_noise.py, colour_noise.py - what the sensors add
truth.py - ground truth of a picture, for evaluation
"""
