"""Episodes in words: instructions, sentences, questions with answers, and their export for language models."""
