"""The table of outcomes."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field


@dataclass
class Row:
    """Outcomes of one command under one kind of fault.

    Attributes:
        fault: kind of fault.
        command: the command.
        outcomes: number of runs by outcome.
        faults: what went wrong, one text for each run that did.
    """

    fault: str
    command: str
    outcomes: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)

    def add(self, outcome: str, fault: str) -> None:
        """Add a run: its outcome, and what went wrong; empty if nothing did."""
        if fault:
            self.faults.append(fault)
        else:
            self.outcomes[outcome] += 1

    def __str__(self) -> str:
        outcomes = ", ".join(f"{count} {name}" for name, count in sorted(self.outcomes.items()))
        wrong = f"{len(self.faults)}: {self.faults[0]}" if self.faults else "none"
        return f"| {self.fault} | {self.command} | {outcomes} | {wrong} |"


HEADER = "| fault | command | outcomes | went wrong |\n| --- | --- | --- | --- |"
