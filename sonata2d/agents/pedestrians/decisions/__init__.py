"""Decisions of pedestrians, as kernels."""
