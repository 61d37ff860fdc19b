"""What bodies that grow do (Sims 1994): swim, walk, jump, follow a light; or each on command."""

from functools import partial

from mjxgait.kinds import TaskKind

_kind = partial(TaskKind, home=__name__, modular=True)
KINDS = (
    _kind(
        "swim",
        task="swim:Swim",
        criteria="criteria:SwimCriteria",
        water=True,
        tables=("swim",),
        what="swim far; for bodies that grow",
    ),
    _kind(
        "roam",
        task="roam:Roam",
        criteria="criteria:RoamCriteria",
        called="walk",
        tables=("roam",),
        what="get far on land; `--task walk` for bodies that grow",
    ),
    _kind(
        "jump",
        task="jump:Jump",
        criteria="criteria:JumpCriteria",
        tables=("jump",),
        what="jump high; for bodies that grow",
    ),
    _kind(
        "follow",
        task="follow:FollowInWater",
        criteria="follow_criteria:in_water",
        water=True,
        tables=("swim", "roam", "follow"),
        what="swim to a light that moves; for bodies that grow",
    ),
    _kind(
        "follow-on-land",
        task="follow:FollowOnLand",
        criteria="follow_criteria:on_land",
        tables=("roam", "follow"),
        what="follow a light on land; for bodies that grow",
    ),
    _kind(
        "compete",
        task="compete:Compete",
        criteria="compete_criteria:CompeteCriteria",
        tables=("compete",),
        what="be nearer to a cube than an opponent; for bodies that grow",
    ),
    _kind(
        "amphibian",
        task="skills:Amphibian",
        criteria="skills_criteria:amphibian",
        water=True,
        tables=("swim", "roam"),
        skills=("swim", "roam"),
        what="swim and walk, on command; for bodies that grow",
    ),
    _kind(
        "all-trades",
        task="skills:AllTrades",
        criteria="skills_criteria:all_trades",
        water=True,
        tables=("swim", "roam", "jump", "follow"),
        skills=("swim", "roam", "jump", "follow"),
        what="swim, walk, jump and follow a light, on command; for bodies that grow",
    ),
)
