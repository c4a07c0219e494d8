import hashlib
import math
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from tests.simulator.scenery import LOOKS, a_site
from vsnbench.simulator.primitives import Scene, Shape
from vsnbench.simulator.rendering.mesh import Mesh, build_mesh
from vsnbench.simulator.rendering.renderer import DepthDrawer, Eye, Frame, Pinhole, Renderer, eye_of
from vsnbench.simulator.scene import build_scene
from vsnbench.sites.site import Door, Site, SiteObject, Wall, Window
from vsnbench.values.camera import Camera
from vsnbench.values.pose import Pose

ROOT = Path(__file__).parents[3]
CAMERA = Camera(
    width=320, height=240, horizontal_fov_deg=79, mount_height_m=0.7, mount_forward_m=0.1, tilt_deg=-12, depth_max_m=10
)


def furnished() -> Site:
    """A small site with something of everything: shapes, headings, a doorway into a second room, a window."""
    objects = [
        SiteObject(id="table", category="table", position=(3.2, 2.6), heading_deg=20, size_m=(0.8, 1.2, 0.75)),
        SiteObject(id="chair", category="chair", position=(2.6, 1.4), heading_deg=75, size_m=(0.5, 0.48, 0.9)),
        SiteObject(
            id="swivel",
            category="chair",
            model="office_chair",
            position=(4.6, 1.2),
            heading_deg=130,
            size_m=(0.6, 0.6, 1.0),
        ),
        SiteObject(id="plant", category="plant", position=(5.3, 3.3), size_m=(0.5, 0.5, 1.2)),
        SiteObject(id="rug", category="rug", position=(3.5, 1.5), size_m=(1.5, 1.0, 0.01), solid=False),
        SiteObject(
            id="picture",
            category="picture",
            position=(5.93, 2),
            heading_deg=180,
            size_m=(0.03, 0.7, 0.5),
            elevation_m=1.2,
        ),
    ]
    site = a_site(*objects, doors=(Door(name="door", start=(6, 0.5), end=(6, 1.4)),))
    beyond = a_site(polygon=((6, 0), (9, 0), (9, 4), (6, 4))).rooms[0].model_copy(update={"name": "beyond"})
    more = [Wall(start=(6, 0), end=(9, 0)), Wall(start=(9, 0), end=(9, 4)), Wall(start=(9, 4), end=(6, 4))]
    return site.model_copy(
        update={
            "rooms": [*site.rooms, beyond],
            "walls": [*site.walls, *more],
            "windows": [Window(start=(2, 0), end=(3.5, 0))],
        }
    )


@cache
def renderer() -> Renderer:
    return Renderer(build_scene(furnished()))


VIEWS = [Pose(0.6, 0.6, 0.5), Pose(1.0, 3.3, -0.6), Pose(4.0, 3.4, -1.9), Pose(5.4, 1.9, math.pi), Pose(5.0, 2.2, -1.2)]


def away_from_edges(ids: npt.NDArray[np.int32], reach: int = 2) -> npt.NDArray[np.bool_]:
    """Pixels whose neighbours all show the same thing."""
    same = np.ones(ids.shape, bool)
    for dy in range(-reach, reach + 1):
        for dx in range(-reach, reach + 1):
            same &= np.roll(ids, (dy, dx), (0, 1)) == ids
    same[:reach], same[-reach:], same[:, :reach], same[:, -reach:] = False, False, False, False
    return same


