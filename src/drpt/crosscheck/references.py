"""What pictures are checked against: rendered with Mitsuba, or read from a file."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import version
from typing import TYPE_CHECKING

from drpt.crosscheck.domain import MAX_OFFSET, caveats, ray_offset, tolerance
from drpt.crosscheck.estimate import Estimate, check_spp, reference
from drpt.crosscheck.stored import load_estimate, whole
from drpt.crosscheck.variant import VARIANT
from drpt.render import Rendering
from drpt.scene import Mesh, Scene
from drpt.scene.saving import to_toml

if TYPE_CHECKING:
    from os import PathLike

    from drpt.crosscheck.estimate import OnPass

SPP = 1024
"""Samples per pixel of a reference and of what is checked, if nothing else is asked for."""
BOUNCES = 3
"""Bounces, if nothing else is asked for or told."""
MITSUBA = "Mitsuba"
OFFSET = (
    "coordinates: Mitsuba's rays start up to {} of the scene's size off their surfaces, so its "
    "picture may be anything; scale the scene to 1 or more, and move it to the origin"
)
UNKNOWN = (
    "{} tells nothing of its noise, so whether a picture agrees with it cannot be told: it has no "
    "layer standard_error or variance"
)
NORMALS = (
    "interpolated normals: Mitsuba looks at shading normals alone, drpt at both, so their pictures "
    "differ where the two disagree on the side of a direction"
)


@dataclass(frozen=True, eq=False)
class Reference:
    """What pictures of a scene are checked against.

    Attributes
    ----------
    scene
        The scene, with the camera's width and height of the reference.
    bounces
        With how many bounces.
    estimate
        The picture and its errors.
    source
        Where it comes from, for people.
    tolerance
        Its own relative error that is known; infinite where it may be anything.
    remarks
        Sentences on what it is not good for.
    renderer
        What rendered it, if that is known.
    """

    scene: Scene
    bounces: int
    estimate: Estimate
    source: str
    tolerance: float
    remarks: tuple[str, ...]
    renderer: str | None = None

    def __str__(self) -> str:
        height, width, _ = self.estimate.mean.shape
        what = f"{width}x{height}, {self.bounces} bounce{'' if self.bounces == 1 else 's'}"
        return "\n".join([f"reference: {self.source}, {what}", *self.remarks])


def render_reference(
    scene: Scene,
    spp: int = SPP,
    bounces: int = BOUNCES,
    seed: int = 0,
    *,
    on_pass: OnPass = lambda passes: None,
) -> Reference:
    """Render a reference with Mitsuba; see :func:`drpt.crosscheck.reference`."""
    Rendering(scene, check_spp(spp), bounces, seed=seed)  # refuses what is not allowed
    estimate = reference(scene, spp, bounces, seed, on_pass=on_pass)
    source = f"{MITSUBA} {version('mitsuba')} ({VARIANT}), {spp} spp"
    remarks = _remarks(scene)
    return Reference(scene, bounces, estimate, source, tolerance(scene), remarks, MITSUBA)


def stored_reference(
    scene: Scene, path: str | PathLike[str], bounces: int | None = None
) -> Reference:
    """Read a reference from an EXR file, with the noise that a layer of it tells.

    See :func:`drpt.crosscheck.stored.load_estimate`. Without such a layer no check can tell whether
    a picture agrees with it. The scene is rendered in its size.

    Parameters
    ----------
    scene
        The scene that the file shows.
    path
        The file.
    bounces
        How many there are in the file; by default what its metadata says, or else 3.

    Raises
    ------
    OSError, ValueError
        The file is unreadable, has the wrong shape or, it says, another number of bounces.
    """
    estimate, metadata = load_estimate(path)
    if "bounces" in metadata:
        stored = whole(metadata, path, "bounces", low=0)
        if bounces not in (None, stored):
            words = f"it must be {stored}, as in {path}"
            raise ValueError(f"bounces: {bounces} is not allowed; {words}")
        bounces = stored
    bounces = BOUNCES if bounces is None else bounces
    Rendering(scene, bounces=bounces)  # refuses what is not allowed
    scene = _resized(scene, estimate, path)
    remarks = () if estimate.is_noise_known else (UNKNOWN.format(path),)
    if metadata.get("scene") not in (None, to_toml(scene)):
        remarks = (*remarks, f"{path} was made of a scene that is not quite this one")
    if metadata.get("renderer") != MITSUBA:
        return Reference(scene, bounces, estimate, str(path), 0.0, remarks)
    remarks = (*remarks, *_remarks(scene))
    return Reference(scene, bounces, estimate, str(path), tolerance(scene), remarks, MITSUBA)


def _resized(scene: Scene, estimate: Estimate, path: str | PathLike[str]) -> Scene:
    height, width, _ = estimate.mean.shape
    camera = scene.camera
    if width * camera.height != height * camera.width:
        raise ValueError(
            f"{path}: its size, {width}x{height}, has not the shape of the scene's "
            f"{camera.width}x{camera.height}"
        )
    return scene.resized(width, height)


def _remarks(scene: Scene) -> tuple[str, ...]:
    offset = ray_offset(scene)
    shades = any(isinstance(s, Mesh) and s.normals is not None and s.material for s in scene.shapes)
    remarks = [str(caveat) for caveat in caveats(scene)]
    if offset > MAX_OFFSET:
        remarks.append(OFFSET.format(f"{100 * offset:.2g} %"))
    return tuple(remarks + [NORMALS] * shades)
