"""Pedestrian models, one module each: accelerations of pedestrians from positions, velocities and intentions."""
