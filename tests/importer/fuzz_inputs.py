"""Broken, hostile and absurd inputs, the same every time.

Each is a name, a kind of file and its text.
"""

import random
import re
from collections.abc import Iterator

from importer.models import BIPED, QUADRUPED

Input = tuple[str, str, bytes]
NUMBER = re.compile(r"(?<=[\" ])-?[0-9][0-9.e-]*(?=[\" ])")
ABSURD = [
    "nan",
    "inf",
    "-inf",
    "1e308",
    "-1e308",
    "1e-320",
    "0",
    "-1",
    "",
    "x",
    "1 2",
    "0x10",
    "9" * 400,
    "1e9",
    "٣",
]
WORDS = [
    "",
    "nothing",
    "mesh",
    "free",
    "ball",
    "slide",
    "hfield",
    "plane",
    "world",
    "\\",
    "../..",
    "%s%n",
    "${x}",
    "💥",
    "a" * 5000,
]


def model_inputs() -> Iterator[Input]:
    """Variants of the two animals, and files that nobody would write in good faith."""
    for kind, text in (("xml", QUADRUPED), ("urdf", BIPED)):
        rng = random.Random(kind)
        for i in range(40):
            yield f"{kind}-cut-{i}", kind, text.encode()[: len(text) * i // 40]
        for i in range(60):
            yield f"{kind}-number-{i}", kind, _replace_number(text, rng).encode()
        for i in range(40):
            yield f"{kind}-attribute-{i}", kind, _change_attribute(text, rng).encode()
        for i in range(30):
            yield f"{kind}-line-{i}", kind, _shuffle_lines(text, rng).encode()
        for i in range(30):
            yield f"{kind}-byte-{i}", kind, _flip_bytes(text.encode(), rng)
    for name, (kind, text) in HOSTILE.items():
        yield name, kind, text.encode("utf-8", "surrogatepass")


def _replace_number(text: str, rng: random.Random) -> str:
    for _ in range(rng.choice([1, 1, 2, 5])):
        found = rng.choice(list(NUMBER.finditer(text)))
        text = text[: found.start()] + rng.choice(ABSURD) + text[found.end() :]
    return text


def _change_attribute(text: str, rng: random.Random) -> str:
    found = rng.choice(list(re.finditer(r'(\w+)="([^"]*)"', text)))
    new = rng.choice(
        [
            "",
            f'{rng.choice(["pos", "mass", "quat", "axis", "type", "name"])}="{found[2]}"',
            f'{found[1]}="{rng.choice(WORDS)}"',
        ]
    )
    return text[: found.start()] + new + text[found.end() :]


def _shuffle_lines(text: str, rng: random.Random) -> str:
    lines = text.splitlines()
    a, b = rng.randrange(len(lines)), rng.randrange(len(lines))
    match rng.randrange(3):
        case 0:
            lines.insert(a, lines[b])
        case 1:
            del lines[a]
        case _:
            lines[a], lines[b] = lines[b], lines[a]
    return "\n".join(lines)


def _flip_bytes(data: bytes, rng: random.Random) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.choice([1, 3, 20])):
        changed[rng.randrange(len(changed))] = rng.randrange(256)
    return bytes(changed)


def _with(body: str = "", asset: str = "", head: str = "") -> str:
    text = QUADRUPED.replace("<worldbody>", f"{head}<worldbody>{body}")
    return text.replace("<asset>", f"<asset>{asset}")


