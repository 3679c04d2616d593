"""Pedestrians: the crowd, wayfinding, reactions to the robot and body orientation."""
