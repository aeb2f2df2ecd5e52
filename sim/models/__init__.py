"""What the simulated world is made of: shapes, bodies, and the materials they are painted with."""
