"""Get to a goal: hop there, pass beneath a bar, or travel from goal to goal."""

from mjxgait.kinds import TaskKind

KINDS = (
    TaskKind(
        "hop",
        __name__,
        task="task:Hop",
        criteria="criteria:HopCriteria",
        tables=("hop",),
        what="get to a goal",
    ),
    TaskKind(
        "limbo",
        __name__,
        task="limbo:Limbo",
        criteria="criteria:LimboCriteria",
        tables=("limbo",),
        what="get to a goal beneath a bar",
    ),
    TaskKind(
        "travel",
        __name__,
        task="task:Travel",
        criteria="criteria:TravelCriteria",
        tables=("travel",),
        what="get from goal to goal",
    ),
)
