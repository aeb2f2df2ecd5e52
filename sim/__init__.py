"""The simulated outside: a world, an RGB-D camera in it, and chassis emulators that speak the real protocols.

families/ - seeded generators of scenarios
models/ - shapes, bodies and textures
motion.py - where a moving body is at any time
world.py - all faces and bodies of a scenario at any time
planar.py - the same world from above, without faces
polygons.py - distances of convex polygons
plant.py - the motion of a tracked base
emulators/ - chassis at the other end of a link, each with a plant
rendering/ - the camera's images of a world, and their ground truth
contact.py - exact clearance between the robot and everything else
simulation.py - emulator and world in one object, with a referee for contacts
preview.py - draws a scenario as a PNG
"""
