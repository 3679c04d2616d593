"""Scenarios from floor plans: maps of ROS, images, SVG and DXF drawings."""
