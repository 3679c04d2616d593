"""Scenario settings: the pydantic models of a scenario file, and the functions that load it."""
