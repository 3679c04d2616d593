"""Damaged and foreign input for every reader and command: `python -m tests.fuzz --count 1000`.

A case damages a valid file (`samples`) in a random way (`mutations`) and gives it to a reader or a command (`targets`).
It must end in success or in a refusal of one line, within seconds and within memory (`runner`).
"""
