"""Files and folders: locations, checked reading, whole writing, archives, locks, limits and interruption."""
