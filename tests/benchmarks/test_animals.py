"""The bodies that are written for the import are what their page says."""

import animals
import mujoco


def test_the_animals_are_bodies_with_limited_hinges():
    """From a mouse to an elephant; two state their torques."""
    found = {name: mujoco.MjModel.from_xml_string(text) for name, text in animals.models()}
    assert len(found) == 13
    for name, model in found.items():
        assert model.jnt_limited[1:].all(), name
        assert model.nu == (model.nv - 6 if name in ("beetle", "raptor") else 0), name
    masses = {name: float(model.body_mass.sum()) for name, model in found.items()}
    assert (round(masses["mouse"], 3), round(masses["elephant"])) == (0.022, 3346)
    assert min(masses, key=masses.__getitem__) == "mouse"
    assert max(masses, key=masses.__getitem__) == "elephant"
