"""Data collection by people: sessions, journals, ratings and their agreement; independent of pygame."""
