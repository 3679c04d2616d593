"""Pedestrians: the crowd, wayfinding, reactions to the robot, and orientation of body and head."""