def traced(scene: Scene, eye: Eye, camera: Camera) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int32]]:
    """Depth along the optical axis and index of the visible primitive, by MuJoCo's rays."""
    import mujoco

    shapes = {
        Shape.BOX: mujoco.mjtGeom.mjGEOM_BOX,
        Shape.CYLINDER: mujoco.mjtGeom.mjGEOM_CYLINDER,
        Shape.ELLIPSOID: mujoco.mjtGeom.mjGEOM_ELLIPSOID,
    }
    spec = mujoco.MjSpec()
    shown = [primitive for primitive in scene.primitives if primitive.visible]
    mesh = build_mesh(scene)
    for index, primitive in enumerate(shown):
        x, y, z = primitive.half_size
        if primitive.shape not in shapes or primitive.bevel_m or primitive.taper != 1.0:
            corners = mesh.corners[slice(*mesh.faces[index])]
            middle = corners.mean((0, 1))
            quads = np.arange(len(corners) * 4).reshape(-1, 4)
            four = (corners[:, 2] != corners[:, 3]).any(1)
            triangles = np.concatenate([quads[:, [0, 1, 2]], quads[four][:, [0, 2, 3]]])
            spec.add_mesh(
                name=f"mesh{index}",
                uservert=(corners - middle).reshape(-1),
                userface=triangles.reshape(-1),
                inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
            )
            spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"mesh{index}", pos=middle)
            continue
        size = [x, z, 0] if primitive.shape is Shape.CYLINDER else [x, y, z]
        spec.worldbody.add_geom(type=shapes[primitive.shape], size=size, pos=primitive.centre, quat=primitive.rotation)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    cx, cy = camera.center_px
    right, down = np.meshgrid(
        (np.arange(camera.width) - cx) / camera.focal_px, (np.arange(camera.height) - cy) / camera.focal_px
    )
    cos, sin = math.cos(eye.heading_rad), math.sin(eye.heading_rad)
    level, rise = math.cos(eye.tilt_rad), math.sin(eye.tilt_rad)
    forward = level + rise * down
    rays = np.stack([cos * forward + sin * right, sin * forward - cos * right, rise - level * down], axis=-1)
    length = np.linalg.norm(rays, axis=-1)
    count = rays.shape[0] * rays.shape[1]
    geoms, distances = np.full(count, -1, np.int32), np.zeros(count)
    mujoco.mj_multiRay(
        model,
        data,
        np.array([eye.x_m, eye.y_m, eye.z_m]),
        (rays / length[..., None]).reshape(-1),
        None,
        1,
        -1,
        geoms,
        distances,
        None,
        count,
        100.0,
    )
    depth = np.where(distances < 0, np.inf, distances).reshape(length.shape) / length
    return depth, geoms.reshape(length.shape)


def categories_seen(scene: Scene, eye: Eye, camera: Camera, mesh: Mesh | None = None) -> npt.NDArray[np.str_]:
    """Return the category of the surface at each pixel (H, W), empty without a surface."""
    mesh = mesh or build_mesh(scene)
    faces = DepthDrawer(mesh).draw(eye, Pinhole(camera.width, camera.height, camera.focal_px, *camera.center_px)).face
    names = np.array([primitive.category for primitive in scene.primitives if primitive.visible])
    return np.where(faces >= 0, names[mesh.owner[faces]], "")


@pytest.mark.parametrize("pose", VIEWS)
def test_depth_and_ids_agree_with_mujocos_rays(pose: Pose) -> None:
    scene = build_scene(furnished())
    frame = renderer().render(CAMERA, pose)
    depth, geoms = traced(scene, eye_of(CAMERA, pose), CAMERA)
    shown = [primitive for primitive in scene.primitives if primitive.visible]
    instance = np.array([primitive.instance for primitive in shown])[geoms]
    category = np.array([primitive.category for primitive in shown])[geoms]
    inner = away_from_edges(geoms)
    assert inner.mean() > 0.5
    assert (frame.instance == instance)[inner].mean() >= 0.995
    assert (categories_seen(scene, eye_of(CAMERA, pose), CAMERA) == category)[inner].mean() >= 0.995
    assert (np.abs(frame.depth_m - depth) < 0.01)[inner].mean() >= 0.995
    flat = inner & np.array([primitive.shape is Shape.BOX for primitive in shown])[geoms]
    assert (np.abs(frame.depth_m - depth) < 2e-4 * depth + 1e-4)[flat].mean() >= 0.995


@pytest.mark.parametrize("pose", VIEWS)
def test_the_floor_lies_at_height_zero_for_the_robot(pose: Pose) -> None:
    frame = renderer().render(CAMERA, pose)
    points = CAMERA.points_in_base(frame.depth_m)
    floor = categories_seen(build_scene(furnished()), eye_of(CAMERA, pose), CAMERA) == "floor"
    assert floor.sum() > 1000
    assert np.abs(points[floor][:, 2]).max() < 0.003


def test_points_of_an_object_lie_in_its_footprint() -> None:
    site, pose = furnished(), Pose(0.6, 0.6, 0.5)
    frame = renderer().render(CAMERA, pose)
    seen = frame.instance == 1
    assert seen.sum() > 200
    for x, y, z in CAMERA.points_in_base(frame.depth_m)[seen]:
        there = pose.compose(Pose(float(x), float(y)))
        assert site.objects[0].shape.buffer(0.01).contains_properly(_point(there))
        assert -0.01 < z < 0.76


def _point(pose: Pose) -> object:
    from shapely.geometry import Point

    return Point(pose.position)


def digest(frame: Frame) -> str:
    images = (frame.rgb, frame.depth_m, frame.instance)
    return hashlib.sha256(b"".join(image.tobytes() for image in images)).hexdigest()


def test_pixels_are_the_same_on_every_run_and_in_every_process() -> None:
    first = digest(renderer().render(CAMERA, VIEWS[0]))
    assert digest(Renderer(build_scene(furnished())).render(CAMERA, VIEWS[0])) == first
    program = (
        "from tests.simulator.rendering.test_renderer import *\nprint(digest(renderer().render(CAMERA, VIEWS[0])))"
    )
    other = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert other.stdout.split()[-1] == first


