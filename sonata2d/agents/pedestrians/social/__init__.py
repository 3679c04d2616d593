"""Social behaviour: conversations, visits to objects, and formations."""
