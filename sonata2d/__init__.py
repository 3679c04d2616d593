"""sonata2d: labelled, reproducible social-navigation data sets from a light 2-D simulator."""
