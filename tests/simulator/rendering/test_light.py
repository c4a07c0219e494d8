"""Light of a scene: fewer samples for many surfaces."""

import numpy as np
import pytest

from tests.simulator.scenery import a_site
from vsnbench.simulator.rendering import light
from vsnbench.simulator.rendering.mesh import build_mesh
from vsnbench.simulator.scene import build_scene
from vsnbench.sites.site import SiteObject


def test_a_scene_with_many_points_is_sampled_less_and_looks_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    table = SiteObject(id="table-1", category="table", position=(2.0, 2.0), size_m=(1.2, 0.8, 0.75))
    scene = build_scene(a_site(table))
    mesh = build_mesh(scene)
    full = light.light_of(scene, mesh).values
    monkeypatch.setattr(light, "_MANY_POINTS", 0)
    monkeypatch.setattr(light, "cached_array", lambda _kind, _key, _dtype, _shape, make: make())
    few = light.light_of(scene, mesh).values
    assert few.shape == full.shape
    assert not np.array_equal(few, full)
    assert np.mean(few[:, :3]) == pytest.approx(np.mean(full[:, :3]), rel=0.05)
