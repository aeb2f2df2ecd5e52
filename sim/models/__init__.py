"""Shapes, bodies and textures of the simulated world.

mesh.py - faces, boxes and prisms
building.py - the hall
rack.py, person.py, vehicle.py - racks, people and other robots
outlines.py - the footprint and the heights of each kind of body of a scenario
bodies.py - its faces
paint.py - colours and noise for textures
paint_building.py, paint_goods.py, paint_movers.py, paint_rack.py - draw the textures
textures.py - textures by key, and their smaller versions
"""
