"""What moves a walker: one file per force, each an array function that returns accelerations in m/s2."""
