"""Walk forward, in a gait, at a speed or on a turn that may be requested."""

from mjxgait.kinds import TaskKind

KINDS = (
    TaskKind(
        "walk",
        __name__,
        task="task:Walk",
        criteria="criteria:WalkCriteria",
        what="walk forward, at a speed, in a gait, on a turn",
    ),
)
