"""The simulation: the pymunk world, the robot's safety guard, and the episode loop."""
