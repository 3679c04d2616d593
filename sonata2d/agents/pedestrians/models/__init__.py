"""Pedestrian models, one file each: how walkers accelerate."""
