"""What a check found, and what the runs are without it."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from drake_ispace.explain.check.compare.links import FEWEST
from drake_ispace.explain.check.compare.motion import WINDOW_S
from drake_ispace.explain.check.finding import Finding, headline, serious
from drake_ispace.faults.repair import CutOut, parts, repaired
from drake_ispace.files.recording import Recording

_SHORTEST_S = FEWEST * WINDOW_S  # part of a run that is kept: one that can be compared


@dataclass(frozen=True)
class Checked:
    """What was found.

    Attributes:
        names: of the runs. findings: on whole runs, then on stretches of time; of each those that one channel shows
            by itself, then the surest first. repaired: the runs after all repairs but cuts. made: the findings in the
            order in which they were made, as each repair is of what those before left. compared: whether any channel of
            any run was compared with the wheels.
    """

    names: list[str]
    findings: list[Finding]
    repaired: list[Recording] = field(repr=False)
    made: list[Finding] = field(repr=False, default_factory=list)
    compared: bool = True

    def __str__(self) -> str:
        return "\n".join([headline(self.findings, self.compared), *(f"  {finding}" for finding in self.findings)])

    @property
    def serious(self) -> list[Finding]:
        """Findings on whole runs in spite of which no model can be judged."""
        return serious(self.findings)

    @property
    def limited(self) -> list[Finding]:
        """Findings on stretches of time."""
        return [finding for finding in self.findings if finding.limited]

    def masked(self, runs: Sequence[Recording]) -> list[list[Recording]]:
        """The runs after the repairs of all that is not serious, each as the parts that remain of it."""
        bearable = [finding for finding in self.made if finding.limited or finding.is_bearable]
        return [self._parts(i, self._repaired(i, run, bearable), self.limited) for i, run in enumerate(runs)]

    def repaired_parts(self) -> list[list[Recording]]:
        """The runs after all repairs, each as the parts that remain of it."""
        return [self._parts(i, run, self.findings) for i, run in enumerate(self.repaired)]

    def _repaired(self, i, run, findings):
        return repaired(run, (repair for finding in findings if i in finding.runs for repair in finding.repairs))

    def _parts(self, i, run, findings):
        cuts = [r for f in findings if i in f.runs for r in f.repairs if isinstance(r, CutOut)]
        return parts(run, cuts, _SHORTEST_S) if cuts else [run]
