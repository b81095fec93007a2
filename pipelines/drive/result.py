"""What one processed drive is, before it is written: the hand-over from processing to report, recording and export."""

from dataclasses import dataclass, field

from importers.preflight.checks import Finding
from navreplay.evaluation.metrics import Evaluation
from navreplay.evaluation.sky import Sky
from navreplay.evaluation.verdict import Verdict
from navreplay.solution import Solution
from navreplay.timeline import Timeline
from pipelines.config.spec import Config
from pipelines.drive.advice import Advice

__all__ = ["RunResult"]


@dataclass(frozen=True, eq=False, slots=True)
class RunResult:
    """timeline: as imported, before fixes were withheld (reference included). used: what the filter saw. solution: of the IMU,
    or of `output_point` where the configuration says so. evaluation: None without a reference. verdict: on the
    solution. advice: None where no other setting was tried. sky: None where no ranges aided. timing_s: seconds per stage."""

    config: Config
    timeline: Timeline
    used: Timeline
    solution: Solution
    evaluation: Evaluation | None
    verdict: Verdict
    advice: Advice | None = None
    sky: Sky | None = None
    findings: tuple[Finding, ...] = ()
    timing_s: dict[str, float] = field(default_factory=dict)
