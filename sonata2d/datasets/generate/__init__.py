"""Generation of data sets: start, runs, progress, and resumption."""
