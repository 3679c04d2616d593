"""A template plug-in package for sonata2d: one controller, pedestrian model, format, metric and room kind."""