def test_frames_are_independent_of_what_was_rendered_before() -> None:
    fresh = renderer().render(CAMERA, VIEWS[1])
    kept = digest(fresh)
    small = CAMERA.resized(64, 48)
    renderer().render(small, VIEWS[2])
    renderer().render(CAMERA, VIEWS[2])
    assert digest(fresh) == kept
    assert digest(renderer().render(CAMERA, VIEWS[1])) == kept


def test_a_wall_right_at_the_lens_fills_the_picture() -> None:
    near, eye = CAMERA.resized(160, 120), Eye(0.08, 2.0, 0.7, math.pi)
    assert set(np.unique(categories_seen(build_scene(furnished()), eye, near))) == {"wall"}
    assert np.allclose(renderer().render_from(eye, 160, 120, 100.0).depth_m, 0.03, atol=1e-5)


def test_surfaces_behind_and_beside_the_lens_are_clipped_and_do_not_smear() -> None:
    """Standing on the floor close to a wall, with the wall and the floor reaching behind the eye."""
    pose = Pose(3.0, 0.2, 0.05)
    frame = renderer().render(CAMERA, pose)
    depth, geoms = traced(build_scene(furnished()), eye_of(CAMERA, pose), CAMERA)
    inner = away_from_edges(geoms)
    assert (np.abs(frame.depth_m - depth) < 0.01)[inner].mean() >= 0.995


def test_a_doorway_shows_the_room_behind() -> None:
    """The opening is see-through: behind it lies the far wall, three metres on."""
    frame = renderer().render_from(Eye(5.0, 0.95, 0.7, 0.0), 160, 120, 130.0)
    middle = frame.depth_m[50:60, 75:85]
    assert np.all(np.abs(middle - 3.95) < 0.01)


def test_a_window_is_a_pane_that_the_robot_sees_as_a_window() -> None:
    eye, small = Eye(2.5, 2.0, 1.4, -math.pi / 2), CAMERA.resized(160, 120)
    frame = renderer().render_from(eye, 160, 120, small.focal_px)
    assert categories_seen(build_scene(furnished()), eye, small)[60, 70] == "window"
    assert 1.9 < frame.depth_m[60, 70] < 2.1


def test_nothing_is_infinitely_far_and_not_an_object() -> None:
    frame = renderer().render_from(Eye(-5.0, 2.0, 0.7, math.pi), 32, 24, 30.0)
    assert np.isinf(frame.depth_m).all()
    assert not frame.instance.any()


@pytest.fixture(scope="module")
def gallery() -> tuple[list[SiteObject], Scene, Renderer, Mesh]:
    """Every look there is, in rows, with room to see each."""
    things = []
    for k, (category, model) in enumerate(LOOKS):
        size = {"rug": (0.9, 0.9, 0.01), "picture": (0.03, 0.7, 0.5)}.get(category, (0.6, 0.6, 0.8))
        things.append(
            SiteObject(
                id=model.replace("_", "-"),
                category=category,
                model=model,
                position=(2.0 + 3 * (k % 6), 2.0 + 3 * (k // 6)),
                heading_deg=180,
                size_m=size,
            )
        )
    site = a_site(*things, polygon=((0, 0), (20, 0), (20, 20), (0, 20)))
    walls = [Wall(start=(0, 0), end=(20, 0)), Wall(start=(0, 20), end=(20, 20))]
    scene = build_scene(site.model_copy(update={"walls": walls}))
    return things, scene, Renderer(scene), build_mesh(scene)


@pytest.mark.parametrize("index", range(len(LOOKS)), ids=[model for _, model in LOOKS])
def test_every_look_is_seen_under_its_own_id(
    gallery: tuple[list[SiteObject], Scene, Renderer, Mesh], index: int
) -> None:
    things, scene, renderer, mesh = gallery
    thing = things[index]
    eye = Eye(thing.position[0] - 1.5, thing.position[1], 1.0, 0.0, -0.4)
    camera = CAMERA.resized(160, 120)
    frame = renderer.render_from(eye, 160, 120, camera.focal_px)
    own = frame.instance == index + 1
    assert own.mean() > 0.02
    categories = categories_seen(scene, eye, camera, mesh)
    assert set(np.unique(categories[own])) == {thing.category}
    beside = ~own & (categories == "floor")
    difference = frame.rgb[own].mean(0) - frame.rgb[beside].mean(0)
    assert np.abs(difference).max() > 3, "it stands out from the floor"
    assert frame.rgb[own].mean() > 12, "it is lit"
