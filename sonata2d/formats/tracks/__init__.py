"""Recorded tracks of people: one reader for all layouts, and episodes made of them."""