SECRETS = [
    "/secret.stl",
    "../outside/secret.stl",
    "{outside}/secret.stl",
    "link.stl",
    "a/../../outside/secret.stl",
    "file://{outside}/secret.stl",
]
BOMB = (
    '<!DOCTYPE a [<!ENTITY b "'
    + "c" * 1000
    + '">'
    + "".join(f'<!ENTITY b{i} "&b;&b;&b;&b;">' for i in range(8))
    + "]><mujoco>&b7;</mujoco>"
)
HOSTILE: dict[str, tuple[str, str]] = {
    "empty": ("xml", ""),
    "zero-bytes": ("xml", "\0" * 1000),
    "not-a-model": ("xml", "<html><body/></html>"),
    "text": ("urdf", "solid robot"),
    "entity-bomb": ("xml", BOMB),
    "external-entity": ("xml", '<!DOCTYPE a [<!ENTITY x SYSTEM "file:///etc/passwd">]><mujoco model="&x;"/>'),
    "deep": ("xml", "<mujoco><worldbody>" + "<body>" * 5000 + "</body>" * 5000 + "</worldbody></mujoco>"),
    "many": ("xml", "<mujoco><worldbody>" + "<body/>" * 50_000 + "</worldbody></mujoco>"),
    "replicate": ("xml", _with('<replicate count="1000000000"><body><geom size="1"/></body></replicate>')),
    "nested-replicate": ("xml", _with('<replicate count="60">' * 4 + '<geom size="1"/>' + "</replicate>" * 4)),
    "memory": ("xml", _with(head='<size memory="9000G"/>')),
    "composite": ("xml", _with('<body><composite type="cable" count="100000 1 1"/></body>')),
    "flexcomp": ("xml", _with('<flexcomp type="grid" count="900 900 900" name="f"/>')),
    "plugin": ("xml", _with(head='<extension><plugin plugin="mujoco.sdf.bolt"/></extension>')),
    "self-include": ("xml", _with(head='<include file="model.xml"/>')),
    "model-attach": ("xml", _with('<attach model="m" prefix="x"/>', '<model name="m" file="{outside}/secret.stl"/>')),
    "huge-name": ("xml", QUADRUPED.replace("torso", "t" * 300_000)),
    "pattern-name": ("xml", QUADRUPED.replace("fl_hip", "[!*").replace("fr_hip", "?]")),
    "same-names": ("xml", QUADRUPED.replace("fl_hip", "x")),
    "no-legs": ("xml", "<mujoco><worldbody><body><freejoint/><geom size='1'/></body></worldbody></mujoco>"),
    "no-body": ("xml", "<mujoco><worldbody><geom size='1'/></worldbody></mujoco>"),
    "xacro": ("urdf", '<robot xmlns:xacro="http://x" name="r"><xacro:include filename="/etc/passwd"/><link name="a"/></robot>'),
    "urdf-cycle": ("urdf", BIPED.replace('<child link="left_foot"/>', '<child link="trunk"/>')),
    "urdf-two-roots": ("urdf", BIPED.replace("</robot>", '<link name="other"/></robot>')),
    "urdf-no-links": ("urdf", '<robot name="r"/>'),
    **{f"mesh-{i}": ("xml", _with('<geom type="mesh" mesh="s"/>', f'<mesh name="s" file="{s}"/>')) for i, s in enumerate(SECRETS)},
    **{f"meshdir-{i}": ("xml", _with('<geom type="mesh" mesh="s"/>', '<mesh name="s" file="secret.stl"/>').replace(
        'angle="degree"', f'angle="degree" meshdir="{d}"')) for i, d in enumerate(["../outside", "{outside}", "/"])},
    **{f"include-{i}": ("xml", _with(head=f'<include file="{s}"/>')) for i, s in enumerate(SECRETS)},
    **{f"texture-{i}": ("xml", _with(asset=f'<texture name="s" type="2d" file="{s}"/>')) for i, s in enumerate(SECRETS)},
    **{f"hfield-{i}": ("xml", _with('<geom type="hfield" hfield="s"/>', f'<hfield name="s" file="{s}"/>')) for i, s in enumerate(SECRETS)},
    **{f"skin-{i}": ("xml", _with(asset=f'<skin name="s" file="{s}"/>')) for i, s in enumerate(SECRETS)},
    **{f"urdf-mesh-{i}": ("urdf", BIPED.replace("package://biped/meshes/trunk.dae", s)) for i, s in enumerate(SECRETS)},
}  # fmt: skip


def toml_inputs(text: str) -> Iterator[Input]:
    """Variants of a creature.toml."""
    rng = random.Random("toml")
    for i in range(30):
        yield f"toml-cut-{i}", "toml", text.encode()[: len(text) * i // 30]
    for i in range(60):
        lines = text.splitlines()
        k = rng.randrange(len(lines))
        key = lines[k].split("=")[0]
        value = rng.choice(
            [
                "nan",
                "inf",
                "-1",
                "0",
                "1e400",
                '""',
                "[]",
                "{}",
                "true",
                "[1]",
                "[[1]]",
                "[5, -5]",
                '["*"]',
                "9" * 400,
                "'" + "a" * 9999 + "'",
            ]
        )
        lines[k] = rng.choice(
            [f"{key} = {value}", "", f"{key}_x = {value}", lines[k] + lines[k], f"[{value}]"]
        )
        yield f"toml-value-{i}", "toml", "\n".join(lines).encode()
    for i in range(20):
        yield f"toml-byte-{i}", "toml", _flip_bytes(text.encode(), rng)
    yield "toml-deep", "toml", ("a = " + "[" * 50_000).encode()
    yield (
        "toml-deep-table",
        "toml",
        ("[train." + ".".join("a" * 1 for _ in range(3000)) + "]").encode(),
    )
    yield "toml-glob", "toml", text.replace('match = "', 'match = "' + "*a" * 40).encode()


def own_xml_inputs(text: str) -> Iterator[Input]:
    """Variants of a creature.xml."""
    rng = random.Random("own")
    for i in range(50):
        yield f"own-number-{i}", "own", _replace_number(text, rng).encode()
    for i in range(30):
        yield f"own-line-{i}", "own", _shuffle_lines(text, rng).encode()
    for i in range(15):
        yield f"own-byte-{i}", "own", _flip_bytes(text.encode(), rng)
    for i, s in enumerate(SECRETS):
        yield (
            f"own-include-{i}",
            "own",
            text.replace("<worldbody>", f'<include file="{s}"/><worldbody>').encode(),
        )
        yield (
            f"own-mesh-{i}",
            "own",
            text.replace(
                "<worldbody>", f'<asset><mesh name="s" file="{s}"/></asset><worldbody>'
            ).encode(),
        )
    yield (
        "own-replicate",
        "own",
        text.replace(
            "<worldbody>", '<worldbody><replicate count="1000000000"><geom size="1"/></replicate>'
        ).encode(),
    )
    yield (
        "own-plugin",
        "own",
        text.replace(
            "<worldbody>", '<extension><plugin plugin="mujoco.pid"/></extension><worldbody>'
        ).encode(),
    )
    yield (
        "own-memory",
        "own",
        text.replace("<worldbody>", '<size memory="9000G"/><worldbody>').encode(),
    )
