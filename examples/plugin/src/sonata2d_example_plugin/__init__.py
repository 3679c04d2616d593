"""A template plug-in package for sonata2d: one object of each kind that packages can add."""
