"""The compiled part of the tick: engine calls, the robot's drive and safety guard, physics substeps, posture."""
