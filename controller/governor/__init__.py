"""The speed governor: another planner asks for (v, w), treadwatch decides how much of it is safe."""
