"""The data card of a data set: README.md for readers and Hugging Face, and Croissant metadata."""
