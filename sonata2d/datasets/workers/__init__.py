"""Worker processes of this machine, and executors of clusters."""
