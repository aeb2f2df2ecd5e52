"""RgbdFrame -> Scene: the featured-fragment detector of Daeef 2020 and what it needs to be safe."""
