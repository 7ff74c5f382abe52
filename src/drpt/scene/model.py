"""What a scene is: a camera and shapes, each with a material or a radiance.

Everything here is immutable and checked when it is made; what is wrong raises `SceneError`.
Lengths have no unit of their own, colours are linear RGB.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from drpt.immutable import Immutable, immutable, same_values, set_fields
from drpt.scene import checks
from drpt.scene.checks import RGB, Colour, Point, SceneError, Vector
from drpt.scene.materials import MATERIALS, Diffuse, Material, Phong

if TYPE_CHECKING:
    from collections.abc import Iterable
    from os import PathLike

    from numpy.typing import ArrayLike, NDArray


MIN_SINE = 1e-6
"""Smallest sine of the angle between a camera's up and its view direction."""
UNIT_TOLERANCE = 1e-14
"""Normals this close to unit length, some float64 roundings, are kept to the bit."""
FAR_EXPONENT = 500
"""Squares of numbers farther from 1 than this power of 2 are near the ends of float64."""


class CameraAxes(NamedTuple):
    """Orthonormal vectors (3,): to the right and down in the picture, and along the view."""

    right: NDArray[np.float64]
    down: NDArray[np.float64]
    forward: NDArray[np.float64]


@dataclass(frozen=True, init=False)
class Camera:
    """A pinhole camera; image right is forward × up, row 0 is the top.

    Parameters
    ----------
    eye, target
        Where it stands, and the point in the middle of the picture.
    up
        The direction that points up in the picture; not parallel to the view direction.
    fov
        Vertical field of view in degrees, > 0 and < 180.
    width, height
        Size of the picture in pixels.
    """

    eye: Point
    target: Point
    up: Point
    fov: float
    width: int
    height: int

    def __init__(
        self, eye: Vector, target: Vector, up: Vector, fov: float, width: int, height: int
    ) -> None:
        set_fields(
            self,
            eye=checks.point("eye", eye),
            target=checks.point("target", target),
            up=checks.point("up", up),
            fov=checks.number("fov", fov, checks.FOV),
            width=checks.pixels("width", width),
            height=checks.pixels("height", height),
        )
        self._check_frame()

    def axes(self) -> CameraAxes:
        """Return the axes of the picture and of the view."""
        eye, target, up = map(np.array, (self.eye, self.target, self.up))
        forward = (target - eye) / np.linalg.norm(target - eye)
        right = np.cross(forward, up)
        right /= np.linalg.norm(right)
        return CameraAxes(right, np.cross(forward, right), forward)

    def _check_frame(self) -> None:
        view, up = np.subtract(self.target, self.eye), np.array(self.up)
        distance, length = np.linalg.norm(view), np.linalg.norm(up)
        if distance < checks.MIN_LENGTH:
            words = f"a point at least {checks.plain(checks.MIN_LENGTH)} away from eye {self.eye}"
            raise checks.refuse("target", self.target, words)
        if length < checks.MIN_LENGTH:
            words = f"a direction, of length {checks.plain(checks.MIN_LENGTH)} or more"
            raise checks.refuse("up", self.up, words)
        if np.linalg.norm(np.cross(view / distance, up / length)) < MIN_SINE:
            words = f"a direction that is not parallel to the view {tuple(view.tolist())}"
            raise checks.refuse("up", self.up, words)


class _Surface:
    """What every shape has: a material or a radiance, never both."""

    material: Material | None
    radiance: RGB | None

    @property
    def is_light(self) -> bool:
        """Whether it emits; a radiance of 0 makes a black surface instead."""
        return self.radiance is not None and any(self.radiance)

    def _set_surface(self, material: Material | None, radiance: Colour | None) -> None:
        if material is None and radiance is None:
            raise SceneError("it has neither a material nor a radiance; give it one of them")
        if material is not None and radiance is not None:
            raise SceneError("it has both a material and a radiance; give it only one of them")
        if not isinstance(material, Material | None):
            kinds = " or ".join(f"a {kind.__name__}" for kind in MATERIALS)
            raise checks.refuse("material", material, kinds)
        if radiance is not None:
            radiance = checks.colour("radiance", radiance, checks.RADIANCE)
        set_fields(self, material=material, radiance=radiance)


