"""Get to a goal: hop there, pass beneath a bar, or travel from goal to goal."""

from mjxgait.kinds import TaskKind

KINDS = (
    TaskKind("hop", __name__, task="task:Hop", criteria="criteria:HopDemands", tables=("hop",)),
    TaskKind(
        "limbo",
        __name__,
        task="limbo:Limbo",
        criteria="criteria:LimboDemands",
        tables=("limbo",),
    ),
    TaskKind(
        "travel",
        __name__,
        task="task:Travel",
        criteria="criteria:TravelDemands",
        tables=("travel",),
    ),
)
