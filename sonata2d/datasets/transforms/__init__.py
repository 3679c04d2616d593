"""Data sets made of data sets: mirror images, splits and merged data sets."""