@dataclass(frozen=True, init=False)
class Sphere(_Surface):
    """A sphere, with a material or, as a light, a radiance.

    Parameters
    ----------
    center, radius
        Its centre, and its radius > 0.
    material
        How it reflects, on both sides.
    radiance
        What it emits outward, W/(m² sr) or relative; three values, or one for grey. A light
        reflects nothing; with radiance 0 it is black.
    """

    center: Point
    radius: float
    material: Material | None
    radiance: RGB | None

    def __init__(
        self,
        center: Vector,
        radius: float,
        material: Material | None = None,
        radiance: Colour | None = None,
    ) -> None:
        set_fields(
            self,
            center=checks.point("center", center),
            radius=checks.number("radius", radius, checks.RADIUS),
        )
        self._set_surface(material, radiance)


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Mesh(_Surface, Immutable):
    """A triangle mesh, with a material or, as a light, a radiance.

    A triangle's front is where its vertices are seen counter-clockwise. A triangle without area
    is never hit. The arrays are copied, and cannot be written to; nor can those of a copy or an
    unpickled mesh.

    Parameters
    ----------
    vertices
        Positions, shape (n, 3).
    faces
        Indices of each triangle's vertices, whole numbers of shape (m, 3).
    normals
        Shading normals of the vertices, shape (n, 3), none of length 0; stored with length 1.
        Without them every triangle is flat.
    material
        How it reflects, on both sides.
    radiance
        What its front emits, W/(m² sr) or relative; three values, or one for grey. A light
        reflects nothing; with radiance 0 it is black.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    normals: NDArray[np.float64] | None
    material: Material | None
    radiance: RGB | None

    def __init__(
        self,
        vertices: ArrayLike,
        faces: ArrayLike,
        normals: ArrayLike | None = None,
        material: Material | None = None,
        radiance: Colour | None = None,
    ) -> None:
        points = checks.vectors("vertices", vertices)
        set_fields(
            self,
            vertices=points,
            faces=checks.indices("faces", faces, len(points)),
            normals=None if normals is None else _unit_normals(normals, len(points)),
        )
        self._set_surface(material, radiance)
        if self.is_light and self.areas().sum() < checks.MIN_LENGTH**2:
            raise SceneError("they have no area; a light must have one", "faces")

    @classmethod
    def load(
        cls,
        path: str | PathLike[str],
        material: Material | None = None,
        radiance: Colour | None = None,
    ) -> Mesh:
        """Read a mesh from an OBJ, PLY or NPZ file (arrays ``v``, ``f`` and, optional, ``vn``).

        Normals are used where the file has them, and never made up. Raises `SceneError` if the
        file cannot be read or what it holds is not allowed.
        """
        from drpt.scene.meshes import load_mesh

        vertices, faces, normals = load_mesh(path)
        try:
            black = cls(vertices, faces, normals, radiance=0)
        except SceneError as error:
            raise error.in_file(str(path)) from None
        try:
            return cls(black.vertices, black.faces, black.normals, material, radiance)
        except SceneError as error:  # of the arguments, or of faces without area that are a light
            raise (error.in_file(str(path)) if error.field == "faces" else error) from None

    def areas(self) -> NDArray[np.float64]:
        """Return the area of each triangle, shape (m,)."""
        a, b, c = self.vertices[self.faces].swapaxes(0, 1)
        areas: NDArray[np.float64] = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
        return areas

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Mesh):
            return NotImplemented
        return (
            (self.material, self.radiance) == (other.material, other.radiance)
            and same_values(self.vertices, other.vertices)
            and same_values(self.faces, other.faces)
            and _equal_normals(self.normals, other.normals)
        )

    def __hash__(self) -> int:
        return hash((len(self.vertices), len(self.faces), self.material, self.radiance))

    def __repr__(self) -> str:
        normals = "" if self.normals is None else "with normals, "
        surface = f"radiance={self.radiance}" if self.material is None else f"{self.material}"
        return f"Mesh({len(self.vertices)} vertices, {len(self.faces)} faces, {normals}{surface})"


Shape: TypeAlias = Sphere | Mesh


@dataclass(frozen=True, init=False)
class Scene:
    """A camera and the shapes that it sees.

    Parameters
    ----------
    camera
        The camera.
    shapes
        Spheres and meshes, one at least. Where two of them overlap in one plane, or are the same
        sphere, the later one is seen, and renders give a `RuntimeWarning` that names both.
    description
        One line for people.
    """

    camera: Camera
    shapes: tuple[Shape, ...]
    description: str

    def __init__(self, camera: Camera, shapes: Iterable[Shape], description: str = "") -> None:
        if not isinstance(camera, Camera):
            raise checks.refuse("camera", camera, "a Camera")
        if not isinstance(description, str):
            raise checks.refuse("description", description, "a text")
        set_fields(self, camera=camera, shapes=_shapes(shapes), description=description)

    def resized(self, width: int | None = None, height: int | None = None) -> Scene:
        """Return the same scene with a picture of another size in pixels.

        If one side is None, it follows from the other by the aspect ratio of the camera, rounded
        to a whole pixel and at least 1. Raises `SceneError` for a size that a camera cannot have.
        """
        old = camera = self.camera
        if width is not None:
            camera = replace(camera, width=width)
        if height is not None:
            camera = replace(camera, height=height)
        if width is None and height is not None:
            camera = replace(camera, width=max(1, round(old.width * camera.height / old.height)))
        elif height is None and width is not None:
            camera = replace(camera, height=max(1, round(old.height * camera.width / old.width)))
        return replace(self, camera=camera)

    def save(self, path: str | PathLike[str]) -> None:
        """Write a TOML scene file, and its meshes into a folder beside it.

        Reading it again gives an equal scene. Raises `SceneError` if it cannot be written.
        """
        from drpt.scene.saving import save_scene

        save_scene(self, path)


def material_from_brdf_params(brdf_params: Vector) -> Material:
    """Return the material of the vector (red, green, blue, α): diffuse if α is 1, else Phong.

    The first three are the albedo, from 0 to 1; α is the Phong exponent.
    """
    items = checks.items(brdf_params)
    if len(items) != 4:
        words = "four numbers: red, green, blue, exponent"
        raise checks.refuse("brdf_params", brdf_params, words)
    *albedo, alpha = items
    exponent = checks.number("exponent", alpha, checks.EXPONENT)
    return Diffuse(albedo) if exponent == 1 else Phong(albedo, exponent)


def _unit_normals(normals: ArrayLike, count: int) -> NDArray[np.float64]:
    vectors = checks.vectors("normals", normals)
    if len(vectors) != count:
        raise SceneError(f"there are {len(vectors)}, but {count} vertices", "normals")
    _, exponents = np.frexp(np.abs(vectors).max(axis=1, initial=0, keepdims=True))
    far = np.abs(exponents) > FAR_EXPONENT
    vectors = np.where(far, np.ldexp(vectors, -exponents), vectors)
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    if not lengths.all():
        row = int(np.flatnonzero(lengths == 0)[0])
        raise checks.refuse(f"normals[{row}]", tuple(vectors[row].tolist()), "longer than 0")
    unit = np.where(np.abs(lengths - 1) < UNIT_TOLERANCE, vectors, vectors / lengths)
    return immutable(unit)


def _equal_normals(first: NDArray[np.float64] | None, second: NDArray[np.float64] | None) -> bool:
    if first is None or second is None:
        return first is second
    return same_values(first, second)


def _shapes(shapes: Iterable[Shape]) -> tuple[Shape, ...]:
    try:
        items = tuple(shapes)
    except TypeError:
        raise checks.refuse("shapes", shapes, "a list of Sphere and Mesh") from None
    if not items:
        raise SceneError("there are none; a scene needs one shape at least", "shapes")
    for index, item in enumerate(items):
        if not isinstance(item, Shape):
            raise checks.refuse(f"shapes[{index}]", item, "a Sphere or a Mesh")
    return items
