"""Walking models: what each law makes of the people around. One file a preset; forces are in `agents.forces`."""
