"""Configuration: YAML to frozen models. What is unknown, missing or impossible is refused.

loader.py - reads a YAML file and reports its mistakes in one line; base class of all sections
known_keys.py - names the place of a mistake and suggests the key that was meant
app.py - the whole configuration of `treadwatch run`, `govern` and `replay`, and what must fit together
robot.py - body, limits and camera mount of the robot
camera.py - which camera, with its settings
own_parts.py - parts of the robot that its camera sees
chassis.py - which chassis, and the link to it
agilex.py - models of AgileX bases, with their top speeds
chassis_checks.py - what must fit between chassis, limits and control rate
plant.py - the simulated base behind an emulator
perception.py - detection, ego-motion and tracking
decision.py - margins, prediction, sight and release of the decision
path.py - the planned path: start pose, lines and arcs
governor.py - commands of another planner in place of a path
scenario.py - a simulated world
faults.py - what goes wrong in it
recording.py - camera.yaml of a recording
"""
