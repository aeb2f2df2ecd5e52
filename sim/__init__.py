"""The outside, simulated: world, RGB-D renderer, chassis emulators that speak the real protocols."""
