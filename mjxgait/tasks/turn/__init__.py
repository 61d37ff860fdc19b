"""Turn to the left on the spot."""

from mjxgait.kinds import TaskKind

KINDS = (
    TaskKind(
        "turn",
        __name__,
        task="task:Turn",
        criteria="criteria:TurnCriteria",
        what="turn to the left on the spot",
    ),
)
