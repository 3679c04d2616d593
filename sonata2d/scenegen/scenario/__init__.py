"""Scenario settings: the pydantic models of a scenario file, and how it is loaded."""
