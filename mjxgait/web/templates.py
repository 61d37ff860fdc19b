"""Files of `assets/`, out of which the pages are made."""

import json
import string
from importlib import resources


def asset(name: str) -> str:
    """Return the text of a file of `assets/`."""
    return (resources.files("mjxgait.web") / "assets" / name).read_text(encoding="utf-8")


def template(name: str) -> string.Template:
    """Return a page of `assets/` with places to fill in."""
    return string.Template(asset(name))


def style() -> str:
    """Return the rules that pages have in common."""
    return asset("style.css")


def viewer_script() -> str:
    """Return the viewer's script; browser tools would request its source map."""
    return asset("model-viewer.min.js").rsplit("//# sourceMappingURL", 1)[0]


def embedded(script: str) -> str:
    """Return a script that does not end the script element that holds it."""
    return script.replace("</script", "<\\/script")


def embedded_json(value: object) -> str:
    """Return JSON that does not end the script element that holds it."""
    return json.dumps(value).replace("<", "\\u003c")
