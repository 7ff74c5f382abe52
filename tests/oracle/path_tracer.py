"""Brute-force path tracer in float64, written from the rendering equation

    L_o(x, ω_o) = L_e(x, ω_o) + ∫ f(ω_o, ω_i) L_i(x, ω_i) n·ω_i dω_i.

Two independent estimators of the direct part of the integral check each other: directions, which
find a light where a path runs into one, and points uniform on every light's area, where
dω_i = cos θ' dA / d². The indirect part follows one direction, drawn uniformly on the sphere or
from the BRDF; the latter is for narrow lobes, which uniform directions hardly find.
"""

from collections.abc import Iterator

import numpy as np

from drpt.scene import Camera, Material, Mesh, Mirror, Scene, Sphere
from tests.oracle import brdf
from tests.oracle.arrays import Bools, Floats, Ints, dot, normalize, sample_uniform_sphere
from tests.oracle.geometry import Hits, any_hit, closest_hit

PATHS_AT_ONCE = 2**15  # a few MiB an array
RAY_EPSILON = 1e-11  # of the scene's extent: 1e4 times the rounding error of a hit point


def render(
    scene: Scene,
    spp: int,
    bounces: int,
    rng: np.random.Generator,
    *,
    direct_light: bool = False,
    sample_brdf: bool = False,
) -> tuple[Floats, Floats]:
    """Return the mean image and its standard error, both (height, width, 3); spp >= 2.

    Parameters
    ----------
    direct_light
        Sample points on the lights; otherwise only paths that run into a light see it.
    sample_brdf
        Draw directions from the BRDF; otherwise uniformly on the sphere.
    """
    rows, columns = np.indices((scene.camera.height, scene.camera.width)).reshape(2, -1)
    total, mean, squares = 0, np.zeros((len(rows), 3)), np.zeros((len(rows), 3))
    samples_at_once = max(1, PATHS_AT_ONCE // len(rows))
    while total < spp:
        n = min(samples_at_once, spp - total)
        rays = camera_rays(scene.camera, np.tile(rows, n), np.tile(columns, n), rng)
        values = radiance(
            scene, *rays, bounces, rng, direct_light=direct_light, sample_brdf=sample_brdf
        ).reshape(n, -1, 3)
        delta = values.mean(axis=0) - mean
        squares += ((values - values.mean(axis=0)) ** 2).sum(axis=0)
        squares += delta**2 * (total * n / (total + n))
        mean += delta * n / (total + n)
        total += n
    shape = (scene.camera.height, scene.camera.width, 3)
    return mean.reshape(shape), np.sqrt(squares / (spp - 1) / spp).reshape(shape)


def camera_rays(
    camera: Camera, rows: Ints, columns: Ints, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Return origins and directions (n, 3) through points uniform in the given pixels (n,)."""
    eye, target, up = (np.asarray(v, np.float64) for v in (camera.eye, camera.target, camera.up))
    forward = normalize(target - eye)
    right = normalize(np.cross(forward, up))
    half_height = np.tan(np.radians(camera.fov) / 2)
    half_width = half_height * camera.width / camera.height
    x = half_width * (2 * (columns + rng.random(len(columns))) / camera.width - 1)
    y = half_height * (1 - 2 * (rows + rng.random(len(rows))) / camera.height)
    directions = forward + x[:, None] * right + y[:, None] * np.cross(right, forward)
    return np.tile(eye, (len(rows), 1)), normalize(directions)


def radiance(
    scene: Scene,
    origins: Floats,
    directions: Floats,
    bounces: int,
    rng: np.random.Generator,
    *,
    direct_light: bool = False,
    sample_brdf: bool = False,
) -> Floats:
    """Return one estimate (n, 3) of the radiance along each ray; options as in `render`."""
    t_min = RAY_EPSILON * _extent(scene)
    hits, wo = closest_hit(scene.shapes, origins, directions), -directions
    L = _emission(scene, hits, wo)
    paths, beta = np.arange(len(origins)), np.ones((len(origins), 3))
    for _ in range(bounces):
        going = _reflects(scene, hits)
        paths, beta, hits, wo = paths[going], beta[going], hits[going], wo[going]
        if direct_light:
            L[paths] += beta * _reflected_direct_light(scene, hits, wo, rng, t_min)
        wi, weight = _next_direction(scene, hits, wo, rng, sample_brdf)
        beta = beta * weight
        going = np.any(beta > 0, axis=1)
        specular = _is_specular(scene, hits)[going]
        paths, beta, wo = paths[going], beta[going], -wi[going]
        hits = closest_hit(scene.shapes, hits.position[going], wi[going], t_min)
        counts = specular if direct_light else np.ones(len(paths), bool)
        L[paths[counts]] += (beta * _emission(scene, hits, wo))[counts]
    return L


def _next_direction(
    scene: Scene, hits: Hits, wo: Floats, rng: np.random.Generator, sample_brdf: bool
) -> tuple[Floats, Floats]:
    """Return ω_i (n, 3) and f n·ω_i over its density (n, 3)."""
    wi = sample_uniform_sphere(rng, len(wo))
    density = np.full(len(wo), 1 / (4 * np.pi))
    if sample_brdf:
        for material, at in _hits_by_material(scene, hits):
            if isinstance(material, Mirror):
                continue
            normals = _normals(hits[at])
            wi[at] = brdf.sample(material, *normals, wo[at], rng)
            density[at] = brdf.density(material, *normals, wo[at], wi[at])
    counts = density > 0
    weight = np.zeros((len(wo), 3))
    value = _reflection(scene, hits[counts], wo[counts], wi[counts])
    weight[counts] = value / density[counts, None]
    for material, at in _hits_by_material(scene, hits):
        if isinstance(material, Mirror):
            wi[at], weight[at] = brdf.mirrored(material, *_normals(hits[at]), wo[at])
    return wi, weight


def _is_specular(scene: Scene, hits: Hits) -> Bools:
    """Return (n,) whether a ray hit a mirror, in whose direction no light is sampled."""
    mirrors = [i for i, s in enumerate(scene.shapes) if isinstance(s.material, Mirror)]
    return np.isin(hits.shape, mirrors)


def _reflected_direct_light(
    scene: Scene, hits: Hits, wo: Floats, rng: np.random.Generator, t_min: float
) -> Floats:
    """Return an estimate (n, 3) of the reflected light of all lights: one point on each."""
    reflected = np.zeros((len(wo), 3))
    for light in scene.shapes:
        if light.material is not None:
            continue
        point, normal, area = _sample_surface(light, len(wo), rng)
        to_light = point - hits.position
        distance = np.linalg.norm(to_light, axis=1)
        wi = to_light / distance[:, None]
        cos_light = np.maximum(-dot(normal, wi), 0.0)
        value = _reflection(scene, hits, wo, wi) * (cos_light * area / distance**2)[:, None]
        lit = np.any(value > 0, axis=1)
        position, t_max = hits.position[lit], distance[lit] - t_min
        lit[lit] = ~any_hit(scene.shapes, position, wi[lit], t_min, t_max)
        reflected[lit] += value[lit] * np.asarray(light.radiance, np.float64)
    return reflected


def _sample_surface(
    shape: Sphere | Mesh, n: int, rng: np.random.Generator
) -> tuple[Floats, Floats, float]:
    """Return n points and normals (n, 3), uniform in area over the shape, and its area."""
    if isinstance(shape, Sphere):
        normal = sample_uniform_sphere(rng, n)
        point = np.asarray(shape.center, np.float64) + shape.radius * normal
        return point, normal, 4 * np.pi * shape.radius**2
    a, b, c = np.moveaxis(np.asarray(shape.vertices, np.float64)[shape.faces], 1, 0)
    doubled = np.cross(b - a, c - a)
    areas = np.linalg.norm(doubled, axis=1) / 2
    chosen = rng.choice(len(areas), n, p=areas / areas.sum())
    u, v = rng.random((2, n, 1))
    u, v = np.where(u + v > 1, [1 - u, 1 - v], [u, v])
    point = (1 - u - v) * a[chosen] + u * b[chosen] + v * c[chosen]
    return point, normalize(doubled[chosen]), float(areas.sum())


def _reflection(scene: Scene, hits: Hits, wo: Floats, wi: Floats) -> Floats:
    """Return f n·ω_i (n, 3) of the surfaces that were hit."""
    value = np.zeros((len(wo), 3))
    for material, at in _hits_by_material(scene, hits):
        value[at] = brdf.evaluate(material, *_normals(hits[at]), wo[at], wi[at])
    return value


def _emission(scene: Scene, hits: Hits, wo: Floats) -> Floats:
    """Return the emitted radiance (n, 3): a light's from its front, zero from all else."""
    emitted = np.zeros((len(wo), 3))
    for index, shape in enumerate(scene.shapes):
        if shape.material is None:
            front = (hits.shape == index) & (dot(hits.geometric_normal, wo) > 0)
            emitted[front] = shape.radiance
    return emitted


def _reflects(scene: Scene, hits: Hits) -> Bools:
    """Return (n,) whether a ray hit a surface with a material; lights end paths."""
    reflecting = [i for i, shape in enumerate(scene.shapes) if shape.material is not None]
    return np.isin(hits.shape, reflecting)


def _hits_by_material(scene: Scene, hits: Hits) -> Iterator[tuple[Material, Bools]]:
    for index, shape in enumerate(scene.shapes):
        at = hits.shape == index
        if shape.material is not None and at.any():
            yield shape.material, at


def _normals(hits: Hits) -> tuple[Floats, Floats]:
    return hits.geometric_normal, hits.shading_normal


def _extent(scene: Scene) -> float:
    """Return the largest coordinate of the scene, camera included."""
    reach = [np.abs(scene.camera.eye).max()]
    for shape in scene.shapes:
        if isinstance(shape, Sphere):
            reach.append(np.abs(shape.center).max() + shape.radius)
        else:
            reach.append(np.abs(shape.vertices).max())
    return float(max(reach))
