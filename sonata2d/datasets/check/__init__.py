"""Checks of episode files and data sets, and runs of recorded episodes again."""
