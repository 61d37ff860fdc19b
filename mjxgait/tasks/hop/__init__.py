"""Get to a goal: hop there, pass beneath a bar, or travel from goal to goal."""

from mjxgait.kinds import TaskKind

KINDS = (
    TaskKind("hop", __name__, task="task:Hop", criteria="criteria:HopCriteria", tables=("hop",)),
    TaskKind(
        "limbo",
        __name__,
        task="limbo:Limbo",
        criteria="criteria:LimboCriteria",
        tables=("limbo",),
    ),
    TaskKind(
        "travel",
        __name__,
        task="task:Travel",
        criteria="criteria:TravelCriteria",
        tables=("travel",),
    ),
)
