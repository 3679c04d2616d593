"""Values and arithmetic that every other package uses: geometry, entities, scenes, snapshots, random streams."""
